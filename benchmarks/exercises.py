"""
The counts of the exercises: variants, right answers refused, wrong ones paid, slips named rightly.

Half of the wrong answers are computed by the equations of the tests, which the marking does not
know; these students also round in another way than the marking assumes.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from itertools import cycle
from math import degrees, floor, log10, pi, radians
import random
import sys
from typing import Any

import four_bar_equations
import klann_equations
from klann_ros.exercises import KINDS, make_variant, mark, Question, Variant
from klann_ros.exercises.calculation import slip_of
from klann_ros.exercises.variant import MAX_ANGLE, texts
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
# Units as they are written, and their sizes in the unit asked for.
UNITS: dict[str, dict[str, float]] = {
    'deg': {
        '°|º|deg|degrees|graus|Graus|grau': 1.0,
        'rad|radians|radianos|RAD|rd': degrees(1.0),
        'rev|voltas': 360.0,
        "'": 1.0 / 60.0,
    },
    'mm': {
        'mm|MM|millimetres|milímetros': 1.0,
        'cm|centímetros': 10.0,
        'm|metros|metres': 1e3,
        'in|polegadas|inches': 25.4,
        'km': 1e6,
    },
    'mm/s': {
        'mm/s|mm·s⁻¹|mm s^-1|mm*s^-1|mm.s-1|mm por segundo|mm per second': 1.0,
        'm/s|m·s⁻¹|m/seg|metros por segundo': 1e3,
        'cm/s': 10.0,
        'm/min': 1e3 / 60.0,
    },
    'mm/s²': {
        'mm/s²|mm/s^2|mm/s2|mm/s**2|mm s-2|mm/s/s|mm/(s^2)|mm/(s·s)': 1.0,
        'm/s²|m/s^2|m·s⁻²|metres per second squared|metros por segundo ao quadrado': 1e3,
        'cm/s²': 10.0,
    },
    'rad/s': {
        'rad/s|rad.s-1|rad·s⁻¹|1/s|s^-1|s⁻¹|/s|RAD/S|radianos por segundo': 1.0,
        'rpm|rev/min|rotações por minuto|RPM': pi / 30.0,
        'deg/s|°/s|graus/s': radians(1.0),
    },
    'rad/s²': {
        'rad/s²|rad/s^2|1/s^2|s⁻²|rad.s-2|rad/(s²)': 1.0,
        'deg/s^2|°/s²': radians(1.0),
    },
    'N·m': {
        'N·m|N*m|N.m|N m|Nm|nm|N-m|J|W·s': 1.0,
        'kN·m|kNm|kN.m': 1e3,
        'N·cm|N cm': 0.01,
        'Nmm|N mm|N·mm|N.mm|N*mm': 1e-3,
        'kgf·m|kgf.m': 9.80665,
        'kgf.cm': 0.0980665,
    },
    '1': {'': 1.0},
}


def main() -> int:
    """Print the counts; return 0 if all aims are reached."""
    chance = random.Random(32)  # noqa: S311 - no secret
    repeated = 0
    for kind in KINDS.values():
        givens = {tuple(make_variant(kind, str(k)).givens.items()) for k in range(SEEDS)}
        repeated += SEEDS - len(givens)
    print(f'{len(KINDS)} kinds, {SEEDS} seeds each: {repeated} repeated, aim 0')
    refused = _count_refused(chance)
    print(f'{RIGHT} right answers in any unit: {refused} refused, aim 0')
    paid = _count_paid(chance)
    print(f'{RIGHT // 2} answers wrong by 5 to 20 %: {paid} with points, aim 0')
    met = [repeated == 0, refused == 0, paid == 0]
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


def _count_paid(chance: random.Random) -> int:
    """Return the number of wrong answers with points: alone, beside right ones, or all wrong."""
    paid = marked = 0
    while marked < RIGHT // 2:
        variant = _draw_variant(chance)
        answers: dict[str, str] = {}
        wrong: set[str] = set()
        case = chance.choice(['alone', 'beside right ones', 'all'])
        asked = [question.name for question in variant.kind.questions if not question.choices]
        chosen = asked if case == 'all' else [chance.choice(asked)]
        for question in variant.kind.questions:
            answer = variant.answers[question.name]
            if question.name in chosen and not isinstance(answer, str):
                error = chance.choice([-1.0, 1.0]) * chance.uniform(0.05, 0.2)
                answers[question.name] = f'{answer * (1.0 + error):.{variant.kind.digits}g}'
                wrong.add(question.name)
            elif case == 'beside right ones':
                answers[question.name] = _write_answer(chance, variant, question, answer)
        marks = [marked for marked in mark(variant, answers) if marked.question in wrong]
        marked += len(marks)
        paid += sum(answer_mark.points > 0.0 for answer_mark in marks)
    return paid


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
    if question.unit == 'deg' and chance.random() < 0.2:
        answer += chance.choice([-360.0, 360.0])
        digits += 2
    names, factor = chance.choice([*UNITS[question.unit].items()])
    unit = chance.choice(names.split('|'))
    if factor != 1.0:
        digits += 2
    answer /= factor
    # As a person rounds: to significant digits, without an exponent.
    places = digits - 1 - floor(log10(abs(answer)))
    text = f'{answer:.{max(places, 0)}f}'
    if chance.random() < 0.1:
        text = f'{answer:.{digits - 1}e}'
    if chance.random() < 0.5:
        text = text.replace('.', ',')
    if chance.random() < 0.3:
        text = text.replace('-', '\N{MINUS SIGN}')
    if unit and (factor != 1.0 or chance.random() < 0.5):
        joint = ' ' if unit[0] == '1' else chance.choice([' ', '', '\u00a0'])
        text = f'{text}{joint}{unit}'
    if chance.random() < 0.1:
        symbol = chance.choice(['x =', f'{question.name}=', 'θ_4 ≈'])
        text = f'{symbol} {text}'
    return text


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
        # Nobody hands in an angle of many turns.
        if not (np.abs(x) < MAX_ANGLE).all():
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
