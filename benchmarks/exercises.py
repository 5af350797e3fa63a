"""
The counts of the exercises: distinct variants, right answers refused, slips named rightly.

Half of the wrong answers are computed by the equations of the tests, which the marking does not
know; these students also round in another way than the marking assumes.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
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

SEEDS, WRONG, RIGHT = sized(5, 100, 1000), sized(40, 400, 1000), sized(100, 2000, 10_000)
SLIPS = [*texts()['slips']]
KLANN = ('gamma', 'beta', 'delta', 'theta')
Answers = dict[str, float]


def main() -> int:
    """Print the counts; return 0 if all aims are reached."""
    chance = random.Random(32)  # noqa: S311 - no secret
    repeated = 0
    for kind in KINDS.values():
        variants = [make_variant(kind, str(seed)) for seed in range(SEEDS)]
        repeated += SEEDS - len({tuple(variant.givens.items()) for variant in variants})
    print(f'{len(KINDS)} kinds, {SEEDS} seeds each: {repeated} repeated, aim 0')
    refused = _refused(chance)
    print(f'{RIGHT} right answers: {refused} refused, aim 0')
    named = {alone: _named(chance, alone=alone) for alone in (False, True)}
    for alone, (right, missed) in named.items():
        text = 'one in an exercise' if alone else 'whole exercises'
        print(f'{WRONG} wrong answers, {text}: {right} slips named rightly, aim {WRONG * 9 // 10}')
        print('   ', ', '.join(f'{slip} as {name} {n}' for (slip, name), n in missed))
    enough = [right >= 0.9 * WRONG for right, _ in named.values()]
    return exit_code(repeated == 0, refused == 0, *enough)


def _refused(chance: random.Random) -> int:
    refused = marked = 0
    while marked < RIGHT:
        variant = _variant(chance)
        answers = {}
        for question in variant.kind.questions:
            answer = variant.answers[question.name]
            answers[question.name] = _written(chance, variant, question, answer)
        marks = mark(variant, answers)
        marked += len(marks)
        refused += sum(answer_mark.slip != 'right' for answer_mark in marks)
    return refused


def _variant(chance: random.Random, names: list[str] | None = None) -> Variant:
    return make_variant(KINDS[chance.choice(names or [*KINDS])], str(chance.randrange(10**8)))


def _written(
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


def _named(chance: random.Random, *, alone: bool) -> tuple[int, list[tuple[tuple[str, str], int]]]:
    """Return how many slips are named rightly, and those that are not, with their other names."""
    missed = Counter[tuple[str, str]]()
    right = done = 0
    slips = _slips()
    while done < WRONG:
        slip = next(slips)
        student = _independent if chance.random() < 0.5 else _by_calculation
        mistaken = student(chance, slip)
        if not mistaken:
            continue
        variant, wrong = mistaken
        questions = {question.name: question for question in variant.kind.questions}
        names = []
        for name, answer in wrong.items():
            if name in questions and not variant.is_right(questions[name], answer):
                names.append(name)
        if not names:
            continue
        if alone:
            names = [chance.choice(names)]
        answers = {
            name: _rounded(variant, question, (wrong if name in names else variant.answers)[name])
            for name, question in questions.items()
        }
        for answer_mark in mark(variant, answers):
            # Rounded as asked, a slip may have no effect left.
            is_wrong = answer_mark.question in names and answer_mark.slip != 'right'
            if is_wrong and done < WRONG:
                done += 1
                right += answer_mark.slip == slip
                if answer_mark.slip != slip:
                    missed[slip, answer_mark.slip] += 1
    return right, missed.most_common(12)


def _slips() -> Iterator[str]:
    while True:
        yield from SLIPS


def _rounded(variant: Variant, question: Question, answer: float | str) -> str:
    if isinstance(answer, str) or answer == 0.0 or question.unit == 'count':
        return answer if isinstance(answer, str) else f'{answer:.0f}'
    places = variant.kind.digits - 1 - floor(log10(abs(answer)))
    return f'{answer:.{max(places, 0)}f}'


def _by_calculation(chance: random.Random, slip: str) -> tuple[Variant, Answers] | None:
    """Return wrong answers by the formulas of the exercise itself, of any kind."""
    variant = _variant(chance)
    mistakes = [
        mistake
        for mistake, wrong in variant.mistaken.items()
        if wrong and slip_of(mistake) == slip
    ]
    if not mistakes:
        return None
    wrong = variant.mistaken[chance.choice(mistakes)]
    return variant, {name: value for name, value in wrong.items() if not isinstance(value, str)}


def _independent(  # noqa: C901, PLR0912 - a student with one of ten slips
    chance: random.Random, slip: str
) -> tuple[Variant, Answers] | None:
    """Return wrong answers of a Newton iteration by the equations of the tests."""
    variant = _variant(chance, ['newton', 'four-bar-newton'])
    names, f, phi, drive = _system(variant)
    givens = variant.givens
    x = np.array([givens[f'{name}_1'] for name in names])
    if slip == 'assembly':
        # Another root, from a guess far away.
        x = x + np.array([chance.choice([-90.0, 90.0, 150.0]) for _ in names])
    row, column = chance.randrange(len(names)), chance.randrange(len(names))
    place = chance.choice(['f', 'phi', 'step'])
    angle = {'clockwise': -drive, 'side': 180.0 - drive, 'sine': 90.0 - drive}.get(slip, drive)
    digits = chance.choice([0, 1])
    mode = slip == 'radians' and chance.random() < 0.5
    answers: Answers = {}
    for k in range(12):
        rad = x if mode else np.radians(x)
        left = f(angle if mode else radians(angle), rad)
        matrix = phi(rad)
        if slip == 'sign' and place == 'f':
            left[row] = -left[row]
        if slip == 'sign' and place == 'phi':
            matrix[row, column] = -matrix[row, column]
        if slip == 'transposed':
            matrix = matrix.T
        if k == 0:
            answers |= {f'f_{n}': value for n, value in enumerate(left.tolist(), 1)}
            answers |= {'Phi_12': matrix[0, 1], 'Phi_21': matrix[1, 0]}
        try:
            step = np.linalg.solve(matrix, left)
        except np.linalg.LinAlgError:
            return None
        step = -step if slip == 'sign' and place == 'step' else step
        last = x
        x = x - (step if slip == 'radians' else np.degrees(step))
        if slip == 'rounding':
            x = x.round(digits)
        if not np.isfinite(x).all():
            return None
        if k == 0:
            answers |= {f'{name}_2': value for name, value in zip(names, x.tolist(), strict=True)}
        if slip == 'short' and k == 1:
            break
        if np.abs(x - last).max() < 1e-9:
            break
    answers |= dict(zip(names, x.tolist(), strict=True))
    if slip == 'assembly':
        # The first iterate is of another guess; only the root is the other assembly's.
        answers = {name: answers[name] for name in names}
        if np.abs(f(radians(angle), np.radians(x))).max() > 1e-6:
            return None
    if slip == 'units':
        answers = {name: value / 1e3 for name, value in answers.items() if name[0] in 'fP'}
    if slip == 'rounding':
        # The equations themselves were not rounded.
        answers = {name: value for name, value in answers.items() if name[0] not in 'fP'}
    return variant, answers


def _system(
    variant: Variant,
) -> tuple[tuple[str, ...], Callable[..., np.ndarray], Callable[..., np.ndarray], float]:
    givens = variant.givens
    if variant.kind.name == 'newton':
        klann = _klann(givens)
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


def _klann(givens: Mapping[str, float]) -> KlannGeometry:
    lengths: dict[str, Any] = {
        name.lower(): value / 1e3
        for name, value in givens.items()
        if name.startswith(('L_', 'x_', 'y_'))
    }
    bends: dict[str, Any] = {
        name.lower(): radians(givens[name]) for name in ('angle_BCG', 'angle_FGH')
    }
    return KlannGeometry(**lengths, **bends)


if __name__ == '__main__':
    sys.exit(main())
