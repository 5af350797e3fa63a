"""Measurements from a table: of a logger, a spreadsheet or a video analysis."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
import csv
import re
from typing import NamedTuple

from klann_ros.cli import decoded_text
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.quantity import si_size
from klann_ros.sanitize.text import did_you_mean, listed, printable
import numpy as np

from .load import Loaded, paired, RawSeries, Request
from .measurements import kind_of, MeasurementError

TABLE_SUFFIXES = ('.csv', '.tsv', '.txt')
MAX_TABLE_SIZE = 256 * 1024 * 1024
COMMENTS = ('#', '%', '//')
MAX_HEADER_LINES = 2
# Names of columns, by their role.
ROLES = {
    'time': ('time', 't', '__time', 'timestamp'),
    # The stamp of a message.
    'sec': ('sec', 'secs'),
    'nanosec': ('nanosec', 'nanosecs', 'nsecs'),
    'frame': ('frame', 'frames', 'frame number', 'frame_number', 'framenumber'),
    'crank': ('crank', 'crank_angle', 'crank angle'),
}
# Parts of the names of columns that are fields of messages (PlotJuggler).
MESSAGE_FIELDS = {'point', 'pose', 'position', 'transform', 'translation', 'data'}
_UNIT = re.compile(r'^(.+?)(?:\s*[\[(]\s*(.+?)\s*[\])]|[ _](deg|min|[mun]s|mm|cm|rad|px|s|m))$')
# Hours, minutes, seconds and their decimals (Kinovea).
_TIME_CODE = re.compile(r'(\d{1,3}):(\d\d):(\d\d)[:.](\d{2,3})')
# A comma that does not group thousands.
_DECIMAL_COMMA = re.compile(r'[+-]?(0,|\d+,(?!\d{3}$))')
_STAMP = re.compile(r'^.*[./_]stamp[./_]')
_AXIS = re.compile(r'^(.+?)[_./ ]+([xyXY])$')


class TableOptions(NamedTuple):
    """How a table is read: columns by their role, the frame rate, the unit of angles."""

    columns: Mapping[str, str] = {}
    rate: float | None = None  # [1/s]
    angle_unit: str = ''  # 'rad', 'deg', or '' if the header or the angles tell


class Column(NamedTuple):
    """A column of a table: its name, what it measures, its unit, and its numbers."""

    name: str
    role: str
    unit: str
    numbers: FloatArray

    def si_numbers(self, unit: str = '') -> FloatArray:
        """Return the numbers in SI units; `unit` is that of a header without one."""
        unit = self.unit or unit
        # Pixels have any scale.
        size = 1.0 if unit in {'', 'px', 'pixels'} else si_size(unit)
        if size is None:
            problem = f'{printable(unit)} is no known unit, such as deg, rad, mm, in, ms or px'
            raise MeasurementError(f'column {printable(self.name)}: {problem}')
        return self.numbers * size


def load_table(
    path: str, leg: RobotLeg, requests: Sequence[Request], options: TableOptions
) -> Loaded:
    """
    Return the measurements of a table: `time` [s], `crank` [rad], `H.x`, `H.y` [m], ...

    Angles and distances are single columns, such as `theta` [rad] and `A-H` [m]; empty fields were
    not measured. Requests name columns; by default all are read.
    """
    columns = _columns(path, leg)
    by_role = {column.role: column for column in columns}
    for role, name in options.columns.items():
        by_role[role] = _column(path, columns, name)
    requested = {request.name: request.topic for request in requests}
    roles = {role.removesuffix('.x').removesuffix('.y') for role in by_role} - {'', *ROLES}
    names = [*requested]
    for name in () if requests else sorted(roles):
        with suppress(MeasurementError):
            kind_of(leg.linkage, name)
            names.append(name)
    if not names:
        for name in sorted(roles):
            kind_of(leg.linkage, name)
        raise MeasurementError(
            f'{printable(path)} has no column of a point, as H.x: there are '
            f'{listed([column.name for column in columns], 12)}. Name them by their numbers, as '
            f'--column time=1 --column H.x=2 --column H.y=3'
        )
    times = _times(path, by_role, len(columns[0].numbers), options)
    quantities = []
    for name in names:
        kind = kind_of(leg.linkage, name)
        source = requested.get(name, name)
        numbers = []
        for suffix in ('.x', '.y') if kind == 'point' else ('',):
            column = by_role.get(source + suffix) or _column(path, columns, source + suffix)
            numbers.append(column.si_numbers(options.angle_unit if kind == 'angle' else ''))
        title = f'column {printable(source)}'
        quantities.append(RawSeries(kind, name, times, np.column_stack(numbers), source=title))
    crank = by_role.get('crank')
    unit = 'rad' if crank and crank.unit else options.angle_unit
    measured, notes = paired(leg, quantities, crank and (times, crank.si_numbers()), unit)
    for name in () if requests else sorted(roles - {*names}):
        notes.append(f'not used: column {printable(name)}')
    return Loaded(measured, notes)


def _times(
    path: str, by_role: Mapping[str, Column], count: int, options: TableOptions
) -> FloatArray:
    """Return the times of the rows [s], by a column of times or of frames."""
    column = by_role.get('time')
    if column is None and {'sec', 'nanosec'} <= by_role.keys():
        return by_role['sec'].numbers + 1e-9 * by_role['nanosec'].numbers
    if options.rate:
        column = column or by_role.get('frame')
        frames: FloatArray = column.numbers if column else np.arange(float(count))
        return frames / options.rate
    if column is None:
        raise MeasurementError(
            f'{printable(path)} has no column time: name it, as --column time=1, or sec and '
            f'nanosec, or tell the frames a second with --rate'
        )
    return column.si_numbers()


def _column(path: str, columns: Sequence[Column], name: str) -> Column:
    """Return a column by its name, its role, or its number from 1 on."""
    matches = [column for column in columns if name in {column.name, column.role}]
    if not matches and name.isdecimal() and 0 < int(name) <= len(columns):
        matches = [columns[int(name) - 1]]
    if len(matches) == 1:
        return matches[0]
    names = [column.name for column in columns]
    problem = 'several columns' if matches else 'no column'
    listing = f'{listed(names, 12)}{did_you_mean(name, names)}'
    raise MeasurementError(
        f'{printable(path)} has {problem} {printable(name)}: there are {listing}, numbered '
        f'1 to {len(columns)}'
    )


class _Rows(NamedTuple):
    """The rows of a table, the names of its columns, and the names of tracks by first row."""

    names: list[str]
    numbers: list[list[float | None]]
    tracks: dict[int, str]


def _columns(path: str, leg: RobotLeg) -> list[Column]:
    """
    Return the columns of a table whose header may be missing, of two lines, or a comment.

    Columns of words, such as names of frames, are NaN. Tracks that follow one another, each after
    a comment with its name (Kinovea), are columns beside one another.
    """
    names, rows, tracks = _rows(path)
    table = np.array(rows, dtype=np.float64)
    if {name.lower() for name in names[1:]} == {'x', 'y'}:
        parts = np.split(table, [*tracks][1:])
        if any(not np.array_equal(part[:, 0], parts[0][:, 0]) for part in parts):
            raise MeasurementError(
                f'{printable(path)} has {len(parts)} tracks of different times: export them over '
                f'the same frames, or one in each file'
            )
        table = np.hstack([parts[0], *(part[:, 1:] for part in parts[1:])])
        axes = [f'{track}.{axis}' for track in tracks.values() for axis in names[1:]]
        names = [names[0], *(axis.removeprefix('.') for axis in axes)]
    columns = []
    for n, numbers in enumerate(table.T):
        role, unit = _role(names[n], leg)
        columns.append(Column(names[n] or str(n + 1), role, unit, numbers))
    return columns


def _rows(path: str) -> _Rows:
    lines = decoded_text(path, MeasurementError, MAX_TABLE_SIZE).splitlines()
    lines = ['' if line.startswith('sep=') else line for line in lines]
    likely = [line for line in lines if line.strip() and not line.startswith(COMMENTS)]
    delimiter = next((m for m in ';\t,' if 2 * sum(m in x for x in likely) > len(likely)), ' ')
    words = likely[len(likely) // 2].replace(', ', ',').split() if likely else ()
    if delimiter == ',' and len(words) > 1 and None not in map(_number, _decimal(words)):
        delimiter = ' '
    header: list[list[str]] = []
    comments: list[list[str]] = []
    rows = _Rows([], [], {})
    for n, line in enumerate(lines):
        is_comment = line.startswith(COMMENTS)
        cells = _cells(line.lstrip('#%/ ') if is_comment else line, delimiter)
        if is_comment or not any(cells):
            comments += [cells] * any(cells)
            continue
        # Between commas a comma may group thousands.
        row = [*map(_number, cells if delimiter == ',' else _decimal(cells))]
        is_header = row[cells.index(next(filter(None, cells)))] is None
        if is_header and not rows.numbers and len(header) < MAX_HEADER_LINES:
            # Notes may stand above it.
            header += [cells] * (len(cells) > 1)
            continue
        first_row = rows.numbers[0] if rows.numbers else row
        problem = 'it begins with a word' if is_header else _row_problem(row, first_row)
        if problem:
            place = f'{printable(path)}, line {n + 1}'
            raise MeasurementError(f'{place} is no table of numbers: {problem}')
        if not rows.numbers:
            rows.names.extend(_header_names(header, comments, len(row)))
        if not rows.numbers or (row[0] or 0.0) < (rows.numbers[-1][0] or 0.0):
            has_name = comments and not header and comments[-1] != rows.names
            rows.tracks[len(rows.numbers)] = ' '.join(comments[-1]) if has_name else ''
        rows.numbers.append(row)
    if not rows.numbers:
        raise MeasurementError(f'{printable(path)} has no column time: it has no numbers')
    return rows


def _decimal(cells: Sequence[str]) -> list[str]:
    """Return cells with points for decimal commas."""
    return [cell.replace(',', '.') for cell in cells]


def _number(cell: str) -> float | None:
    """Return the number in a cell, or the seconds of a time code; NaN of none, None of a word."""
    with suppress(ValueError):
        return float((cell.replace(',', '.') if _DECIMAL_COMMA.match(cell) else cell) or 'nan')
    code = _TIME_CODE.fullmatch(cell)
    if code is None:
        return None
    hours, minutes, seconds, decimals = code.groups()
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(f'{seconds}.{decimals}')


def _row_problem(row: Sequence[float | None], first_row: Sequence[float | None]) -> str:
    """Return why a row is none of the table of the first one; '' if it is one."""
    if len(row) != len(first_row):
        return f'{len(row)} cells for {len(first_row)} columns'
    for n, (number, first_number) in enumerate(zip(row, first_row, strict=True), start=1):
        # A cell without anything (NaN) may be in any column.
        if number == number and (number is None) != (first_number is None):  # noqa: PLR0124
            return f'column {n} has words and numbers'
    return ''


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without quotes."""
    if delimiter == ' ':
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error as error:
        raise MeasurementError(f'{printable(line[:40])} is no line of a table: {error}') from None
    return [cell.strip() for cell in cells]


