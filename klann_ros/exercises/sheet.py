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
    asked = element('h3', texts()['sheet']['asked'][language])
    parts = [(problem(each, language), asked, _answers(each, language)) for each in variants]
    return _page(_title(variants[0], language), variants, language, parts)


def key(variants: Sequence[Variant], language: str) -> str:
    """Return the page of all worked solutions."""
    words = texts()['sheet']
    solution = element('h3', words['solution'][language])
    parts = [
        (_answers(each, language, solved=True), solution, _steps(each, language))
        for each in variants
    ]
    return _page(words['key'][language], variants, language, parts)


def _title(variant: Variant, language: str) -> str:
    return str(texts()['kinds'][variant.kind.name][language]['title'])


def _page(
    title: str, variants: Sequence[Variant], language: str, parts: Iterable[Iterable[Markup]]
) -> str:
    """Return a page with a section for each student."""
    sections = []
    for variant, content in zip(variants, parts, strict=True):
        number, name = variant.student, variant.name
        student = number if name in ('', number) else f'{name} ({number})'
        line = f'{texts()["sheet"]["student"][language]}: {student}'
        heading = element('h1', _title(variant, language)), element('p', line, class_='student')
        sections.append(element('section', *heading, *content))
    return SHEET_PARTS.page(title, *sections, language=language)


def problem(variant: Variant, language: str) -> Markup:
    """Return the text of an exercise with its givens and its drawing."""
    words = texts()
    rows = [
        table_row(symbol(name), with_unit(value, unit_of(name), language))
        for name, value in variant.givens.items()
    ]
    starts = range(0, len(rows), GIVEN_ROWS)
    givens = (element('table', *rows[start:][:GIVEN_ROWS]) for start in starts)
    lines = words['kinds'][variant.kind.name][language]['task'].splitlines()
    task = [part for line in lines for part in (rich(line), element('br'))]
    return joined(
        [
            element('p', *task[:-1]),
            element('p', rich(words['sheet']['degrees'][language]), class_='note'),
            element('div', picture(variant), *givens, class_='given'),
        ]
    )


def _answers(variant: Variant, language: str, *, solved: bool = False) -> Markup:
    """Return the table of the questions, with or without their answers."""
    rows = []
    for question in variant.kind.questions:
        answer = variant.answers[question.name]
        shown = answer_text(variant, question, answer, language) if solved else ''
        cells = (
            element('th', question_markup(question, language)),
            element('td', shown, class_='answer'),
            element('td', unit_sign(question.unit)),
            element('td', asked(variant, question, language), class_='note'),
        )
        rows.append(element('tr', *cells))
    return element('table', *rows, class_='answers')


def asked(variant: Variant, question: Question, language: str) -> str:
    """Return the precision asked for, or the choices."""
    words = texts()
    if question.choices:
        names = (words['choices'].get(each, {}).get(language, each) for each in question.choices)
        return ' / '.join(names)
    if question.unit == 'count':
        return str(words['sheet']['whole'][language])
    return str(words['sheet']['digits'][language].format(variant.kind.digits))


def _steps(variant: Variant, language: str) -> Markup:
    rows = []
    for step in variant.steps:
        formula = SINE.sub(r'\1sen', step.formula) if language == 'pt' else step.formula
        value = with_unit(step.value, step.unit, language)
        rows.append(table_row(rich(formula.replace('asen', 'arcsen')), symbol(step.symbol), value))
    return element('table', *rows, class_='steps')


def question_markup(question: Question, language: str) -> Markup:
    """Return a question's symbol and words."""
    words = rich(texts()['questions'].get(question.name, {}).get(language, ''))
    if question.name in data()['notation']['words'].split():
        return words
    return joined([symbol(question.name), *([Markup(', '), words] if words else [])])


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


def with_unit(value: float, unit: str, language: str) -> str:
    """Return a number with its unit; rounding errors are 0."""
    value = value if abs(value) > ROUNDING else 0.0
    number = localised(f'{value:.6g}' if abs(value) < 1e6 else f'{value:.0f}', language)
    sign = unit_sign(unit)
    return f'{number}{sign}' if sign in ('', '°') else f'{number} {sign}'


def unit_sign(unit: str) -> str:
    """Return a unit as it is printed."""
    return str(data()['notation']['units'].get(unit, unit))


def symbol(name: str) -> Markup:
    """Return the symbol of a quantity, such as 'theta_2', with its subscript."""
    notation = data()['notation']
    if name in notation['symbols']:
        return rich(notation['symbols'][name])
    base, *subs = name.split('_')
    parts = [notation['greek'].get(part, part) for part in (base, *subs)]
    if base == 'angle':
        return Markup(''.join(parts))
    sub = element('sub', ','.join(parts[1:])) if subs else Markup('')
    return joined([element('i', parts[0]), sub])


def rich(text: str) -> Markup:
    """Return a text whose underscores are subscripts."""
    minus = text.replace(' -', ' \N{MINUS SIGN}').replace('= -', '= \N{MINUS SIGN}')
    parts = enumerate(SUBSCRIPT.split(minus))
    return joined(element('sub', part.strip('()')) if k % 2 else part for k, part in parts)


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
    found = {}
    for quantities, mark in figure['marks'].items():
        how, *points = mark.split()
        is_bar = how == 'line' and not {*points} <= {*figure['pivots'].split()}
        for name in quantities.split():
            if is_bar and name in variant.givens and name[2:].isdigit():
                found[points[0], points[1]] = name.replace('_', '').translate(SUBSCRIPTS)
    return found
