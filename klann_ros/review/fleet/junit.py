"""Rows as JUnit's XML, which every CI shows: a run is a test case."""

from collections.abc import Sequence
import json
from typing import BinaryIO
from xml.etree.ElementTree import Element, ElementTree, indent, SubElement

from klann_ros.sanitize.text import printable, printable_line

from .row import FINDINGS, Row, UNREADABLE


def save_junit(rows: Sequence[Row], file: BinaryIO) -> None:
    """Write rows to an open file: findings are failures, what cannot be read is an error."""
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
            failure.text = '\n'.join(_text(line) for line in _lines(row))
    indent(root)
    ElementTree(root).write(file, encoding='utf-8', xml_declaration=True)


def _lines(row: Row) -> list[str]:
    return [
        printable_line(f'{each["severity"].upper()} {each["check"]}: {each["text"]}')
        for each in json.loads(row.findings)
    ]


def _text(text: str) -> str:
    """Return a text without what XML 1.0 cannot hold."""
    return printable(text, 20_000)
