"""The tables that a class gets: empty ones for its answers, its marks, and its gradebook."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean, quantiles
from typing import BinaryIO, NamedTuple

from klann_ros.cli import harmless, write_table
from klann_ros.sanitize.text import counted, listed, MAX_LINE_LENGTH, printable

from .assignment import Assignment, localised
from .marking import Marks, statistics
from .sheet import unit_sign

ANSWER_COLUMNS = ('student', 'kind', 'question', 'answer')
MARK_COLUMNS = (*ANSWER_COLUMNS, 'points', 'reason')


class Grade(NamedTuple):
    """The points of a student's task, to the hundredth, and a reason for each that is missing."""

    points: float
    reasons: list[str]


Grades = Mapping[tuple[str, str], Grade]
"""The grades of a class by student and kind."""


def save_template(assignment: Assignment, is_wide: bool, file: BinaryIO) -> None:
    """Write an empty table of answers, a row an answer or, if wide, a row a student."""
    language = assignment.language
    questions = assignment.questions()
    if is_wide:
        heads = [assignment.word(name) for name in ('student', 'name')]
        for kind, question in questions:
            sign = unit_sign(question.unit)
            name = question.words(language) if question.is_word else question.name
            heads.append(f'{kind} {name}{sign and f" ({sign})"}')
        blanks = [''] * len(questions)
        rows = [[*student, *blanks] for student in assignment.students.items()]
    else:
        heads = [*ANSWER_COLUMNS]
        rows = []
        for student in assignment.students:
            rows += [[student, kind, question.name, ''] for kind, question in questions]
    _save(heads, rows, language, file)


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


def grades(class_marks: Marks, assignment: Assignment) -> Grades:
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


def _kinds(class_grades: Grades, assignment: Assignment) -> Iterable[str]:
    return dict.fromkeys([*assignment.points, *(kind for _, kind in class_grades)])


def save_gradebook(class_grades: Grades, assignment: Assignment, file: BinaryIO) -> None:
    """Write the gradebook, a row a student: the points of each task, the total, the reasons."""
    language = assignment.language
    kinds = _kinds(class_grades, assignment)
    rows = []
    students = [*assignment.students, *(student for student, _ in class_grades)]
    for student in dict.fromkeys(students):
        cells = [student, assignment.students.get(student, '')]
        student_grades = {kind: class_grades.get((student, kind)) for kind in kinds}
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


def class_summary(class_marks: Marks, class_grades: Grades, assignment: Assignment) -> list[str]:
    """Return lines with the slips of each task, the points of the class, and its extremes."""
    lines = []
    for kind, counts in statistics(class_marks).items():
        students = counted(int(counts.pop('students')), 'student')
        share = 100.0 * counts.pop('part')
        slips = ', '.join(f'{slip} {count:g}' for slip, count in counts.items())
        lines.append(f'{kind}: {students}, {share:.0f} %; {slips}')
    totals: dict[str, float] = {}
    for (student, _), grade in class_grades.items():
        totals[student] = totals.get(student, 0.0) + grade.points
    if len(totals) > 1:
        total = sum(map(assignment.points_of, _kinds(class_grades, assignment)))
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
