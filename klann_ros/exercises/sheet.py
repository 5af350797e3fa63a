"""Exercises as printable pages: sheets of a class, their key, and the parts of every format."""

from collections.abc import Iterable, Sequence
from math import floor, log10
from pathlib import Path
import re

from klann_ros.kinematics import pose_svg
from klann_ros.web import element, joined, Markup, Parts, scrolling_table, table_row
import numpy as np

from .assignment import Assignment, localised
from .calculation import data, figure_of
from .variant import Question, texts, unit_of, Variant

SHEET_PARTS = Parts(styles=(Path(__file__).parent / 'static' / 'sheet.css',), scripts=())
# Columns of a table of the key, on paper across.
MAX_KEY_COLUMNS = 18
SUBSCRIPT = re.compile(r'_(\([^)]*\)|[A-Za-z0-9α-ω]+(?:,[A-Za-z0-9]+)*)')
MINUS = re.compile(r'(?<!\w)-')
SINE = re.compile(r'\b(a?)sin\b')
SUBSCRIPTS = str.maketrans('1234', '₁₂₃₄')
# Rows of a column of givens; rounding errors, in any unit that is printed.
GIVEN_ROWS, ROUNDING = 9, 1e-9


def sheets(assignment: Assignment, students: Iterable[Sequence[Variant]]) -> str:
    """Return the page of all sheets, one printed page or more a student."""
    words = texts()['sheet']
    language = assignment.language
    title = assignment.title or assignment.word('title')
    note = element('p', rich(words['degrees'][language]), class_='note')
    points = assignment.points_text(sum(assignment.points.values()))
    total = element('span', f'{assignment.word("total")}: ____ / {points}')
    asked_heading = element('h3', words['asked'][language])
    lines = element('div', *[element('div')] * assignment.room, class_='room')
    sections = []
    for variants in students:
        student = element('span', f'{words["student"][language]}: {_student(variants[0])}')
        content = [element('h1', title), element('p', student, total, class_='student'), note]
        for number, variant in enumerate(variants, 1):
            task = problem(variant, language, has_note=False)
            answers = _answers(variant, language)
            heading = _task_heading(assignment, number, variant)
            content += [heading, task, asked_heading, answers, lines]
        sections.append(element('section', *content))
    return SHEET_PARTS.page(title, *sections, language=language)


def key(assignment: Assignment, students: Sequence[Sequence[Variant]], *, has_steps: bool) -> str:
    """Return the page of all answers, a row a student; all steps come after it, if asked for."""
    words = texts()['sheet']
    language = assignment.language
    title = f'{words["key"][language]}: {assignment.title or assignment.word("title")}'
    sections = []
    for tasks in _table_tasks(students[0]):
        content = [element('h1', title)]
        heads = [words['student'][language]]
        rows = []
        for variants in students:
            rows.append([f'{variants[0].student} {variants[0].name}'])
        for task in tasks:
            content.append(_task_heading(assignment, task + 1, students[0][task]))
            if note := students[0][task].kind.note(language):
                content.append(element('p', rich(note), class_='note'))
            for question in students[0][task].kind.questions:
                unit = element('small', unit_sign(question.unit))
                name = question_symbol(question, language)
                heads.append(joined([f'{task + 1}. ', name, element('br'), unit]))
            for row, variants in zip(rows, students, strict=True):
                variant = variants[task]
                for question in variant.kind.questions:
                    row.append(answer_text(variant, question, language))
        table = scrolling_table(f'{title} {tasks[0] + 1}', heads, rows)
        sections.append(element('section', *content, table, class_='key'))
    for variants in students if has_steps else ():
        content = [element('h1', _student(variants[0]))]
        for number, variant in enumerate(variants, 1):
            answers = _answers(variant, language, solved=True)
            heading = _task_heading(assignment, number, variant)
            content += [heading, answers, _steps(variant, language)]
        sections.append(element('section', *content))
    return SHEET_PARTS.page(title, *sections, language=language)


def _task_heading(assignment: Assignment, number: int, variant: Variant) -> Markup:
    title = texts()['kinds'][variant.kind.name][assignment.language]['title']
    points = assignment.points_text(assignment.points[variant.kind.name])
    return element('h2', f'{number}. {title} ({points})')


def _table_tasks(variants: Sequence[Variant]) -> list[list[int]]:
    """Return the tasks of each table of a key that fits on the paper's width."""
    tables: list[list[int]] = []
    width = MAX_KEY_COLUMNS
    for task, variant in enumerate(variants):
        width += len(variant.kind.questions)
        if width > MAX_KEY_COLUMNS:
            tables.append([])
            width = len(variant.kind.questions)
        tables[-1].append(task)
    return tables


def _student(variant: Variant) -> str:
    if variant.name in ('', variant.student):
        return variant.student
    return f'{variant.name} ({variant.student})'


def problem(variant: Variant, language: str, *, has_note: bool = True) -> Markup:
    """Return the text of an exercise with its givens and its drawing."""
    words = texts()
    lines = []
    for name, number in variant.givens.items():
        lines.append(table_row(symbol(name), with_unit(number, unit_of(name), language)))
    drawing = picture(variant)
    row_count = GIVEN_ROWS if drawing else GIVEN_ROWS // 2
    starts = range(0, len(lines), row_count)
    givens = [element('table', *lines[start:][:row_count]) for start in starts]
    task = []
    for line in words['kinds'][variant.kind.name][language]['task'].splitlines():
        task += [rich(line), element('br')]
    note = element('p', rich(words['sheet']['degrees'][language]), class_='note')
    text = element('p', *task, rich(variant.kind.note(language)))
    return joined([text, *[note] * has_note, element('div', drawing, *givens, class_='given')])


