"""The row of a run, and the reports of all rows: tables, JUnit XML for CI, and an HTML index."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import asdict, dataclass, fields
from io import BytesIO, StringIO
import json
from math import isfinite
import os
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote
from xml.etree.ElementTree import Element, ElementTree, indent, SubElement

from klann_ros.cli import harmless, write_table
from klann_ros.log.errors import LogError
from klann_ros.review.model.review import Finding, located, Review, ReviewedLeg, Severity
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import counted, finite, printable, printable_line
from klann_ros.web import element, FRAME, Markup, number, Parts, scrolling_table, SHARED

OK, FINDINGS, UNREADABLE = 'ok', 'findings', 'unreadable'
EXIT_CODES = {OK: 0, FINDINGS: 1, UNREADABLE: 2}


@dataclass(frozen=True)
class Row:
    """The row of a run; None for unknown. Figures of legs are the worst, or largest, of all."""

    run: str  #: its path
    verdict: str  #: 'ok', 'findings' or 'unreadable'
    reason: str = ''  #: the most severe finding, or why it cannot be read; '' for none
    # Number of findings; allowed ones are in no other number.
    errors: int = 0
    warnings: int = 0
    notes: int = 0
    allowed: int = 0
    start_time: float | None = None  #: [s since the epoch]
    duration: float | None = None  #: [s]
    size: int | None = None  #: of its files [bytes]
    modified: int | None = None  #: latest modification [ns since the epoch]
    messages: int | None = None
    topics: int | None = None
    legs: int | None = None
    poses: int | None = None
    lost: int | None = None  #: known number of lost messages
    longest_gap: float | None = None  #: on any topic [s]
    turns: float | None = None  #: net turns of a crank
    stride: float | None = None  #: [m]
    lift: float | None = None  #: [m]
    worst_residual: float | None = None  #: [m]
    worst_angle_error: float | None = None  #: [rad]
    worst_foot_error: float | None = None  #: [m]
    worst_transmission_angle: float | None = None  #: [rad]
    findings: str = '[]'  #: as a JSON list
    settings: str = ''  #: hash of limits, reference and expectations

    @property
    def exit_code(self) -> int:
        """Return the exit code of `review` for this run."""
        return EXIT_CODES[self.verdict]


NAMES = tuple(field.name for field in fields(Row))
# By their kinds, for tables that have types.
TEXTS = frozenset({'run', 'verdict', 'reason', 'findings', 'settings'})
COUNTS = frozenset(field.name for field in fields(Row) if 'int' in str(field.type))


def unreadable_row(path: str, reason: object, **known: Any) -> Row:
    """Return the row of an unreadable run."""
    shown = printable(path)
    # The row has the path already.
    words = printable_line(reason).removeprefix(f'{shown} ')
    return Row(shown, UNREADABLE, words, **known)


def reviewed_row(
    path: str, review: Review, found: Iterable[Finding], allowed: frozenset[str], **known: Any
) -> Row:
    """Return the row of a reviewed run; `allowed` are the checks whose findings do not count."""
    findings = list(found)
    judged = [each for each in findings if each.check not in allowed]
    faults = sorted((each for each in judged if each.is_fault), key=lambda each: -each.severity)
    recording, legs = review.recording, review.legs
    gaps = (topic.longest_gap for topic in review.topics)
    values: dict[str, Any] = {
        'run': printable(path),
        'verdict': FINDINGS if faults else OK,
        'reason': f'{faults[0].check}: {located(faults[0].leg, faults[0].text)}' if faults else '',
        **{
            f'{severity.name.lower()}s': sum(each.severity == severity for each in judged)
            for severity in Severity
        },
        'allowed': len(findings) - len(judged),
        'start_time': recording.start / 1e9,
        'duration': recording.duration,
        'messages': sum(topic.count for topic in review.topics),
        'topics': len(review.topics),
        'legs': len(legs),
        'poses': sum(len(leg.recording.poses) for leg in legs),
        'lost': sum(topic.lost or 0 for topic in review.topics),
        'longest_gap': max(filter(isfinite, gaps), default=None),
        'turns': _of_legs(legs, 'turns', lambda found: max(found, key=abs)),
        **{name: _of_legs(legs, name, max) for name in _MAXIMA},
        'worst_transmission_angle': _of_legs(legs, 'worst_transmission_angle', min),
        'findings': json.dumps(
            [_finding_values(each, allowed) for each in findings], ensure_ascii=False
        ),
    }
    return Row(**values, **known)


_MAXIMA = ('stride', 'lift', 'worst_residual', 'worst_angle_error', 'worst_foot_error')


def _finding_values(finding: Finding, allowed: frozenset[str]) -> dict[str, Any]:
    severity = 'allowed' if finding.check in allowed else finding.severity.name.lower()
    values = {**asdict(finding), 'severity': severity, 'text': printable_line(finding.text)}
    return dict(finite(values))


def _of_legs(
    legs: Iterable[ReviewedLeg], name: str, chosen: Callable[[list[float]], float]
) -> float | None:
    known = [value for leg in legs if isfinite(value := getattr(leg.figures, name))]
    return chosen(known) if known else None


# Largest table that is read [bytes]: of a million runs.
_MAX_TABLE_SIZE = 10**10


class TableError(LogError):
    """A table that cannot be made, or read; the text says why."""


def check_table(path: str) -> None:
    """Raise a TableError for another ending than .csv and .parquet, or without pyarrow."""
    suffix = Path(path).suffix.lower()
    if suffix not in ('.csv', '.parquet'):
        raise TableError(f'--table {printable(path)} is refused: it must end in .csv or .parquet')
    if suffix == '.parquet':
        _pyarrow()


def save_table(path: str, rows: Iterable[Row], file: BinaryIO) -> None:
    """Write rows to an open file, in the format of the path's ending."""
    if Path(path).suffix.lower() == '.parquet':
        _save_parquet(rows, file)
    else:
        cells = ([_cell(name, getattr(row, name)) for name in NAMES] for row in rows)
        write_table((NAMES, *cells), file)


