"""Tables as text (CSV), as spreadsheets of any locale write them."""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Mapping, Sequence
import csv
from io import StringIO, TextIOWrapper
import re
from typing import BinaryIO, NamedTuple
import unicodedata

from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import listed, printable

DELIMITERS = ',;\t'
# Names of columns, and how their headings are spelt.
Spellings = Mapping[str, Sequence[str]]
# Lines that may stand above the headings, and the length of these [characters]; columns at most.
MAX_TITLE_LINES, MAX_HEADING_LINE, MAX_COLUMNS = 20, 100_000, 2000
# First bytes of .xlsx and .ods, of .xls, and of pages that are called .xls.
WORKBOOKS = (b'PK\x03\x04', b'\xd0\xcf\x11\xe0', b'<')
_SIGNED_NUMBER = re.compile(r'[+-][0-9]+(?:[.,][0-9]+)?')
# The last four are the first in the full width of Chinese and Japanese.
_FORMULA_STARTS = ('=', '+', '-', '@', '\t', '\r', '\n', '\uff1d', '\uff0b', '\uff0d', '\uff20')


class TableRow(NamedTuple):
    """A row of a table: the number of its last line, and its cells by column."""

    line: int
    cells: dict[str, str]


class Table(NamedTuple):
    """
    The rows of a table, without empty ones, and the names of its columns.

    `headings` are the headings in the file of those columns that have spellings.
    """

    rows: list[TableRow]
    names: list[str]
    headings: dict[str, str]


def read_table(
    path: str, spellings: Spellings, error_type: type[Exception], max_size: int
) -> Table:
    """
    Return a table with the first column of the spellings and any others.

    The heading of a column is the first of its spellings that the table has, in capitals or not,
    with or without accents and signs; one with a leading ~ may be a part of a longer heading.
    Lines above the headings are left out. The encoding, the delimiter and quotes are those of any
    spreadsheet. A short row lacks its last columns. An error of `error_type` in one line means
    that the file cannot be read, is longer than `max_size` bytes, is no table, or has not that
    column once.
    """
    file = printable(path)
    text = decoded_text(path, error_type, max_size)
    lines = StringIO(text, newline='').readlines()
    start, delimiter = _heading_line(lines, spellings)
    reader = csv.reader(lines[slice(start, None)], delimiter=delimiter, strict=True)
    try:
        heads = [cell.strip() for cell in next(reader, ())]
        if len(heads) > MAX_COLUMNS:
            raise error_type(f'{file} has {len(heads)} columns: at most {MAX_COLUMNS} are read')
        columns = _columns(heads, spellings)
        required = next(iter(spellings))
        if required not in columns:
            usual = [text for text in spellings[required] if not text.startswith('~')]
            raise error_type(
                f'{file} has no column {required}, such as {", ".join(usual[:3])}; its columns '
                f'are {listed(heads, 8)}; name it by --column {required}=HEADING'
            )
        for column in columns.values():
            if [*map(plain, heads)].count(plain(heads[column])) > 1:
                raise error_type(f'{file} has the column {printable(heads[column])} twice')
        names = heads.copy()
        for name, column in columns.items():
            names[column] = name
        rows = []
        for cells in reader:
            if not any(map(str.strip, cells)):
                continue
            line = start + reader.line_num
            if any(map(str.strip, cells[slice(len(names), None)])):
                raise error_type(
                    f'{file}, line {line}: {len(cells)} cells for {len(names)} columns; put a '
                    'number with a comma in quotes'
                )
            by_name = dict(zip(names, map(_without_quote, cells), strict=False))
            rows.append(TableRow(line, by_name))
    except csv.Error as error:
        raise error_type(f'{file}, line {start + reader.line_num}: {error}') from error
    return Table(rows, names, {name: heads[column] for name, column in columns.items()})


def plain(text: str) -> str:
    """Return a text in small letters and digits, without accents, signs and repeated blanks."""
    decomposed = unicodedata.normalize('NFKD', text)
    letters = ''.join(c for c in decomposed if not unicodedata.combining(c)).casefold()
    return ' '.join(re.findall(r'[^\W_]+', letters))


def _heading_line(lines: Sequence[str], spellings: Spellings) -> tuple[int, str]:
    """Return the line and the delimiter with which most columns are recognised."""
    ranks = {}
    for start, line in enumerate(lines[:MAX_TITLE_LINES]):
        for delimiter in DELIMITERS:
            heads = next(csv.reader([line[:MAX_HEADING_LINE]], delimiter=delimiter), [])
            columns = _columns(heads, spellings)
            ranks[start, delimiter] = (next(iter(spellings)) in columns, len(columns), len(heads))
    return max(ranks, key=lambda place: ranks[place], default=(0, DELIMITERS[0]))


def _columns(heads: Sequence[str], spellings: Spellings) -> dict[str, int]:
    """Return the column of each name; a heading stands for one name."""
    plain_heads = [f' {plain(head)} ' for head in heads]
    columns: dict[str, int] = {}
    for name, spelt_headings in spellings.items():
        for spelling in spelt_headings:
            text = f' {plain(spelling)} '
            for column, head in enumerate(plain_heads):
                is_match = text in head if spelling.startswith('~') else text == head
                if is_match and name not in columns and column not in columns.values():
                    columns[name] = column
    return columns


def write_table(
    rows: Iterable[Iterable[object]], file: BinaryIO, encoding: str = 'utf-8', delimiter: str = ','
) -> None:
    """Write rows to an open file, which stays open."""
    text = TextIOWrapper(file, encoding=encoding, errors='replace', newline='')
    csv.writer(text, delimiter=delimiter, lineterminator='\n').writerows(rows)
    text.flush()
    text.detach()


def harmless(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula: with a quote, if need be."""
    is_formula = cell.startswith(_FORMULA_STARTS) and not _SIGNED_NUMBER.fullmatch(cell)
    return f"'{cell}" if is_formula else cell


def _without_quote(cell: str) -> str:
    """Return a cell without the quote of `harmless`, or the ="..." that keeps leading zeros."""
    if cell.startswith('="') and cell.endswith('"'):
        return cell[2:-1]
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA_STARTS) else cell


def decoded_text(
    path: str, error_type: type[Exception], max_size: int, *, may_be_xml: bool = False
) -> str:
    """Return the text of a table, or XML, in an encoding of spreadsheets; - is standard input."""
    try:
        with open(0, 'rb', closefd=False) if path == '-' else open_regular(path) as file:
            data = file.read(max_size + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise error_type(f'{printable(path)} cannot be read: {printable(reason)}') from error
    start = data[:99].lstrip(b'\xef\xbb\xbf\r\n\t ')
    if start.startswith(WORKBOOKS) and not (may_be_xml and start.startswith(b'<')):
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
