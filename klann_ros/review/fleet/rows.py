"""The row of a run, and the reports of all rows: tables, and JUnit XML for CI."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
import csv
from dataclasses import asdict, dataclass, fields
from io import BytesIO, StringIO
import json
from math import isfinite
import os
from pathlib import Path, PurePath
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element, ElementTree, indent, SubElement

from klann_ros.cli import harmless, write_table
from klann_ros.log.errors import LogError
from klann_ros.missing_package import install_command
from klann_ros.review.model.review import Finding, located, Review, ReviewedLeg, Severity
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import finite, printable, printable_line

OK = 'ok'
FINDINGS = 'findings'
UNREADABLE = 'unreadable'
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
    lost: int | None = None  #: known number of lost messages; None if it is known of no topic
    longest_gap: float | None = None  #: on any topic with a rate [s]
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
# Figures of legs whose largest value a row has.
_LARGEST_FIGURES = ('stride', 'lift', 'worst_residual', 'worst_angle_error', 'worst_foot_error')


def reviewed_row(path: str, review: Review, allowed_checks: frozenset[str], **columns: Any) -> Row:
    """
    Return the row of a reviewed run; `columns` are further ones, such as its settings.

    Findings of allowed checks do not count.
    """
    findings = review.findings
    counted_findings = [finding for finding in findings if finding.check not in allowed_checks]
    faults = [finding for finding in counted_findings if finding.is_fault]
    reason = ''
    if faults:
        worst = max(faults, key=lambda fault: fault.severity)
        reason = f'{worst.check}: {located(worst.leg, worst.text)}'
    severities = Counter(finding.severity for finding in counted_findings)
    topics = review.topics
    legs = review.legs
    losses = [topic.lost for topic in topics if topic.lost is not None]
    periodic = [topic.figures for topic in review.recording.topics if topic.is_periodic]
    turns = _finite_figures(legs, 'turns')
    transmission_angles = _finite_figures(legs, 'worst_transmission_angle')
    largest: dict[str, Any] = {}
    for name in _LARGEST_FIGURES:
        largest[name] = max(_finite_figures(legs, name), default=None)
    return Row(
        run=printable(path),
        verdict=FINDINGS if faults else OK,
        reason=reason,
        errors=severities[Severity.ERROR],
        warnings=severities[Severity.WARNING],
        notes=severities[Severity.NOTE],
        allowed=len(findings) - len(counted_findings),
        start_time=review.recording.start / 1e9,
        duration=review.recording.duration,
        messages=sum(topic.count for topic in topics),
        topics=len(topics),
        legs=len(legs),
        poses=sum(len(leg.recording.poses) for leg in legs),
        lost=sum(losses) if losses else None,
        longest_gap=max(filter(isfinite, (topic.longest_gap for topic in periodic)), default=None),
        turns=max(turns, key=abs, default=None),
        worst_transmission_angle=min(transmission_angles, default=None),
        findings=_findings_json(findings, allowed_checks),
        **largest,
        **columns,
    )


def _findings_json(findings: Iterable[Finding], allowed_checks: frozenset[str]) -> str:
    entries = []
    for finding in findings:
        is_allowed = finding.check in allowed_checks
        severity = 'allowed' if is_allowed else finding.severity.name.lower()
        text = printable_line(finding.text)
        entries.append(dict(finite({**asdict(finding), 'severity': severity, 'text': text})))
    return json.dumps(entries, ensure_ascii=False)


def _finite_figures(legs: Iterable[ReviewedLeg], name: str) -> list[float]:
    """Return a figure of each leg that has it."""
    return [*filter(isfinite, (getattr(leg.figures, name) for leg in legs))]


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
        write_table((NAMES, *map(_csv_cells, rows)), file)


def rows_from_table(path: str) -> list[Row]:
    """Return the rows of a table by `save_table`; a TableError for another file."""
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size > _MAX_TABLE_SIZE:
            raise TableError(f'{printable(path)} is refused above {_MAX_TABLE_SIZE // 10**6} MB')
        # A size given to it would be allocated at once.
        data = file.read()
    try:
        if path.lower().endswith('.parquet'):
            _, parquet = _pyarrow()
            records = parquet.read_table(BytesIO(data)).to_pylist()
            return [Row(**{name: record[name] for name in NAMES}) for record in records]
        table = csv.DictReader(StringIO(data.decode(), newline=''))
        return [Row(**{name: _parse_cell(name, cells[name]) for name in NAMES}) for cells in table]
    except (AttributeError, KeyError, ValueError, TypeError, csv.Error) as error:
        raise TableError(f'{printable(path)} is no table of runs: {error}') from error


def _csv_cells(row: Row) -> list[str]:
    cells = []
    for name in NAMES:
        field_value = getattr(row, name)
        if field_value is None:
            cells.append('')
        elif name not in TEXTS:
            cells.append(repr(field_value))
        elif field_value.startswith("'"):
            # A quote of the text is marked, too.
            cells.append(f"'{field_value}")
        else:
            cells.append(harmless(field_value))
    return cells


def _parse_cell(name: str, cell: str) -> Any:
    if name in TEXTS:
        return cell.removeprefix("'")
    if not cell:
        return None
    return int(cell) if name in COUNTS else float(cell)


def _save_parquet(rows: Iterable[Row], file: BinaryIO) -> None:
    arrow, parquet = _pyarrow()
    columns = []
    for name in NAMES:
        number_type = arrow.int64() if name in COUNTS else arrow.float64()
        columns.append((name, arrow.string() if name in TEXTS else number_type))
    table = arrow.Table.from_pylist([*map(asdict, rows)], schema=arrow.schema(columns))
    parquet.write_table(table, file, compression='zstd')


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa  # noqa: PLC0415 - it is optional
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        remedy = install_command('pyarrow', 'parquet')
        if not isinstance(error, ModuleNotFoundError):  # such as that of another NumPy
            remedy = printable_line(error)
        raise TableError(f'a .parquet needs pyarrow: {remedy}') from error
    return pa, parquet


def save_junit(rows: Sequence[Row], file: BinaryIO) -> None:
    """Write rows as JUnit XML: findings are failures, unreadable runs are errors."""
    verdicts = Counter(row.verdict for row in rows)
    counts = {
        'tests': str(len(rows)),
        'failures': str(verdicts[FINDINGS]),
        'errors': str(verdicts[UNREADABLE]),
        'skipped': '0',
    }
    root = Element('testsuites', counts)
    suite = SubElement(root, 'testsuite', {'name': 'klann_ros review', **counts})
    for row in rows:
        run = PurePath(_text(row.run))
        case = SubElement(suite, 'testcase', classname=str(run.parent), name=run.name)
        if row.verdict == UNREADABLE:
            SubElement(case, 'error', type='unreadable', message=_text(row.reason))
        elif row.verdict == FINDINGS:
            check = row.reason.partition(':')[0]
            failure = SubElement(case, 'failure', type=check, message=_text(row.reason))
            failure.text = '\n'.join(map(_finding_line, json.loads(row.findings)))
    indent(root)
    ElementTree(root).write(file, encoding='utf-8', xml_declaration=True)


def _finding_line(finding: Mapping[str, Any]) -> str:
    severity = finding['severity'].upper()
    return _text(printable_line(f'{severity} {finding["check"]}: {finding["text"]}'))


def _text(text: str) -> str:
    """Return a text without characters that XML 1.0 forbids."""
    return printable(text, 20_000)