def rows_from_table(path: str) -> list[Row]:
    """Return the rows of a table by `save_table`; a TableError for another file."""
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size > _MAX_TABLE_SIZE:
            raise TableError(f'{printable(path)} is refused above {_MAX_TABLE_SIZE // 10**6} MB')
        # A size given to it would be allocated at once.
        data = file.read()
    try:
        if path.lower().endswith('.parquet'):
            made = _pyarrow()[1].read_table(BytesIO(data)).to_pylist()
        else:
            made = _csv_rows(data)
        return [Row(**{name: row[name] for name in NAMES}) for row in made]
    except (KeyError, ValueError, TypeError) as error:
        raise TableError(f'{printable(path)} is no table of runs: {error}') from error


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ''
    if name not in TEXTS:
        return repr(value)
    # A quote of its own is marked, too.
    return f"'{value}" if value.startswith("'") else harmless(value)


def _csv_rows(data: bytes) -> list[dict[str, Any]]:
    reader = csv.DictReader(StringIO(data.decode(), newline=''))
    return [{name: _value(name, cells[name]) for name in NAMES} for cells in reader]


def _value(name: str, cell: str) -> Any:
    if name in TEXTS:
        return cell.removeprefix("'")
    if not cell:
        return None
    return int(cell) if name in COUNTS else float(cell)


def _save_parquet(rows: Iterable[Row], file: BinaryIO) -> None:
    arrow, parquet = _pyarrow()
    kinds = (
        arrow.string() if name in TEXTS else arrow.int64() if name in COUNTS else arrow.float64()
        for name in NAMES
    )
    schema = arrow.schema([*zip(NAMES, kinds, strict=True)])
    table = arrow.Table.from_pylist([*map(asdict, rows)], schema=schema)
    parquet.write_table(table, file, compression='zstd')


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa  # noqa: PLC0415 - it is optional
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        raise TableError("a .parquet needs pyarrow: pip install 'klann_ros[parquet]'") from error
    return pa, parquet


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
        number(row.duration, '.2f'),
        number(row.messages, ','),
        number(row.lost, ','),
        number(row.longest_gap and row.longest_gap * 1e3, '.1f'),
        number(row.worst_angle_error, '.2g'),
        number(row.worst_foot_error, '.2g'),
    )
