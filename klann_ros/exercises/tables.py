"""Tables of a class: students, answers and marks, as spreadsheets of any locale write them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
import re
from typing import BinaryIO

from klann_ros.cli import harmless, read_table, TableRow, write_table
from klann_ros.sanitize.text import listed, printable

from .marking import mark, Marks
from .variant import ExerciseError, Kind, known, make_variant

# Largest table [bytes], and students of one.
MAX_TABLE, MAX_STUDENTS = 20_000_000, 5000
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
    for place, _, row in _rows(path, 'student'):
        number = _number(row, place)
        if number in found:
            twice.append(number)
        found[number] = next((row[key] for key in row if key.casefold() == 'name'), '').strip()
    if not 0 < len(found) <= MAX_STUDENTS:
        raise ExerciseError(
            f'{printable(path)} has {len(found)} students: 1 to {MAX_STUDENTS} are possible'
        )
    if twice:
        raise ExerciseError(f'{printable(path)} has students twice: {listed(twice, 5)}')
    return found


def _rows(path: str, *columns: str) -> list[TableRow]:
    """Return the rows of a table; a short one ends with empty cells."""
    rows = read_table(path, columns, ExerciseError, MAX_TABLE).rows
    return [row._replace(cells=dict.fromkeys(columns, '') | row.cells) for row in rows]


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
    rows = _rows(path, *ANSWER_COLUMNS) if Path(path).is_file() else ()
    return any(row['answer'].strip() for _, _, row in rows)


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
    for _, line, row in _rows(path, *ANSWER_COLUMNS):
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
    cells = ([_cell(each) for each in row] for row in rows)
    # With the mark by which spreadsheets know UTF-8.
    write_table((heads, *cells), file, encoding='utf-8-sig')


def _cell(text: str) -> str:
    """Return a cell; a number with a sign is no formula."""
    number = text.lstrip('+-').replace(',', '.', 1)
    return text if number.replace('.', '', 1).isdigit() else harmless(text)