def _answers(variant: Variant, language: str, *, solved: bool = False) -> Markup:
    """Return the table of the questions, with or without their answers."""
    lines = []
    for question in variant.kind.questions:
        text = answer_text(variant, question, language) if solved else ''
        cells = (
            element('th', question_markup(question, language)),
            element('td', text, class_='answer'),
            element('td', unit_sign(question.unit)),
            element('td', asked(variant, question, language), class_='note'),
        )
        lines.append(element('tr', *cells))
    return element('table', *lines, class_='answers')


def asked(variant: Variant, question: Question, language: str) -> str:
    """Return the precision asked for, or the choices."""
    words = texts()
    if question.choices:
        choices = words['choices']
        names = [choices.get(choice, {}).get(language, choice) for choice in question.choices]
        return ' / '.join(names)
    if question.unit == 'count':
        return str(words['sheet']['whole'][language])
    return str(words['sheet']['digits'][language].format(variant.kind.digits))


def _steps(variant: Variant, language: str) -> Markup:
    lines = []
    for step in variant.steps:
        formula = step.formula
        if language == 'pt':
            formula = SINE.sub(r'\1sen', formula).replace('asen', 'arcsen')
        number = with_unit(step.value, step.unit, language)
        lines.append(table_row(rich(formula), symbol(step.symbol), number))
    return element('table', *lines, class_='steps')


def question_markup(question: Question, language: str) -> Markup:
    """Return a question's symbol and words."""
    words = rich(question.words(language))
    name = question_symbol(question, language)
    return joined([name, Markup(', '), words]) if words not in ('', name) else name


def question_symbol(question: Question, language: str) -> Markup:
    """Return a question's symbol, or the words of one without a symbol."""
    return rich(question.words(language)) if question.is_word else symbol(question.name)


def answer_text(variant: Variant, question: Question, language: str) -> str:
    """Return the right answer to the digits asked for."""
    answer = variant.answers[question.name]
    if isinstance(answer, str):
        return str(texts()['choices'].get(answer, {}).get(language, answer))
    tolerance = variant.tolerance(question)
    return localised(f'{answer:.{decimals(tolerance)}f}', language)


def decimals(tolerance: float) -> int:
    """Return the decimals of a number whose last digit is worth a tolerance."""
    return max(0, -floor(log10(tolerance) + 1e-9)) if tolerance else 0


def with_unit(number: float, unit: str, language: str) -> str:
    """Return a number with its unit; rounding errors are 0."""
    number = number if abs(number) > ROUNDING else 0.0
    text = localised(f'{number:.6g}' if abs(number) < 1e6 else f'{number:.0f}', language)
    sign = unit_sign(unit)
    return f'{text}{sign}' if sign in ('', '°') else f'{text} {sign}'


def unit_sign(unit: str) -> str:
    """Return a unit as it is printed."""
    return str(data()['notation']['units'].get(unit, unit))


def symbol(name: str) -> Markup:
    """Return the symbol of a quantity, such as 'theta_2', with its subscript."""
    notation = data()['notation']
    if name in notation['symbols']:
        return rich(notation['symbols'][name])
    words = name.split('_')
    letter, *subscripts = [notation['greek'].get(word, word) for word in words]
    if words[0] == 'angle':
        return Markup(''.join([letter, *subscripts]))
    subscript = element('sub', ','.join(subscripts)) if subscripts else Markup('')
    return joined([element('i', letter), subscript])


def rich(text: str) -> Markup:
    """Return a text whose underscores are subscripts."""
    pieces: list[str] = SUBSCRIPT.split(MINUS.sub('\N{MINUS SIGN}', text))
    pieces[1::2] = [element('sub', subscript.strip('()')) for subscript in pieces[1::2]]
    return joined(pieces)


def picture(variant: Variant) -> Markup:
    """Return the drawing of the linkage as SVG; empty where it would show the answer."""
    if not variant.kind.leg:
        return Markup('')
    leg, angle = variant.kind.leg(variant.givens)
    arcs = leg.reachable_arcs()
    if not any(start <= angle % (2.0 * np.pi) <= end for start, end in arcs):
        start, end = arcs[0]
        angle = start + 0.4 * (end - start)
    return Markup(pose_svg(leg.closed_form(angle), names=_bar_names(variant)))


def _bar_names(variant: Variant) -> dict[tuple[str, str], str]:
    """Return the names of bars with numbered lengths, by their two points."""
    figure = data()['figures'][figure_of(variant.kind.name)]
    names = {}
    for quantities, mark in figure['marks'].items():
        # Such as 'line A B'; a line between pivots is the frame's.
        drawn_as, *points = mark.split()
        if drawn_as != 'line' or {*points} <= {*figure['pivots'].split()}:
            continue
        for name in quantities.split():
            is_numbered = name[2:].isdigit()
            if is_numbered and name in variant.givens:
                names[points[0], points[1]] = name.replace('_', '').translate(SUBSCRIPTS)
    return names
