"""A class: its assignment, its list, its answers in tables, long or wide, and its gradebook."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
import hmac
import json
from math import isnan
import os
from pathlib import Path
import re
from secrets import token_hex
from statistics import fmean, quantiles
from typing import BinaryIO, NamedTuple

from klann_ros.cli import harmless, OutputError, plain, read_table, Table, write_table
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import (
    counted,
    listed,
    MAX_LINE_LENGTH,
    parse_json,
    printable,
)

from .calculation import data
from .kinds import KINDS
from .marking import mark, Marks, read_answer, statistics
from .sheet import Assignment, class_texts, localised, unit_sign
from .variant import ExerciseError, LANGUAGES, look_up, Question, texts

# File of a folder that remembers its assignment.
ASSIGNMENT_FILE = 'exercise.json'
# Largest table [bytes], students of one, and points of a task; shortest secret [characters].
MAX_TABLE, MAX_STUDENTS, MAX_POINTS, MIN_SECRET = 20_000_000, 5000, 1000.0, 12
ANSWER_COLUMNS = ('student', 'kind', 'question', 'answer')
MARK_COLUMNS = (*ANSWER_COLUMNS, 'points', 'reason')
# A long student number as a spreadsheet writes it, and one with the decimals of a program.
SCIENTIFIC, DECIMALS = re.compile(r'\d(?:[.,]\d+)?[Ee]\+?\d+'), re.compile(r'(\d+)\.0')
# The unit of a heading; the word before the number of a task.
UNIT_OF_HEADING = re.compile(r'[\[(]([^\[\]()]*)[\])]$')
TASK_WORD = re.compile(r'^(?:questao|question|tarefa|task|exercicio|exercise)(?=\d)')


class Grade(NamedTuple):
    """The points of a student's task, to the hundredth, and a reason for each that is missing."""

    points: float
    reasons: list[str]


def fingerprint(secret: str) -> str:
    """Return what tells one secret from another."""
    digest = hmac.new(secret.encode(), ASSIGNMENT_FILE.encode(), 'sha256').hexdigest()
    return digest[:16] if secret else ''


def assignment_content(assignment: Assignment) -> bytes:
    """Return the file that remembers an assignment, without its secret."""
    content = asdict(replace(assignment, secret=fingerprint(assignment.secret)))
    return f'{json.dumps(content, indent=1)}\n'.encode()


def summary(assignment: Assignment) -> str:
    """Return the class, its tasks and its language in a few words."""
    tasks = ', '.join(f'{kind} {points:g}' for kind, points in assignment.points.items())
    secret = f', secret {printable(assignment.secret_file)}' if assignment.secret_file else ''
    students = counted(len(assignment.students), 'student')
    return f'{students}, points {tasks}, language {assignment.language}{secret}'


def load_assignment(folder: Path) -> Assignment | None:
    """
    Return the assignment that a folder remembers; the fingerprint stands for its secret.

    An ExerciseError means that the file is damaged.
    """
    path = folder / ASSIGNMENT_FILE
    if not path.exists():
        return None
    try:
        assignment = Assignment(**parse_json(read_regular(path, MAX_TABLE)))
        look_up(assignment.language, dict.fromkeys(LANGUAGES), 'language')
        points = read_tasks(f'{kind}:{number}' for kind, number in assignment.points.items())
        # A TypeError unless all of them are texts.
        ''.join([*assignment.students.values(), assignment.secret, assignment.secret_file])
    except (OSError, ValueError, TypeError, AttributeError) as error:
        reason = f'{printable(path)} is damaged: {printable(error)}; run exercise make again'
        raise ExerciseError(reason) from error
    return replace(assignment, points=points)


def check_same(assignment: Assignment, folder: Path) -> None:
    """Raise an OutputError if a folder remembers another assignment than one with its secret."""
    remembered = load_assignment(folder)
    if remembered is None:
        return
    is_same_secret = remembered.secret == fingerprint(assignment.secret)
    if {*remembered.points} != {*assignment.points} or not is_same_secret:
        raise OutputError(
            f'-o {printable(folder)} has answers to other sheets: {summary(remembered)}; choose a '
            'new folder'
        )


def with_secret(assignment: Assignment, folder: Path, path: str | None) -> Assignment:
    """Return a remembered assignment with its secret; an ExerciseError if it is another one."""
    if not assignment.secret and not path:
        return assignment
    secret = read_secret(path or str(folder / assignment.secret_file))
    if assignment.points and fingerprint(secret) != assignment.secret:
        raise ExerciseError('the secret is not that of the sheets')
    return replace(assignment, secret=secret)


