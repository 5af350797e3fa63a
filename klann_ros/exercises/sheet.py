"""Exercises as printable pages: sheets of a class, their key, and the parts of every format."""

from collections.abc import Iterable, Sequence
from math import floor, log10
from pathlib import Path
import re
from typing import Any

from klann_ros.kinematics.drawing import PoseDrawing
from klann_ros.kinematics.svg import pose_svg
from klann_ros.web.markup import element, joined, Markup
from klann_ros.web.parts import Parts
import numpy as np

from .calculation import Answer, data
from .variant import label, Question, texts, unit_of, Variant

SHEET_PARTS = Parts(styles=(Path(__file__).parent / 'static' / 'sheet.css',), scripts=())
SUBSCRIPT = re.compile(r'_(\([^)]*\)|[A-Za-z0-9α-ω]+(?:,[A-Za-z0-9]+)*)')
SINE = re.compile(r'\b(a?)sin\b')
SUBSCRIPTS = str.maketrans('1234', '₁₂₃₄')
# Rows of a column of givens; digits of intermediate results.
GIVEN_ROWS, STEP_DIGITS = 9, 6


def sheets(variants: Sequence[Variant], names: Sequence[str], language: str) -> str:
    """Return the page of all sheets, one printed page or more a student."""
    parts = [
        element('section', *_heading(variant, name, language), *_sheet(variant, language))
        for variant, name in zip(variants, names, strict=True)
    ]
    return _page(texts()['kinds'][variants[0].kind.name][language]['title'], parts, language)


def key(variants: Sequence[Variant], names: Sequence[str], language: str) -> str:
    """Return the page of all worked solutions."""
    words = texts()['sheet']
    parts = [
        element(
            'section',
            *_heading(variant, name, language),
            _answers(variant, language, solved=True),
            element('h3', words['solution'][language]),
            element('table', *_steps(variant, language), class_='steps'),
        )
        for variant, name in zip(variants, names, strict=True)
    ]
    return _page(words['key'][language], parts, language)


def _page(title: str, parts: Iterable[Markup], language: str) -> str:
    head = (
        element('meta', charset='utf-8'),
        SHEET_PARTS.policy(),
        element('meta', name_='viewport', content='width=device-width, initial-scale=1'),
        element('title', title),
        SHEET_PARTS.style_elements(),
    )
    body = element('body', element('main', *parts))
    return f'<!doctype html>\n{element("html", element("head", *head), body, lang=language)}\n'


def _heading(variant: Variant, name: str, language: str) -> Iterable[Markup]:
    words = texts()
    yield element('h1', words['kinds'][variant.kind.name][language]['title'])
    student = variant.student if name in ('', variant.student) else f'{name} ({variant.student})'
    yield element('p', f'{words["sheet"]["student"][language]}: {student}', class_='student')


def _sheet(variant: Variant, language: str) -> Iterable[Markup]:
    yield problem(variant, language)
    yield element('h3', texts()['sheet']['asked'][language])
    yield _answers(variant, language, solved=False)


def problem(variant: Variant, language: str) -> Markup:
    """Return the text of an exercise with its givens and its drawing."""
    words = texts()
    rows = [
        element(
            'tr',
            element('th', symbol(name)),
            element('td', with_unit(value, unit_of(name), language)),
        )
        for name, value in variant.givens.items()
    ]
    starts = range(0, len(rows), GIVEN_ROWS)
    givens = (element('table', *rows[start:][:GIVEN_ROWS]) for start in starts)
    lines = words['kinds'][variant.kind.name][language]['task'].splitlines()
    task = [part for line in lines for part in (rich(line), element('br'))]
    drawing = picture(variant)
    return joined(
        [
            element('p', *task[:-1]),
            element('p', rich(words['sheet']['degrees'][language]), class_='note'),
            element('div', drawing, *givens, class_='given'),
        ]
    )


def _answers(variant: Variant, language: str, *, solved: bool) -> Markup:
    rows = []
    for question in variant.kind.questions:
        answer = variant.answers[question.name]
        shown = answer_text(variant, question, answer, language) if solved else ''
        cells = [
            element('th', question_markup(question, language)),
            element('td', shown, class_='answer'),
            element('td', unit_sign(question.unit)),
            element('td', asked(variant, question, language), class_='note'),
        ]
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


def _steps(variant: Variant, language: str) -> Iterable[Markup]:
    for step in variant.steps:
        formula = SINE.sub(r'\1sen', step.formula) if language == 'pt' else step.formula
        cells = (rich(formula.replace('asen', 'arcsen')), symbol(step.symbol))
        value = with_unit(_digits(step.value), step.unit, language)
        yield element('tr', *(element('td', cell) for cell in cells), element('td', value))


def question_markup(question: Question, language: str) -> Markup:
    """Return a question's symbol and words."""
    words = rich(label(question, language))
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


def _digits(value: float) -> str:
    return f'{value:.{STEP_DIGITS}g}' if abs(value) < 1e6 else f'{value:.0f}'


def localised(number: str, language: str) -> str:
    """Return a number with the language's decimal separator and a true minus."""
    text = number.replace('-', '\N{MINUS SIGN}')
    return text.replace('.', ',') if language == 'pt' else text


def with_unit(value: float | str, unit: str, language: str) -> str:
    """Return a number with its unit."""
    number = localised(value if isinstance(value, str) else f'{value:.6g}', language)
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
    parts = SUBSCRIPT.split(
        text.replace(' -', ' \N{MINUS SIGN}').replace('= -', '= \N{MINUS SIGN}')
    )
    return joined(
        element('sub', part.strip('()')) if k % 2 else part for k, part in enumerate(parts)
    )


def picture(variant: Variant) -> Markup:
    """Return the drawing of the linkage as SVG; empty where it would show the answer."""
    if not variant.kind.leg:
        return Markup('')
    leg, angle = variant.kind.leg(variant.givens)
    arcs = leg.reachable_arcs()
    if not any(start <= angle % (2.0 * np.pi) <= end for start, end in arcs):
        start, end = arcs[0]
        angle = start + 0.4 * (end - start)
    pose = leg.closed_form(angle)
    return Markup(pose_svg(pose, names=_bar_names(variant, pose)))


def _bar_names(variant: Variant, pose: Any) -> dict[tuple[str, str], str]:
    """Return the names of bars with numbered lengths, by their two points."""
    names = {
        round(1e3 * value): name.replace('_', '').translate(SUBSCRIPTS)
        for name, value in variant.givens.items()
        if name.startswith('L_') and name[2:].isdigit()
    }
    drawn = PoseDrawing.of(pose)
    found = {}
    for bar in (bar for body in drawn.bodies for bar in body.bars):
        length = float(np.hypot(*(drawn.points[bar[1]] - drawn.points[bar[0]])))
        # The library's lengths are in m, or in mm where the exercise's are.
        name = names.get(round(1e6 * length)) or names.get(round(1e3 * length))
        if name:
            found[bar] = name
    return found
