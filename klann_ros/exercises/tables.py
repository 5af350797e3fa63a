"""Tables of a class: students, answers and marks, as spreadsheets of any locale write them."""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Mapping, Sequence
import csv
from io import StringIO, TextIOWrapper
from pathlib import Path
import re
from typing import BinaryIO

from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import FORMULA_STARTS, listed, printable

from .marking import mark, Marks
from .variant import ExerciseError, Kind, known, make_variant

# Largest table [bytes], and students of one.
MAX_TABLE, MAX_STUDENTS = 20_000_000, 5000
DELIMITERS = ',;\t'
# First bytes of .xlsx and .ods.
WORKBOOK = b'PK\x03\x04'
ANSWER_COLUMNS = ('student', 'kind', 'question', 'answer')
MARK_COLUMNS = (*ANSWER_COLUMNS, 'points', 'reason')
# A long student number as a spreadsheet writes it.
SCIENTIFIC = re.compile(r'\d(?:[.,]\d+)?[Ee]\+?\d+')


def read_students(path: str) -> dict[str, str]:
    """
    Return the names of a class by student number: the columns name, if any, and student.

    Raises
    ------
    ExerciseError
        The file cannot be read, is no such table, has a student twice, or a row without one.

    """
    found: dict[str, str] = {}
    twice = []
    for line, row in _rows(path, ('student',)):
        number = _number(row, f'{printable(path)}, line {line}')
        if number in found:
            twice.append(number)
        found[number] = row.get('name', '').strip()
    if not 0 < len(found) <= MAX_STUDENTS:
        raise ExerciseError(
            f'{printable(path)} has {len(found)} students: 1 to {MAX_STUDENTS} are possible'
        )
    if twice:
        raise ExerciseError(f'{printable(path)} has students twice: {listed(twice, 5)}')
    return found


def _number(row: Mapping[str, str], place: str) -> str:
    """Return the student number of a row."""
    number = row['student'].strip()
    if not number:
        raise ExerciseError(f'{place}: no student number')
    if SCIENTIFIC.fullmatch(number):
        raise ExerciseError(
            f'{place}: student {number} is a number that a spreadsheet has rounded; give the '
            'column the format text'
        )
    return number


def has_answers(path: str) -> bool:
    """Return whether a file is a table of answers with one at least; errors as `mark_answers`."""
    rows = _rows(path, ANSWER_COLUMNS) if Path(path).is_file() else ()
    return any(row['answer'].strip() for _, row in rows)


def mark_answers(path: str, kinds: Mapping[str, Kind]) -> tuple[Marks, list[str]]:
    """
    Return the marks of a table of answers, and the rows that are refused, with their reasons.

    Raises
    ------
    ExerciseError
        The file cannot be read, or is no table of answers.

    """
    answers: dict[tuple[str, str], dict[str, str]] = {}
    refused = []
    for line, row in _rows(path, ANSWER_COLUMNS):
        kind, question = row['kind'].strip(), row['question'].strip()
        try:
            student = _number(row, f'line {line}')
            names = {each.name for each in known(kind, kinds, f'line {line}: kind').questions}
            known(question, dict.fromkeys(names), f'line {line}: question of {kind}')
        except ExerciseError as error:
            refused.append(str(error))
            continue
        if question in answers.setdefault((student, kind), {}):
            refused.append(f'line {line}: {printable(student)} answers {question} twice')
        else:
            answers[student, kind][question] = row['answer']
    if not answers and not refused:
        raise ExerciseError(f'{printable(path)} has no answers')
    marked = {}
    for (student, kind), given in answers.items():
        try:
            marked[student, kind] = mark(make_variant(kinds[kind], student), given)
        except ExerciseError as error:  # noqa: PERF203, RUF100 - of each student
            refused.append(str(error))
    return marked, refused


def _rows(path: str, columns: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a table with these columns, each with its line number."""
    text = _text(path)
    head, _, rest = text.partition('\n')
    if head.startswith('sep='):
        # The line by which spreadsheets give the separator.
        text, head = rest, rest.partition('\n')[0]
    delimiter = max(DELIMITERS, key=head.count)
    reader = csv.DictReader(
        StringIO(text, newline=''), delimiter=delimiter, strict=True, restval=''
    )
    try:
        heads = [cell.strip().casefold() for cell in reader.fieldnames or ()]
        missing = [name for name in columns if name not in heads]
        if missing:
            raise ExerciseError(
                f'{printable(path)} has no column {listed(missing)}: its first line must have '
                f'{", ".join(columns)}'
            )
        twice = [name for name in columns if heads.count(name) > 1]
        if twice:
            raise ExerciseError(f'{printable(path)} has the column {listed(twice)} twice')
        reader.fieldnames = heads
        found = []
        for row in reader:
            more = row.pop(None, ())
            if any(map(str.strip, more)):
                raise ExerciseError(
                    f'{printable(path)}, line {reader.line_num}: {len(heads) + len(more)} cells '
                    f'for {len(heads)} columns; put a number with a comma in quotes'
                )
            if any(map(str.strip, row.values())):
                cells = {name: _plain(cell) for name, cell in row.items()}
                found.append((reader.line_num, cells))
    except csv.Error as error:
        raise ExerciseError(
            f'{printable(path)}, line {reader.reader.line_num}: {error}'
        ) from error
    return found


def _text(path: str) -> str:
    """Return the text of a table in an encoding of spreadsheets."""
    try:
        with open_regular(path) as file:
            data = file.read(MAX_TABLE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise ExerciseError(f'{printable(path)} cannot be read: {printable(reason)}') from error
    if data.startswith(WORKBOOK):
        raise ExerciseError(f'{printable(path)} is a workbook: save it as CSV')
    if len(data) > MAX_TABLE:
        raise ExerciseError(f'{printable(path)} is longer than {MAX_TABLE} bytes')
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode('utf-16', errors='replace')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError:
        # A spreadsheet's own encoding in western Europe and Brazil; every byte is a letter.
        return data.decode('cp1252', errors='replace')


def save_template(kind: Kind, students: Iterable[str], file: BinaryIO) -> None:
    """Write an empty table of answers."""
    rows = ((each, kind.name, question.name, '') for each in students
            for question in kind.questions)  # fmt: skip
    _save(ANSWER_COLUMNS, rows, file)


def save_marks(marked: Marks, language: str, file: BinaryIO) -> None:
    """Write the marks, a row an answer."""
    rows = (
        (*exercise, mark.question, mark.given, f'{mark.points:g}', mark.reason(language))
        for exercise, marks in marked.items()
        for mark in marks
    )
    _save(MARK_COLUMNS, rows, file)


def _save(heads: Sequence[str], rows: Iterable[Sequence[str]], file: BinaryIO) -> None:
    text = TextIOWrapper(file, encoding='utf-8-sig', newline='')
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(heads)
    writer.writerows([_harmless(cell) for cell in row] for row in rows)
    text.flush()
    text.detach()


def _plain(cell: str) -> str:
    """Return a cell without the mark of `_harmless`, as a template has it."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(FORMULA_STARTS) else cell


def _harmless(cell: str) -> str:
    """Return a cell that no spreadsheet takes for a formula; a number is none."""
    number = cell.lstrip('+-').replace(',', '.', 1)
    if cell.startswith(FORMULA_STARTS) and not number.replace('.', '', 1).isdigit():
        return f"'{cell}"
    return cell
