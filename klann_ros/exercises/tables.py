"""Tables of a class: students, answers and marks, as spreadsheets of any locale write them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
import re
from typing import BinaryIO

from klann_ros.cli import harmless, read_table, TableRow, write_table
from klann_ros.sanitize.text import listed, MAX_LINE_LENGTH, printable

from .marking import mark, Marks
from .variant import ExerciseError, Kind, look_up, make_variant

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
    names: dict[str, str] = {}
    repeated = []
    for place, _, cells in _rows(path, 'student'):
        number = _number(cells, place)
        if number in names:
            repeated.append(number)
        columns = [column for column in cells if column.casefold() == 'name']
        names[number] = printable(cells[columns[0]].strip()) if columns else ''
    if not 0 < len(names) <= MAX_STUDENTS:
        raise ExerciseError(
            f'{printable(path)} has {len(names)} students: 1 to {MAX_STUDENTS} are possible'
        )
    if repeated:
        raise ExerciseError(f'{printable(path)} has students twice: {listed(repeated, 5)}')
    return names


def _rows(path: str, *columns: str) -> list[TableRow]:
    """Return the rows of a table; a short one ends with empty cells."""
    rows = read_table(path, columns, ExerciseError, MAX_TABLE).rows
    return [row._replace(cells=dict.fromkeys(columns, '') | row.cells) for row in rows]


def _number(cells: Mapping[str, str], place: str) -> str:
    """Return the student number of a row."""
    number = cells['student'].strip()
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
    table = _rows(path, *ANSWER_COLUMNS) if Path(path).is_file() else ()
    return any(row.cells['answer'].strip() for row in table)


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
    for _, line, cells in _rows(path, *ANSWER_COLUMNS):
        kind = cells['kind'].strip()
        question = cells['question'].strip()
        try:
            student = _number(cells, f'line {line}')
            questions = look_up(kind, kinds, f'line {line}: kind').questions
            names = {question.name for question in questions}
            look_up(question, dict.fromkeys(names), f'line {line}: question of {kind}')
        except ExerciseError as error:
            refused.append(str(error))
            continue
        if question in answers.setdefault((student, kind), {}):
            refused.append(f'line {line}: {printable(student)} answers {question} twice')
        else:
            answers[student, kind][question] = cells['answer']
    if not answers and not refused:
        raise ExerciseError(f'{printable(path)} has no answers')
    class_marks = {}
    for (student, kind), student_answers in answers.items():
        try:
            variant = make_variant(kinds[kind], student)
            class_marks[student, kind] = mark(variant, student_answers)
        except ExerciseError as error:  # noqa: PERF203, RUF100 - of each student
            refused.append(str(error))
    return class_marks, refused


def save_template(kind: Kind, students: Iterable[str], file: BinaryIO) -> None:
    """Write an empty table of answers."""
    lines = []
    for student in students:
        lines += [(student, kind.name, question.name, '') for question in kind.questions]
    _save(ANSWER_COLUMNS, lines, file)


def save_marks(class_marks: Marks, language: str, file: BinaryIO) -> None:
    """Write the marks, a row an answer."""
    lines = []
    for (student, kind), marks in class_marks.items():
        for answer_mark in marks:
            answer = (student, kind, answer_mark.question, answer_mark.given)
            points = f'{answer_mark.points:g}'
            lines.append((*answer, points, answer_mark.reason(language)))
    _save(MARK_COLUMNS, lines, file)


def _save(heads: Sequence[str], lines: Iterable[Sequence[str]], file: BinaryIO) -> None:
    cells = [list(map(_cell, line)) for line in lines]
    # With the mark by which spreadsheets know UTF-8.
    write_table((heads, *cells), file, encoding='utf-8-sig')


def _cell(text: str) -> str:
    """Return a cell without control characters; a number with a sign is no formula."""
    if re.fullmatch(r'[+-]?\d+(?:[.,]\d+)?', text, re.ASCII):
        return text
    return harmless(printable(text, MAX_LINE_LENGTH))
