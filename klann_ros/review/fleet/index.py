"""The index page of many runs: one table that sorts, filters, and stacks on a phone."""

from collections import Counter
from collections.abc import Mapping, Sequence
import json
from math import degrees
import os
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

from klann_ros.sanitize.text import counted
from klann_ros.web import breakable, element, FRAME, Markup, number, Parts, scrolling_table, SHARED

from .rows import FINDINGS, OK, Row, UNREADABLE

_PARTS = Parts(
    styles=(*FRAME, SHARED / 'tables.css', SHARED / 'sortable.css'),
    scripts=(SHARED / 'sortable.js',),
)
_HEADS = (
    'Run',
    'Verdict',
    'Finding',
    'Duration / s',
    'Messages',
    'Lost',
    'Longest gap / ms',
    'Worst angle error / deg',
    'Worst foot error / mm',
)
# The most severe first.
_VERDICTS = {UNREADABLE: 'not readable', FINDINGS: 'findings', OK: 'nothing found'}
_CHIPS = {UNREADABLE: 'chip-bad', FINDINGS: 'chip-warn', OK: 'chip-good'}


def save_index(rows: Sequence[Row], path: str, pages: Mapping[str, str], file: BinaryIO) -> None:
    """Write the index at `path` to an open file, with links to the pages of runs."""
    folder = Path(path).resolve().parent
    links = {}
    for run, page in pages.items():
        if page:
            links[run] = quote(Path(os.path.relpath(Path(page).resolve(), folder)).as_posix())
    file.write(_page(rows, links).encode(errors='replace'))


def _page(rows: Sequence[Row], links: Mapping[str, str]) -> str:
    fault_count = sum(row.verdict != OK for row in rows)
    title = counted(len(rows), 'run')
    verdict = f'{fault_count} of them not healthy' if fault_count else 'Healthy'
    header = element(
        'header',
        element('div', element('h1', title), element('p', _summary(rows), class_='quiet')),
        element('p', verdict, class_=f'verdict {"bad" if fault_count else "good"}'),
    )
    severities = [*_VERDICTS]
    sorted_rows = sorted(rows, key=lambda row: severities.index(row.verdict))
    parent = _common_folder([row.run for row in rows])
    cells = [_cells(row, links.get(row.run, ''), parent) for row in sorted_rows]
    heading = element('h2', f'Runs in {parent}' if parent else 'Runs', id='runs')
    table = scrolling_table('Runs', _HEADS, cells, 'sortable')
    section = element('section', heading, _filters(rows), table, aria_labelledby='runs')
    return _PARTS.page(f'Review of {title}', header, section)


def _common_folder(runs: Sequence[str]) -> str:
    """Return the folder that all runs are in, with a slash at its end; '' for none."""
    folders = [os.path.dirname(run) for run in runs]  # noqa: PTH120 - '' without one
    try:
        folder = os.path.commonpath(folders)
    except ValueError:
        # Some are absolute, some are not.
        return ''
    return f'{folder.rstrip(os.sep)}{os.sep}' if folder else ''


def _summary(rows: Sequence[Row]) -> str:
    duration = 0.0
    message_count = 0
    size = 0
    for row in rows:
        duration += row.duration or 0.0
        message_count += row.messages or 0
        size += row.size or 0
    size_text = f'{size / 1e6:.1f} MB' if size < 1e9 else f'{size / 1e9:.1f} GB'
    return f'{_duration(duration)}, {message_count:,} messages, {size_text}'


def _duration(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    if seconds < 120.0:
        return f'{seconds:.1f} s'
    return f'{seconds / 60.0:.1f} min' if seconds < 7200.0 else f'{seconds / 3600.0:.1f} h'


def _filters(rows: Sequence[Row]) -> Markup:
    """Return a field and menus that choose rows of the table; scripts show them."""
    verdicts = Counter(row.verdict for row in rows)
    options = [element('option', f'all ({len(rows)})', value='')]
    for verdict, words in _VERDICTS.items():
        if verdicts[verdict]:
            options.append(element('option', f'{words} ({verdicts[verdict]})', value=words))
    checks = Counter[str]()
    for row in rows:
        checks.update(_faulty_checks(row))
    check_options = [element('option', 'all', value='')]
    for check, count in checks.most_common():
        check_options.append(element('option', f'{check} ({count})', value=check))
    text = element('input', type='search', data_filter='text')
    verdict_menu = element('select', *options, data_filter='verdict')
    check_menu = element('select', *check_options, data_filter='checks')
    return element(
        'div',
        element('label', 'Search ', text),
        element('label', 'Verdict ', verdict_menu),
        element('label', 'Check ', check_menu) if checks else '',
        element('p', class_='quiet', role='status', data_shown='runs'),
        class_='filters',
        hidden=True,
    )


def _faulty_checks(row: Row) -> set[str]:
    findings = json.loads(row.findings)
    return {entry['check'] for entry in findings if entry['severity'] in ('error', 'warning')}


def verdict_chip(row: Row) -> Markup:
    """Return the verdict of a run in words and in colour, by which the filters choose."""
    words = _VERDICTS[row.verdict]
    checks = ' '.join(sorted(_faulty_checks(row)))
    class_ = f'chip {_CHIPS[row.verdict]}'
    return element('span', words, class_=class_, data_verdict=words, data_checks=checks)


def _cells(row: Row, link: str, parent: str) -> tuple[str, ...]:
    name = breakable(row.run.removeprefix(parent))
    angle_error = row.worst_angle_error
    return (
        element('a', name, href=link) if link else name,
        verdict_chip(row),
        element('span', row.reason, class_='reason'),
        number(row.duration, '.2f'),
        number(row.messages, ','),
        number(row.lost, ','),
        number(row.longest_gap and row.longest_gap * 1e3, '.1f'),
        number(angle_error and degrees(angle_error), '.2g'),
        number(row.worst_foot_error and row.worst_foot_error * 1e3, '.2g'),
    )
