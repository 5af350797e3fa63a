"""
The counts of the exercises: distinct variants, right answers refused, slips named rightly.

Half of the wrong answers are computed by the equations of the tests, which the marking does not
know; these students also round in another way than the marking assumes.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from itertools import cycle
from math import floor, log10, radians
import random
import sys
from typing import Any

import four_bar_equations
import klann_equations
from klann_ros.exercises import KINDS, make_variant, mark, Question, Variant
from klann_ros.exercises.calculation import slip_of
from klann_ros.exercises.variant import texts
from klann_ros.kinematics import FourBarGeometry, KlannGeometry
import numpy as np
from support.aims import exit_code, sized

SEEDS = sized(5, 100, 1000)
# Wrong and right answers.
WRONG = sized(40, 400, 1000)
RIGHT = sized(100, 2000, 10_000)
SLIPS = [*texts()['slips']]
KLANN = ('gamma', 'beta', 'delta', 'theta')
Answers = dict[str, float]


def main() -> int:
    """Print the counts; return 0 if all aims are reached."""
    chance = random.Random(32)  # noqa: S311 - no secret
    repeated = 0
    for kind in KINDS.values():
        givens = {tuple(make_variant(kind, str(k)).givens.items()) for k in range(SEEDS)}
        repeated += SEEDS - len(givens)
    print(f'{len(KINDS)} kinds, {SEEDS} seeds each: {repeated} repeated, aim 0')
    refused = _count_refused(chance)
    print(f'{RIGHT} right answers: {refused} refused, aim 0')
    met = [repeated == 0, refused == 0]
    for is_single, text in ((False, 'whole exercises'), (True, 'one in an exercise')):
        right, confusions = _count_named(chance, is_single=is_single)
        print(f'{WRONG} wrong answers, {text}: {right} slips named rightly, aim {WRONG * 9 // 10}')
        print('   ', ', '.join(f'{slip} as {name} {n}' for (slip, name), n in confusions))
        met.append(right >= 0.9 * WRONG)
    return exit_code(*met)


def _count_refused(chance: random.Random) -> int:
    refused = marked = 0
    while marked < RIGHT:
        variant = _draw_variant(chance)
        answers = {}
        for question in variant.kind.questions:
            answer = variant.answers[question.name]
            answers[question.name] = _write_answer(chance, variant, question, answer)
        marks = mark(variant, answers)
        marked += len(marks)
        refused += sum(answer_mark.slip != 'right' for answer_mark in marks)
    return refused


def _draw_variant(chance: random.Random, names: list[str] | None = None) -> Variant:
    return make_variant(KINDS[chance.choice(names or [*KINDS])], str(chance.randrange(10**8)))


def _write_answer(
    chance: random.Random, variant: Variant, question: Question, answer: float | str
) -> str:
    """Return an answer in one of the legal forms, rounded as asked or finer."""
    if isinstance(answer, str):
        word = texts()['choices'].get(answer, {}).get(chance.choice(['en', 'pt']), answer)
        return str(chance.choice([word, word.upper(), f' {word} ']))
    if question.unit == 'count':
        return f'{answer:.0f}'
    digits = chance.randrange(variant.kind.digits, 9)
    unit = {'deg': '°', '1': ''}.get(question.unit, question.unit)
    if question.unit == 'deg' and chance.random() < 0.2:
        answer += chance.choice([-360.0, 360.0])
        digits += 2
    if question.unit == 'deg' and chance.random() < 0.2:
        answer, digits, unit = radians(answer), digits + 2, 'rad'
    elif question.unit == 'mm' and chance.random() < 0.2:
        answer, unit = answer / 1e3, 'm'
    # As a person rounds: to significant digits, without an exponent.
    places = digits - 1 - floor(log10(abs(answer)))
    text = f'{answer:.{max(places, 0)}f}'
    if chance.random() < 0.1:
        text = f'{answer:.{digits - 1}e}'
    if chance.random() < 0.5:
        text = text.replace('.', ',')
    if chance.random() < 0.3:
        text = text.replace('-', '\N{MINUS SIGN}')
    needs_unit = unit in ('rad', 'm')
    return f'{text} {unit}' if needs_unit or chance.random() < 0.5 else text


def _count_named(
    chance: random.Random, *, is_single: bool
) -> tuple[int, list[tuple[tuple[str, str], int]]]:
    """Return the number of slips named rightly, and the wrong names of slips with their counts."""
    right = 0
    confusions: Counter[tuple[str, str]] = Counter()
    slips = cycle(SLIPS)
    while right + confusions.total() < WRONG:
        slip = next(slips)
        student = _iterate_with_slip if chance.random() < 0.5 else _calculate_with_slip
        mistaken = student(chance, slip)
        if not mistaken:
            continue
        variant, computed = mistaken
        questions = {question.name: question for question in variant.kind.questions}
        names = [
            name
            for name, number in computed.items()
            if name in questions and not variant.is_right(questions[name], number)
        ]
        if not names:
            continue
        if is_single:
            names = [chance.choice(names)]
        answers = {}
        for name, right_answer in variant.answers.items():
            answer = computed[name] if name in names else right_answer
            answers[name] = _round_answer(variant, questions[name], answer)
        for answer_mark in mark(variant, answers):
            # A slip may have no effect after rounding.
            if answer_mark.question not in names or answer_mark.slip == 'right':
                continue
            if right + confusions.total() < WRONG:
                right += answer_mark.slip == slip
                confusions[slip, answer_mark.slip] += answer_mark.slip != slip
    return right, (+confusions).most_common(12)


def _round_answer(variant: Variant, question: Question, answer: float | str) -> str:
    if isinstance(answer, str):
        return answer
    if answer == 0.0 or question.unit == 'count':
        return f'{answer:.0f}'
    places = variant.kind.digits - 1 - floor(log10(abs(answer)))
    return f'{answer:.{max(places, 0)}f}'


def _calculate_with_slip(chance: random.Random, slip: str) -> tuple[Variant, Answers] | None:
    """Return wrong answers by the formulas of the exercise itself, of any kind."""
    variant = _draw_variant(chance)
    mistakes = [
        mistake
        for mistake, answers in variant.mistaken.items()
        if answers and slip_of(mistake) == slip
    ]
    if not mistakes:
        return None
    answers = variant.mistaken[chance.choice(mistakes)]
    return variant, {name: x for name, x in answers.items() if not isinstance(x, str)}


def _iterate_with_slip(  # noqa: C901, PLR0912 - a student with one of ten slips
    chance: random.Random, slip: str
) -> tuple[Variant, Answers] | None:
    """Return wrong answers of a Newton iteration by the equations of the tests."""
    variant = _draw_variant(chance, ['newton', 'four-bar-newton'])
    names, f, phi, drive = _system(variant)
    givens = variant.givens
    x = np.array([givens[f'{name}_1'] for name in names])
    if slip == 'assembly':
        # Another root, from a guess far away.
        x = x + np.array([chance.choice([-90.0, 90.0, 150.0]) for _ in names])
    row = chance.randrange(len(names))
    column = chance.randrange(len(names))
    place = chance.choice(['f', 'phi', 'step'])
    wrong_sign = place if slip == 'sign' else ''
    angle = {'clockwise': -drive, 'side': 180.0 - drive, 'sine': 90.0 - drive}.get(slip, drive)
    digits = chance.choice([0, 1])
    is_taken_for_radians = slip == 'radians' and chance.random() < 0.5
    answers: Answers = {}
    for k in range(12):
        rad = x if is_taken_for_radians else np.radians(x)
        left = f(angle if is_taken_for_radians else radians(angle), rad)
        matrix = phi(rad)
        if wrong_sign == 'f':
            left[row] = -left[row]
        if wrong_sign == 'phi':
            matrix[row, column] = -matrix[row, column]
        if slip == 'transposed':
            matrix = matrix.T
        if k == 0:
            answers |= {f'f_{n}': f_n for n, f_n in enumerate(left.tolist(), 1)}
            answers |= {'Phi_12': matrix[0, 1], 'Phi_21': matrix[1, 0]}
        try:
            step = np.linalg.solve(matrix, left)
        except np.linalg.LinAlgError:
            return None
        if wrong_sign == 'step':
            step = -step
        last_x = x
        x = x - (step if slip == 'radians' else np.degrees(step))
        if slip == 'rounding':
            x = x.round(digits)
        if not np.isfinite(x).all():
            return None
        if k == 0:
            answers |= zip([f'{name}_2' for name in names], x.tolist(), strict=True)
        is_converged = np.abs(x - last_x).max() < 1e-9
        if is_converged or (slip == 'short' and k == 1):
            break
    answers |= zip(names, x.tolist(), strict=True)
    if slip == 'assembly':
        # The first iterate is of another guess; only the root is the other assembly's.
        answers = {name: answers[name] for name in names}
        if np.abs(f(radians(angle), np.radians(x))).max() > 1e-6:
            return None
    if slip == 'units':
        answers = {name: answers[name] / 1e3 for name in answers if name[0] in 'fP'}
    if slip == 'rounding':
        # The equations themselves were not rounded.
        answers = {name: answers[name] for name in answers if name[0] not in 'fP'}
    return variant, answers


def _system(
    variant: Variant,
) -> tuple[tuple[str, ...], Callable[..., np.ndarray], Callable[..., np.ndarray], float]:
    givens = variant.givens
    if variant.kind.name == 'newton':
        klann = _klann_geometry(givens)
        return (
            KLANN,
            lambda alpha, x: 1e3 * klann_equations.f(klann, alpha, x),
            lambda x: 1e3 * klann_equations.phi(klann, x),
            givens['alpha'],
        )
    bar = FourBarGeometry(givens['L_1'], givens['L_2'], givens['L_3'], givens['L_4'])
    return (
        ('theta_3', 'theta_4'),
        lambda theta2, x: four_bar_equations.f(bar, theta2, x),
        lambda x: four_bar_equations.phi(bar, x),
        givens['theta_2'],
    )


def _klann_geometry(givens: Mapping[str, float]) -> KlannGeometry:
    dimensions: dict[str, Any] = {}
    for name, number in givens.items():
        if name.startswith(('L_', 'x_', 'y_')):
            dimensions[name.lower()] = number / 1e3
        elif name in ('angle_BCG', 'angle_FGH'):
            dimensions[name.lower()] = radians(number)
    return KlannGeometry(**dimensions)


if __name__ == '__main__':
    sys.exit(main())
