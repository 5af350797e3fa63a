"""Tables as text (CSV), as spreadsheets of any locale write them."""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Sequence
import csv
from io import StringIO, TextIOWrapper
from typing import BinaryIO, NamedTuple

from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import listed, printable

DELIMITERS = ',;\t'
# First bytes of .xlsx and .ods.
WORKBOOK = b'PK\x03\x04'
# The last four are the first in the full width of Chinese and Japanese.
_FORMULA_STARTS = ('=', '+', '-', '@', '\t', '\r', '\n', '\uff1d', '\uff0b', '\uff0d', '\uff20')


class TableRow(NamedTuple):
    """A row of a table: where it is, such as 'class.csv, line 2', its line, and its cells."""

    place: str
    line: int
    cells: dict[str, str]


def read_table(
    path: str, columns: Sequence[str], error_type: type[Exception], max_size: int
) -> list[TableRow]:
    """
    Return the rows of a table with these columns and any others, without empty ones.

    The names of these columns may be in capitals. The encoding, the delimiter and quotes are those
    of any spreadsheet. A short row lacks its last columns. An error of `error_type` in one line
    means that the file cannot be read, is longer than `max_size` bytes, is no table, or has not
    these columns, once each.
    """
    file = printable(path)
    text = decoded_text(path, error_type, max_size)
    if text.startswith('sep='):
        # The line by which spreadsheets give the separator.
        text = text.partition('\n')[2]
    head = text.partition('\n')[0]
    delimiter = max(DELIMITERS, key=head.count)
    reader = csv.reader(StringIO(text, newline=''), delimiter=delimiter, strict=True)
    try:
        names = [_column_name(cell, columns) for cell in next(reader, ())]
        missing = [name for name in columns if name not in names]
        if missing:
            raise error_type(
                f'{file} has no column {listed(missing)}: its first line must have '
                f'{", ".join(columns)}'
            )
        repeated = [name for name in columns if names.count(name) > 1]
        if repeated:
            raise error_type(f'{file} has the column {listed(repeated)} twice')
        rows = []
        for cells in reader:
            if not any(map(str.strip, cells)):
                continue
            place = f'{file}, line {reader.line_num}'
            if any(map(str.strip, cells[slice(len(names), None)])):
                raise error_type(
                    f'{place}: {len(cells)} cells for {len(names)} columns; put a number with a '
                    'comma in quotes'
                )
            by_name = dict(zip(names, map(_without_quote, cells), strict=False))
            rows.append(TableRow(place, reader.line_num, by_name))
    except csv.Error as error:
        raise error_type(f'{file}, line {reader.line_num}: {error}') from error
    return rows


def write_table(rows: Iterable[Iterable[object]], file: BinaryIO, encoding: str = 'utf-8') -> None:
    """Write rows to an open file, which stays open."""
    text = TextIOWrapper(file, encoding=encoding, errors='replace', newline='')
    csv.writer(text, lineterminator='\n').writerows(rows)
    text.flush()
    text.detach()


def harmless(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula: with a quote, if need be."""
    return f"'{cell}" if cell.startswith(_FORMULA_STARTS) else cell


def _column_name(cell: str, columns: Sequence[str]) -> str:
    """Return the name in a cell of the first line; a known one may be in capitals."""
    name = cell.strip()
    return name.casefold() if name.casefold() in columns else name


def _without_quote(cell: str) -> str:
    """Return a cell without the quote of `harmless`."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA_STARTS) else cell


def decoded_text(path: str, error_type: type[Exception], max_size: int) -> str:
    """Return the text of a table in an encoding of spreadsheets."""
    try:
        with open_regular(path) as file:
            data = file.read(max_size + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise error_type(f'{printable(path)} cannot be read: {printable(reason)}') from error
    if data.startswith(WORKBOOK):
        raise error_type(f'{printable(path)} is a workbook: save it as CSV')
    if len(data) > max_size:
        raise error_type(f'{printable(path)} is longer than {max_size} bytes')
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode('utf-16', errors='replace')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError:
        # A spreadsheet's own encoding in western Europe and Brazil; every byte is a letter.
        return data.decode('cp1252', errors='replace')