def read_secret(path: str | None, *, is_made: bool = False) -> str:
    """
    Return the secret in a file, if any; a new file is made, which only its owner can read.

    An ExerciseError means that the file is none, or that the secret can be guessed.
    """
    if not path:
        return ''
    try:
        if is_made and not os.path.lexists(path):
            with os.fdopen(
                os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w'
            ) as file:
                file.write(f'{token_hex(16)}\n')
        secret = read_regular(path, MAX_LINE_LENGTH).strip()
    except (OSError, ValueError) as error:
        reason = printable(getattr(error, 'strerror', None) or error)
        raise ExerciseError(f'the secret {printable(path)} cannot be used: {reason}') from error
    if len(secret) < MIN_SECRET:
        reason = f'it must have {MIN_SECRET} characters; a new file gets a random one'
        raise ExerciseError(f'the secret {printable(path)} can be guessed: {reason}')
    return secret


def read_tasks(arguments: Iterable[str]) -> dict[str, float]:
    """Return the points by kind of texts KIND or KIND:POINTS; an ExerciseError for others."""
    points_of: dict[str, float] = {}
    for argument in arguments:
        kind, _, number = argument.partition(':')
        questions = look_up(kind, KINDS, 'kind').questions
        if kind in points_of:
            raise ExerciseError(f'kind {kind} is there twice: a sheet has one task of a kind')
        try:
            points = float(number.replace(',', '.') or len(questions))
        except ValueError:
            points = 0.0
        if not 0.0 < points <= MAX_POINTS:
            raise ExerciseError(
                f'{printable(argument)} is refused: its points must be a number > 0, such as '
                f'{kind}:1.5'
            )
        points_of[kind] = points
    return points_of


