"""Reports of a fleet: JUnit XML for CI, and an HTML index."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
import json
import os
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote
from xml.etree.ElementTree import Element, ElementTree, indent, SubElement

from klann_ros.sanitize.text import counted, printable, printable_line
from klann_ros.web.markup import element, Markup, scrolling_table, UNKNOWN_NUMBER
from klann_ros.web.parts import FRAME, Parts, SHARED

from .table import FINDINGS, OK, Row, UNREADABLE


def save_junit(rows: Sequence[Row], file: BinaryIO) -> None:
    """Write rows as JUnit XML: findings are failures, unreadable runs are errors."""
    counts = {
        'tests': str(len(rows)),
        'failures': str(sum(row.verdict == FINDINGS for row in rows)),
        'errors': str(sum(row.verdict == UNREADABLE for row in rows)),
        'skipped': '0',
    }
    root = Element('testsuites', counts)
    suite = SubElement(root, 'testsuite', {'name': 'klann_ros review', **counts})
    for row in rows:
        folder, _, name = row.run.rstrip('/').rpartition('/')
        case = SubElement(suite, 'testcase', classname=_text(folder or '.'), name=_text(name))
        if row.verdict == UNREADABLE:
            SubElement(case, 'error', type='unreadable', message=_text(row.reason))
        elif row.verdict == FINDINGS:
            check = row.reason.partition(':')[0]
            failure = SubElement(case, 'failure', type=check, message=_text(row.reason))
            failure.text = '\n'.join(
                _text(
                    printable_line(f'{each["severity"].upper()} {each["check"]}: {each["text"]}')
                )
                for each in json.loads(row.findings)
            )
    indent(root)
    ElementTree(root).write(file, encoding='utf-8', xml_declaration=True)


def _text(text: str) -> str:
    """Return a text without characters that XML 1.0 forbids."""
    return printable(text, 20_000)


_PARTS = Parts(styles=(*FRAME, SHARED / 'tables.css'), scripts=())
_HEADS = (
    'Run',
    'Finding',
    'Duration / s',
    'Messages',
    'Lost',
    'Longest gap / ms',
    'Worst angle error / rad',
    'Worst foot error / m',
)
_GROUPS = ((UNREADABLE, 'Not readable'), (FINDINGS, 'With findings'), (OK, 'Nothing found'))


def save_index(rows: Sequence[Row], path: str, pages: Mapping[str, str], file: BinaryIO) -> None:
    """Write the index at `path` to an open file, with links to the pages of runs."""
    folder = Path(path).resolve().parent
    links = {
        run: quote(os.path.relpath(Path(page).resolve(), folder))
        for run, page in pages.items()
        if page
    }
    file.write(_page(rows, links).encode(errors='replace'))


def _page(rows: Sequence[Row], links: Mapping[str, str]) -> str:
    faults = sum(row.verdict != OK for row in rows)
    title = counted(len(rows), 'run')
    verdict = f'{faults} of them not healthy' if faults else 'Healthy'
    header = element(
        'header',
        element('div', element('h1', title), element('p', _summary(rows), class_='quiet')),
        element('p', verdict, class_=f'verdict {"bad" if faults else "good"}'),
    )
    return _PARTS.page(f'Review of {title}', header, _checks(rows), *_groups(rows, links))


def _summary(rows: Sequence[Row]) -> str:
    hours = sum(row.duration or 0.0 for row in rows) / 3600.0
    messages = sum(row.messages or 0 for row in rows)
    size = sum(row.size or 0 for row in rows) / 1e9
    return f'{hours:.2f} h, {messages:,} messages, {size:.2f} GB'


def _checks(rows: Sequence[Row]) -> Markup:
    counts = Counter(
        check
        for row in rows
        for check in {
            each['check']
            for each in json.loads(row.findings)
            if each['severity'] in ('error', 'warning')
        }
    )
    if not counts:
        return Markup()
    items = (
        element('li', element('strong', check), f' in {counted(count, "run")}')
        for check, count in counts.most_common()
    )
    heading = element('h2', 'Findings by check', id='checks')
    return element('section', heading, element('ul', *items), aria_labelledby='checks')


def _groups(rows: Sequence[Row], links: Mapping[str, str]) -> Iterator[Markup]:
    for verdict, words in _GROUPS:
        own = [row for row in rows if row.verdict == verdict]
        if own:
            heading = element('h2', f'{words} ({len(own)})', id=verdict)
            table = scrolling_table(
                words, _HEADS, (_row(row, links.get(row.run, '')) for row in own)
            )
            yield element('section', heading, table, aria_labelledby=verdict)


def _row(row: Row, link: str) -> tuple[str, ...]:
    return (
        element('a', row.run, href=link) if link else row.run,
        element('span', row.reason, class_='reason'),
        _number(row.duration, '.2f'),
        _number(row.messages, ','),
        _number(row.lost, ','),
        _number(row.longest_gap and row.longest_gap * 1e3, '.1f'),
        _number(row.worst_angle_error, '.2g'),
        _number(row.worst_foot_error, '.2g'),
    )


def _number(value: float | None, form: str) -> str:
    return UNKNOWN_NUMBER if value is None else format(value, form)
