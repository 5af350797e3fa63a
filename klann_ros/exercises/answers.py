"""The tables that a class hands in: its list, and its answers, a row an answer or a student."""

from collections.abc import Mapping
from math import isnan
from pathlib import Path
import re
from typing import NamedTuple

from klann_ros.cli import plain, read_table, Table
from klann_ros.sanitize.text import listed, printable

from .assignment import Assignment, class_texts
from .calculation import data
from .kinds import KINDS
from .marking import mark, Marks, read_answer
from .variant import ExerciseError, LANGUAGES, look_up, Question

# Largest table [bytes], and students of one.
MAX_TABLE, MAX_STUDENTS = 20_000_000, 5000
# A long student number as a spreadsheet writes it, and one with the decimals of a program.
SCIENTIFIC, DECIMALS = re.compile(r'\d(?:[.,]\d+)?[Ee]\+?\d+'), re.compile(r'(\d+)\.0')
# The unit of a heading; the word before the number of a task.
UNIT_OF_HEADING = re.compile(r'[\[(]([^\[\]()]*)[\])]$')
TASK_WORD = re.compile(r'^(?:questao|question|tarefa|task|exercicio|exercise)(?=\d)')


def read_students(path: str, headings: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """
    Return the names of a class by student number, and the guesses; headings by column.

    An ExerciseError means that the file is no such table, has a student twice, or a row without.
    """
    table = _table(path, headings)
    names: dict[str, str] = {}
    repeated = []
    notes = _guesses(table)
    for line, cells in table.rows:
        place = f'{printable(path)}, line {line}'
        columns = (cells.get(column, '').strip() for column in ('student', 'name', 'surname'))
        student, name, surname = map(printable, columns)
        if not name.endswith(surname):
            name = f'{name} {surname}'.strip()
        if 'name' in table.headings and not name and (' ' in student or not student):
            # A line below the class, such as 'Total: 40'.
            notes.append(f'left out: {place}')
            continue
        try:
            number = _number(cells)
        except ExerciseError as error:
            raise ExerciseError(f'{place}: {error}') from error
        if number in names:
            repeated.append(number)
        names[number] = name
    if not 0 < len(names) <= MAX_STUDENTS:
        raise ExerciseError(
            f'{printable(path)} has {len(names)} students: 1 to {MAX_STUDENTS} are possible'
        )
    if repeated:
        raise ExerciseError(f'{printable(path)} has students twice: {listed(repeated, 5)}')
    return names, notes


def _table(path: str, headings: Mapping[str, str]) -> Table:
    spellings = dict(class_texts()['columns'])
    for column, heading in headings.items():
        look_up(column, spellings, 'column')
        spellings[column] = [heading]
    return read_table(path, spellings, ExerciseError, MAX_TABLE)


def _guesses(table: Table) -> list[str]:
    """Return a line with the columns whose headings are other words."""
    guesses = []
    for name, heading in table.headings.items():
        if plain(heading) != name:
            guesses.append(f'{name} = {printable(heading, 60)}')
    return [f'columns: {", ".join(guesses)}'] if guesses else []


def _number(cells: Mapping[str, str]) -> str:
    """Return the student number of a row."""
    number = DECIMALS.sub(r'\1', cells.get('student', '').strip())
    if not number:
        raise ExerciseError('no student number')
    if SCIENTIFIC.fullmatch(number):
        raise ExerciseError(
            f'student {number} is a number that a spreadsheet has rounded; give the column the '
            'format text'
        )
    return number


class QuestionColumn(NamedTuple):
    """A column with answers to a question, and its heading's unit if that is another one."""

    heading: str
    kind: str
    question: Question
    unit: str = ''

    def answer(self, cells: Mapping[str, str]) -> str:
        """Return the answer in a row, with the heading's unit unless it has one of its own."""
        text = cells.get(self.heading, '').strip()
        with_unit = f'{text} {self.unit}'
        amount = read_answer(with_unit, self.question) if self.unit else None
        return with_unit if isinstance(amount, float) and not isnan(amount) else text


class AnswerTable:
    """
    The answers of a table as written, by student and kind, then by question.

    `refused` are the rows that cannot be used, `notes` the guesses. A table without columns
    for question and answer has a row a student and a column a question. The last answer to a
    question counts; a blank is none. An ExerciseError means that the file is unreadable, or no
    table of answers.
    """

    def __init__(self, path: str, assignment: Assignment, headings: Mapping[str, str]) -> None:
        self._assignment = assignment
        self._kinds = listed(assignment.points or KINDS, 3)
        self._spellings = _question_spellings(assignment)
        self._numbers: dict[str, list[str]] = {}
        for student in assignment.students:
            self._numbers.setdefault(_bare(student), []).append(student)
        self.texts: dict[tuple[str, str], dict[str, str]] = {}
        self.refused: list[str] = []
        table = _table(path, headings)
        self.notes = _guesses(table)
        is_long = {'question', 'answer'} <= {*table.names}
        columns = [] if is_long else self._columns(table, printable(path))
        lines: dict[tuple[str, str, str], int] = {}
        for line, cells in table.rows:
            try:
                student = self._student(cells)
                row_columns = columns or [self._column_of_row(cells)]
            except ExerciseError as error:
                self.refused.append(f'line {line}: {error}')
                continue
            for column in row_columns:
                text = column.answer(cells)
                name = column.question.name
                answers = self.texts.setdefault((student, column.kind), {})
                place = (student, column.kind, name)
                if text and answers.get(name):
                    places = f'lines {lines[place]} and {line} are both of {printable(student)}'
                    self.notes.append(f'{places}: the last counts')
                if text:
                    lines[place] = line
                answers[name] = text or answers.get(name, '')
        self.notes = [*dict.fromkeys(self.notes)]
        if not self.texts and not self.refused:
            raise ExerciseError(f'{printable(path)} has no answers')

    def _student(self, cells: Mapping[str, str]) -> str:
        """Return the student of a row, with the number as in the class list."""
        number = _number(cells)
        students = self._assignment.students
        if not students or number in students:
            return number
        similar = self._numbers.get(_bare(number), ())
        if len(similar) != 1:
            raise ExerciseError(f'student {printable(number)} is not in the class')
        self.notes.append(f'student {printable(number)} is taken for {similar[0]}')
        return similar[0]

    def _column(self, heading: str) -> QuestionColumn | None:
        """Return a heading's question, if it is of one; an ExerciseError if it is of several."""
        unit = ''.join(UNIT_OF_HEADING.findall(heading))
        name = UNIT_OF_HEADING.sub('', heading)
        spellings = self._spellings
        matches = spellings.get(_compact(heading)) or spellings.get(_compact(name)) or set()
        if len(matches) > 1:
            kinds = listed(sorted(kind for kind, _ in matches), 3)
            raise ExerciseError(f'put the kind before {printable(heading, 60)}: {kinds}')
        if not matches:
            return None
        ((kind, question),) = matches
        if unit and read_answer(f'1 {unit}', question) in (1.0, None):
            unit = ''
        return QuestionColumn(heading, kind, question, unit)

    def _column_of_row(self, cells: Mapping[str, str]) -> QuestionColumn:
        """Return the question of a row of one answer."""
        heading = f'{cells.get("kind", "")} {cells.get("question", "")}'.strip()
        column = self._column(heading)
        if column is None:
            raise ExerciseError(f'{printable(heading)!r} is no question of {self._kinds}')
        return column._replace(heading='answer')

    def _columns(self, table: Table, file: str) -> list[QuestionColumn]:
        """Return the columns of questions of a table with a row a student."""
        columns: dict[str, QuestionColumn] = {}
        left_out = []
        for heading in table.names:
            if heading in table.headings:
                continue
            column = self._column(heading)
            if column is None:
                left_out.append(heading)
                continue
            name = f'{column.kind} {column.question.name}'
            if name in columns:
                raise ExerciseError(f'{file} has two columns of {name}')
            columns[name] = column
        if not columns:
            raise ExerciseError(
                f'{file} has no columns question and answer, nor one of a question of '
                f'{self._kinds}; its columns are {listed(table.names, 8)}'
            )
        if left_out:
            self.notes.append(f'columns that are no questions: {listed(left_out, 8)}')
        names = {f'{kind} {question.name}' for kind, question in self._assignment.questions()}
        if missing := sorted(names - {*columns}):
            self.notes.append(f'questions without a column: {listed(missing)}')
        return [*columns.values()]

    def marks(self) -> Marks:
        """Return the marks of who answered; a number that gives no variant is refused."""
        class_marks = {}
        present = {student for (student, _), texts in self.texts.items() if any(texts.values())}
        for (student, kind), student_answers in self.texts.items():
            if student in self._assignment.students and student not in present:
                continue
            try:
                variant = self._assignment.variant(kind, student)
                class_marks[student, kind] = mark(variant, student_answers)
            except ExerciseError as error:  # noqa: PERF203, RUF100 - of each student
                self.refused.append(str(error))
        return class_marks


def _bare(number: str) -> str:
    """Return the digits of a student number without leading zeros, or the letters of one."""
    return re.sub(r'\D', '', number).lstrip('0') or plain(number)


def _question_spellings(assignment: Assignment) -> dict[str, set[tuple[str, Question]]]:
    """Return the questions by the headings that stand for them: alone, or after kind or number."""
    spellings: dict[str, set[tuple[str, Question]]] = {}
    for number, kind in enumerate(assignment.points or KINDS, 1):
        # Tasks have numbers on a sheet alone.
        prefixes = ('', kind, str(number)) if assignment.points else ('', kind)
        for question in KINDS[kind].questions:
            words = [*filter(None, map(question.words, LANGUAGES))]
            symbol = data()['notation']['symbols'].get(question.name, question.name)
            # The sheet prints both, such as 'Z, diagonal from A to O4'.
            labels = [f'{symbol}, {phrase}' for phrase in words]
            for name in (question.name, symbol, *words, *labels):
                for prefix in prefixes:
                    heading = _compact(f'{prefix} {name}')
                    spellings.setdefault(heading, set()).add((kind, question))
    return spellings


def _compact(heading: str) -> str:
    """Return the letters and digits of a heading, Greek letters by their names."""
    for name, letter in data()['notation']['greek'].items():
        heading = heading.replace(letter, f' {name} ')
    return TASK_WORD.sub('', plain(heading).replace(' ', ''))


def has_answers(path: str) -> bool:
    """Return whether a file is a table of students with an answer; errors as `AnswerTable`."""
    labels = {'student', 'name', 'surname', 'kind', 'question'}
    for row in _table(path, {}).rows if Path(path).is_file() else ():
        if any(cell.strip() for name, cell in row.cells.items() if name not in labels):
            return True
    return False