def _header_names(
    header: Sequence[list[str]], comments: Sequence[list[str]], count: int
) -> list[str]:
    """Return the names of columns; of two lines the first has points over their x and y."""
    if not header:
        # A note may have as many words as the table has columns.
        likely = [cells for cells in comments if len(cells) == count]
        likely.sort(key=lambda cells: cells[0].lower() in (*ROLES['time'], *ROLES['frame']))
        return likely[-1] if likely else [''] * count
    points, names = ([*cells, *[''] * count][:count] for cells in (header[0], header[-1]))
    point = ''
    for n, cell in enumerate(points if len(header) > 1 else ()):
        point = cell or point
        names[n] = f'{point}.{names[n]}' if point else names[n]
    return names


def _role(name: str, leg: RobotLeg) -> tuple[str, str]:
    """Return what a column measures, such as 'time' or 'H.x', and its unit, '' if unknown."""
    match = _UNIT.match(name)
    base = match[1] if match else name
    unit = (match[2] or match[3]).lower() if match else ''
    unit = 'deg' if unit.startswith(('deg', '°')) else unit
    if base == leg.linkage.joint_names[0]:
        return 'crank', unit
    for role, words in ROLES.items():
        if _STAMP.sub('', base.lower()) in words:
            return role, unit
    parts = [part for part in base.split('/') if part.lower() not in MESSAGE_FIELDS]
    if len(parts) > 1 and parts[-1] in {leg.crank_joint, 'crank_angle'}:
        return 'crank', unit
    axis = _AXIS.match('.'.join(parts[-2:]))
    if axis is None:
        return base, unit
    points = {point.lower(): point for point in leg.linkage.structure.points}
    return f'{points.get(axis[1].lower(), axis[1])}.{axis[2].lower()}', unit
