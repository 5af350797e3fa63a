"""Rows as a table, .csv or .parquet, and back: what was judged need not be judged again."""

from collections.abc import Iterable, Mapping
import csv
from io import BytesIO, StringIO, TextIOWrapper
import os
from pathlib import Path
from typing import Any, BinaryIO

from klann_ros.log.errors import LogError
from klann_ros.sanitize.files import open_plain
from klann_ros.sanitize.text import printable

from .row import COUNTS, NAMES, Row, TEXTS

# A spreadsheet takes what begins so for a formula; what is quoted stays a text everywhere.
_FORMULA = ('=', '+', '-', '@', "'")
# Of a million runs [bytes].
_MAX_SIZE = 10**10


class TableError(LogError):
    """A table that cannot be made, or read; the text says why."""


def check_table(path: str) -> None:
    """
    Refuse a table that could not be written in the end.

    Raises
    ------
    TableError
        The name's ending tells no kind, or pyarrow is not installed.

    """
    suffix = Path(path).suffix.lower()
    if suffix not in ('.csv', '.parquet'):
        raise TableError(f'--table {printable(path)} is refused: it must end in .csv or .parquet')
    if suffix == '.parquet':
        _pyarrow()


def save_table(path: str, rows: Iterable[Row], file: BinaryIO) -> None:
    """Write rows to an open file, in the kind that the path's ending tells."""
    if Path(path).suffix.lower() == '.parquet':
        _save_parquet(rows, file)
    else:
        _save_csv(rows, file)


def rows_from_table(path: str) -> list[Row]:
    """
    Return the rows of a table that `save_table` wrote.

    Raises
    ------
    TableError
        It is no such table.
    OSError
        It cannot be read.

    """
    with open_plain(path) as file:
        if os.fstat(file.fileno()).st_size > _MAX_SIZE:
            raise TableError(f'{printable(path)} is refused above {_MAX_SIZE // 10**6} MB')
        # A size given to it would be allocated at once.
        data = file.read()
    try:
        made = _parquet_rows(data) if path.lower().endswith('.parquet') else _csv_rows(data)
        return [Row(**{name: row[name] for name in NAMES}) for row in made]
    except (KeyError, ValueError, TypeError) as error:
        what = f'{printable(path)} is no table of runs: {error}'
        raise TableError(what) from error


def _save_csv(rows: Iterable[Row], file: BinaryIO) -> None:
    text = TextIOWrapper(file, newline='', encoding='utf-8', errors='replace')
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(NAMES)
    writer.writerows([_cell(name, getattr(row, name)) for name in NAMES] for row in rows)
    text.flush()
    # The file is its opener's to close.
    text.detach()


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ''
    if name not in TEXTS:
        return repr(value)
    return f"'{value}" if value.startswith(_FORMULA) else str(value)


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
    kinds = {
        name: arrow.string() if name in TEXTS else arrow.int64() if name in COUNTS else None
        for name in NAMES
    }
    schema = arrow.schema([(name, kind or arrow.float64()) for name, kind in kinds.items()])
    columns: Mapping[str, list[Any]] = {name: [] for name in NAMES}
    for row in rows:
        for name, column in columns.items():
            column.append(getattr(row, name))
    parquet.write_table(arrow.table(columns, schema=schema), file, compression='zstd')


def _parquet_rows(data: bytes) -> list[dict[str, Any]]:
    _, parquet = _pyarrow()
    made: list[dict[str, Any]] = parquet.read_table(BytesIO(data)).to_pylist()
    return made


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa  # noqa: PLC0415 - it is optional
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        raise TableError("a .parquet needs pyarrow: pip install 'klann_ros[parquet]'") from error
    return pa, parquet