def read_students(path: str, headings: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """
    Return the names of a class by student number, and what was guessed; headings by column.

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
    """A column with answers to a question, and the unit in its heading."""

    heading: str
    kind: str
    question: Question
    unit: str = ''

    def answer(self, cells: Mapping[str, str]) -> str:
        """Return the answer in a row, with the heading's unit if that makes it another one."""
        text = cells.get(self.heading, '').strip()
        with_unit = f'{text} {self.unit}'
        amount = read_answer(with_unit, self.question) if self.unit else None
        is_number = isinstance(amount, float) and not isnan(amount)
        return with_unit if is_number and amount != read_answer(text, self.question) else text


class Answers:
    """
    The answers of a table as written, by student and kind, then by question.

    `refused` are the rows that cannot be used, `notes` what was guessed. A table without columns
    for question and answer has a row a student and a column a question. The last answer to a
    question counts. An ExerciseError means that the file is unreadable, or no table of answers.
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
                place = (student, column.kind, column.question.name)
                if place in lines:
                    places = f'lines {lines[place]} and {line} are both of {printable(student)}'
                    self.notes.append(f'{places}: the last counts')
                lines[place] = line
                answers = self.texts.setdefault((student, column.kind), {})
                answers[column.question.name] = column.answer(cells)
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
        return next((QuestionColumn(heading, *match, unit) for match in matches), None)

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
        names = {f'{kind} {question.name}' for kind, question in _questions(self._assignment)}
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
            words = texts()['questions'].get(question.name, {}).values()
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
    """Return whether a file is a table of students with an answer at least; else as `Answers`."""
    labels = {'student', 'name', 'surname', 'kind', 'question'}
    for row in _table(path, {}).rows if Path(path).is_file() else ():
        if any(cell.strip() for name, cell in row.cells.items() if name not in labels):
            return True
    return False


def save_template(assignment: Assignment, is_wide: bool, file: BinaryIO) -> None:
    """Write an empty table of answers, a row an answer or, if wide, a row a student."""
    language = assignment.language
    questions = _questions(assignment)
    if is_wide:
        heads = [assignment.word(name) for name in ('student', 'name')]
        for kind, question in questions:
            words = texts()['questions'].get(question.name, {}).get(language, '')
            has_words_alone = question.name in data()['notation']['words'].split()
            sign = unit_sign(question.unit)
            name = words if has_words_alone else question.name
            heads.append(f'{kind} {name}{sign and f" ({sign})"}')
        blanks = [''] * len(questions)
        rows = [[*student, *blanks] for student in assignment.students.items()]
    else:
        heads = [*ANSWER_COLUMNS]
        rows = []
        for student in assignment.students:
            rows += [[student, kind, question.name, ''] for kind, question in questions]
    _save(heads, rows, language, file)


def _questions(assignment: Assignment) -> list[tuple[str, Question]]:
    """Return the questions of all tasks, and their kinds."""
    return [(kind, question) for kind in assignment.points for question in KINDS[kind].questions]


def save_marks(class_marks: Marks, assignment: Assignment, file: BinaryIO) -> None:
    """Write the marks, a row an answer."""
    language = assignment.language
    lines = []
    for (student, kind), marks in class_marks.items():
        for answer_mark in marks:
            answer = (student, kind, answer_mark.question, answer_mark.given)
            points = _points_text(answer_mark.points, language)
            lines.append((*answer, points, answer_mark.reason(language)))
    _save(MARK_COLUMNS, lines, language, file)


def _kinds(class_marks: Marks, assignment: Assignment) -> Iterable[str]:
    return dict.fromkeys([*assignment.points, *(kind for _, kind in class_marks)])


def grades(class_marks: Marks, assignment: Assignment) -> dict[tuple[str, str], Grade]:
    """Return the grades by student and kind."""
    language = assignment.language
    grade_of = {}
    for (student, kind), marks in class_marks.items():
        share = fmean(answer_mark.points for answer_mark in marks)
        reasons = []
        for answer_mark in marks:
            if answer_mark.points < 1.0:
                answer = f'{answer_mark.question} = {printable(answer_mark.given, 40) or "-"}'
                points = _points_text(answer_mark.points, language)
                reasons.append(f'{answer}: {points}, {answer_mark.reason(language)}')
        grade_of[student, kind] = Grade(round(share * assignment.points_of(kind), 2), reasons)
    return grade_of


def save_gradebook(class_marks: Marks, assignment: Assignment, file: BinaryIO) -> None:
    """Write the gradebook, a row a student: the points of each task, the total, the reasons."""
    language = assignment.language
    kinds = _kinds(class_marks, assignment)
    grade_of = grades(class_marks, assignment)
    rows = []
    for student in dict.fromkeys([*assignment.students, *(student for student, _ in class_marks)]):
        cells = [student, assignment.students.get(student, '')]
        student_grades = {kind: grade_of.get((student, kind)) for kind in kinds}
        marked = {kind: grade for kind, grade in student_grades.items() if grade}
        for grade in student_grades.values():
            cells.append(_points_text(grade.points, language) if grade else '')
        total = sum(grade.points for grade in marked.values())
        cells.append(_points_text(total, language) if marked else '')
        reasons = [f'{kind} {reason}' for kind in marked for reason in marked[kind].reasons]
        cells.append('; '.join(reasons) if marked else assignment.word('absent'))
        rows.append(cells)
    maxima = {kind: assignment.points_of(kind) for kind in kinds}
    maxima[assignment.word('total')] = sum(maxima.values())
    points_heads = [
        f'{name} ({_points_text(points, language)})' for name, points in maxima.items()
    ]
    student_head, name_head, reasons_head = map(assignment.word, ('student', 'name', 'reasons'))
    _save((student_head, name_head, *points_heads, reasons_head), rows, language, file)


def _points_text(points: float, language: str) -> str:
    return localised(f'{points:.6g}', language)


def class_summary(class_marks: Marks, assignment: Assignment) -> list[str]:
    """Return lines with the slips of each task, the points of the class, and its extremes."""
    lines = []
    for kind, counts in statistics(class_marks).items():
        students = counted(int(counts.pop('students')), 'student')
        share = 100.0 * counts.pop('part')
        slips = ', '.join(f'{slip} {count:g}' for slip, count in counts.items())
        lines.append(f'{kind}: {students}, {share:.0f} %; {slips}')
    totals: dict[str, float] = {}
    for (student, _), grade in grades(class_marks, assignment).items():
        totals[student] = totals.get(student, 0.0) + grade.points
    if len(totals) > 1:
        total = sum(map(assignment.points_of, _kinds(class_marks, assignment)))
        quartiles = quantiles(totals.values(), method='inclusive')
        lines.append(assignment.word('spread', total, fmean(totals.values()), *quartiles))
    shares: dict[str, list[float]] = {}
    for (_, kind), marks in class_marks.items():
        for answer_mark in marks:
            shares.setdefault(f'{kind} {answer_mark.question}', []).append(answer_mark.points)
    question = min(shares, key=lambda name: fmean(shares[name]), default='')
    if question and fmean(shares[question]) < 1.0:
        share = round(100.0 * fmean(shares[question]))
        lines.append(f'{assignment.word("hardest", share)}: {question}')
    if absent := [student for student in assignment.students if student not in totals]:
        lines.append(f'{assignment.word("absent")}: {listed(absent)}')
    return lines


def _save(
    heads: Sequence[str], lines: Iterable[Sequence[str]], language: str, file: BinaryIO
) -> None:
    cells = [[harmless(printable(cell, MAX_LINE_LENGTH)) for cell in line] for line in lines]
    # With the mark by which spreadsheets know UTF-8; where the comma is decimal, ; separates.
    delimiter = ';' if language == 'pt' else ','
    write_table((heads, *cells), file, encoding='utf-8-sig', delimiter=delimiter)
