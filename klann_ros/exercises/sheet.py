"""Exercises as printable pages: sheets of a class, their key, and the parts of every format."""

from collections.abc import Iterable, Sequence
from math import floor, log10
from pathlib import Path
import re

from klann_ros.kinematics import pose_svg
from klann_ros.web import element, joined, Markup, Parts, table_row
import numpy as np

from .calculation import Answer, data, figure_of
from .variant import Question, texts, unit_of, Variant

SHEET_PARTS = Parts(styles=(Path(__file__).parent / 'static' / 'sheet.css',), scripts=())
SUBSCRIPT = re.compile(r'_(\([^)]*\)|[A-Za-z0-9α-ω]+(?:,[A-Za-z0-9]+)*)')
SINE = re.compile(r'\b(a?)sin\b')
SUBSCRIPTS = str.maketrans('1234', '₁₂₃₄')
# Rows of a column of givens; rounding errors, in any unit that is printed.
GIVEN_ROWS, ROUNDING = 9, 1e-9


def sheets(variants: Sequence[Variant], language: str) -> str:
    """Return the page of all sheets, one printed page or more a student."""
    heading = element('h3', texts()['sheet']['asked'][language])
    contents = [
        (problem(variant, language), heading, _answers(variant, language)) for variant in variants
    ]
    return _page(_title(variants[0], language), variants, language, contents)


def key(variants: Sequence[Variant], language: str) -> str:
    """Return the page of all worked solutions."""
    words = texts()['sheet']
    heading = element('h3', words['solution'][language])
    contents = []
    for variant in variants:
        answers = _answers(variant, language, solved=True)
        contents.append((answers, heading, _steps(variant, language)))
    return _page(words['key'][language], variants, language, contents)


def _title(variant: Variant, language: str) -> str:
    return str(texts()['kinds'][variant.kind.name][language]['title'])


def _page(
    title: str, variants: Sequence[Variant], language: str, contents: Iterable[Iterable[Markup]]
) -> str:
    """Return a page with a section for each student."""
    sections = []
    for variant, content in zip(variants, contents, strict=True):
        student = variant.student
        if variant.name not in ('', student):
            student = f'{variant.name} ({student})'
        line = f'{texts()["sheet"]["student"][language]}: {student}'
        heading = element('h1', _title(variant, language)), element('p', line, class_='student')
        sections.append(element('section', *heading, *content))
    return SHEET_PARTS.page(title, *sections, language=language)


def problem(variant: Variant, language: str) -> Markup:
    """Return the text of an exercise with its givens and its drawing."""
    words = texts()
    lines = []
    for name, number in variant.givens.items():
        lines.append(table_row(symbol(name), with_unit(number, unit_of(name), language)))
    starts = range(0, len(lines), GIVEN_ROWS)
    givens = [element('table', *lines[start:][:GIVEN_ROWS]) for start in starts]
    task = []
    for line in words['kinds'][variant.kind.name][language]['task'].splitlines():
        task += [rich(line), element('br')]
    return joined([
        element('p', *task[:-1]),
        element('p', rich(words['sheet']['degrees'][language]), class_='note'),
        element('div', picture(variant), *givens, class_='given'),
    ])  # fmt: skip


def _answers(variant: Variant, language: str, *, solved: bool = False) -> Markup:
    """Return the table of the questions, with or without their answers."""
    lines = []
    for question in variant.kind.questions:
        answer = variant.answers[question.name]
        text = answer_text(variant, question, answer, language) if solved else ''
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
    words = rich(texts()['questions'].get(question.name, {}).get(language, ''))
    if question.name in data()['notation']['words'].split():
        return words
    if not words:
        return symbol(question.name)
    return joined([symbol(question.name), Markup(', '), words])


def answer_text(variant: Variant, question: Question, answer: Answer, language: str) -> str:
    """Return an answer to the digits asked for."""
    if isinstance(answer, str):
        return str(texts()['choices'].get(answer, {}).get(language, answer))
    tolerance = variant.tolerance(question)
    return localised(f'{answer:.{decimals(tolerance)}f}', language)


def decimals(tolerance: float) -> int:
    """Return the decimals of a number whose last digit is worth a tolerance."""
    return max(0, -floor(log10(tolerance) + 1e-9)) if tolerance else 0


def localised(number: str, language: str) -> str:
    """Return a number with the language's decimal separator and a true minus."""
    text = number.replace('-', '\N{MINUS SIGN}')
    return text.replace('.', ',') if language == 'pt' else text


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
    minus = text.replace(' -', ' \N{MINUS SIGN}').replace('= -', '= \N{MINUS SIGN}')
    pieces: list[str] = SUBSCRIPT.split(minus)
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
