"""
Kinds of exercises and their variants: one for each student, drawn from the student's number.

A variant depends on its kind and student alone. Its key is computed by the library, its steps by
the course's formulas; a draw is accepted if both agree and the numbers are fit for a person.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
import hmac
from math import floor, inf, log10
from typing import Any, NamedTuple

from klann_ros.kinematics import KinematicsError
from klann_ros.sanitize.text import did_you_mean, printable
import numpy as np

from .calculation import Answer, Calculation, data, Step, TURN_DEG
from .formulas import Formula, FORMULAS, SYSTEMS

LANGUAGES = ('en', 'pt')
# Longest student number [characters].
MAX_STUDENT = 64
# Key and course's formulas agree within this part of their size.
AGREEMENT = 1e-9
# An angle beyond any unit's mistake diverged [deg].
MAX_ANGLE = 60.0 * TURN_DEG


class ExerciseError(ValueError):
    """An unknown kind or language, or a student number that is refused."""


class Draw:
    """
    Numbers from a text: FNV-1a gives the seed, mulberry32 the numbers (short in JavaScript too).

    References
    ----------
    Fowler, Noll, Vo: FNV hash; T. Ettinger: mulberry32 (public domain).

    """

    def __init__(self, text: str) -> None:
        state = 0x811C9DC5
        for byte in text.encode():
            state = (state ^ byte) * 0x01000193 & 0xFFFFFFFF
        self._state = state

    def unit(self) -> float:
        """Return a number in [0, 1)."""
        self._state = (self._state + 0x6D2B79F5) & 0xFFFFFFFF
        t = self._state
        t = (t ^ t >> 15) * (t | 1) & 0xFFFFFFFF
        t ^= t + ((t ^ t >> 7) * (t | 61) & 0xFFFFFFFF) & 0xFFFFFFFF
        return ((t ^ t >> 14) & 0xFFFFFFFF) / 2.0**32

    def value(self, low: float, high: float, step: float = 1.0) -> float:
        """Return one of low, low + step, ... high."""
        count = floor((high - low) / step + 1.5)
        return low + step * floor(self.unit() * count)


class Question(NamedTuple):
    """
    A question of an exercise: its quantity, such as 'theta_4', its unit and the words of a choice.

    The unit is 'deg', 'mm', ...; '1' for a number, 'count' for a whole one, 'choice' for a word.
    Answers below the smallest size are not asked.
    """

    name: str
    unit: str
    choices: tuple[str, ...] = ()
    smallest: float = 0.0

    @property
    def is_word(self) -> bool:
        """Return whether it has no symbol."""
        return self.name in data()['notation']['words'].split()

    def words(self, language: str) -> str:
        """Return its words, if it has any."""
        return str(texts()['questions'].get(self.name, {}).get(language, ''))


@dataclass(frozen=True, eq=False)
class Kind:
    """
    A kind of exercise; exercises.yaml has its givens and questions by its name.

    `solve` returns the answers by the library, for leg, crank angle [rad] and givens, or for
    givens alone; `leg` those of the drawing, unless they would show the answer.
    """

    name: str
    solve: Callable[..., Mapping[str, Answer]]
    leg: Callable[[Mapping[str, float]], tuple[Any, float]] | None = None

    def key(self, givens: Mapping[str, float]) -> Mapping[str, Answer]:
        """Return the answers by the library, and others of the same leg."""
        return self.solve(*self.leg(givens), givens) if self.leg else self.solve(givens)

    @cached_property
    def _content(self) -> dict[str, Any]:
        content: dict[str, Any] = data()['kinds'][self.name]
        return content

    @cached_property
    def questions(self) -> tuple[Question, ...]:
        """Return the questions in their order."""
        choices = data()['choices']
        smallest = data()['variants']['smallest']
        questions = []
        for group in self._content['asked'].split(', '):
            unit, *quantities = group.split()
            for quantity in quantities:
                words = tuple(choices.get(quantity, ()))
                questions.append(Question(quantity, unit, words, smallest.get(unit, 0.0)))
        return tuple(questions)

    @property
    def digits(self) -> int:
        """Return the significant digits asked for."""
        return int(self._content.get('digits', data()['variants']['digits']))

    @cached_property
    def mistakes(self) -> tuple[str, ...]:
        """Return the mistakes of a calculation, those of a sign in its system first."""
        system = self._content.get('system')
        rows = range(len(SYSTEMS[system].unknowns) if system else 0)
        mistakes = [f'f:{row}' for row in rows]
        for row in rows:
            mistakes += [f'phi:{row},{column}' for column in rows]
        return (*mistakes, *data()['mistakes']['calculation'].split())

    def note(self, language: str) -> str:
        """Return what sheet and key say of the assembly mode or the design, if anything."""
        return str(texts()['notes'].get(self._content.get('note'), {}).get(language, ''))

    def draw(self, draw: Draw) -> dict[str, float]:
        """Return givens, in mm, deg, s and N."""
        givens: dict[str, float] = {}
        for group in self._content['given']:
            ranges = data()['groups'][group] if isinstance(group, str) else group
            for name, (low, high, step) in ranges.items():
                givens[name] = draw.value(float(low), float(high), float(step))
        if 'guess' in self._content:
            # Near the root, in multiples of 5 deg.
            system = SYSTEMS[self._content['guess']]
            position = _worked(Calculation(givens), system.position)
            for name in system.unknowns:
                root = float(position.answers[name]) if position else 0.0
                givens[f'{name}_1'] = 5.0 * round(root / 5.0) + 5.0 * draw.value(-3.0, 3.0)
        change_point_share = self._content.get('change-points', 0.0)
        if change_point_share and draw.unit() < change_point_share:
            # Class III: the longest link is p + q - s.
            s, p, q, _ = sorted(givens.values())
            givens[max(givens, key=lambda name: givens[name])] = p + q - s
        return givens

    def calculated(self, givens: Mapping[str, float], mistake: str = '') -> Calculation | None:
        """Return the calculation with a mistake; None where it leads nowhere."""
        calculation = Calculation(givens, mistake, self._content.get('input', ''))
        return _worked(calculation, FORMULAS[self.name])


def _worked(calculation: Calculation, formula: Formula) -> Calculation | None:
    """Return a calculation after its formulas; None where they lead nowhere."""
    try:
        with np.errstate(all='ignore'):
            formula(calculation)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return None
    return calculation


@dataclass(frozen=True, eq=False)
class Variant:
    """
    The exercise of a student, by number and, if known, name: its key and its worked solution.

    `givens` are in the units of the kind, `answers` in those of the questions.
    """

    kind: Kind
    student: str
    name: str
    givens: Mapping[str, float]
    answers: Mapping[str, Answer]
    steps: tuple[Step, ...]

    @cached_property
    def mistaken(self) -> dict[str, dict[str, Answer]]:
        """Return the wrong answers of each mistake, by question."""
        wrong_answers: dict[str, dict[str, Answer]] = {}
        for mistake in self.kind.mistakes:
            if calculation := self.kind.calculated(self.givens, mistake):
                wrong_answers[mistake] = self._wrong(calculation.answers)
        answer_mistakes = data()['mistakes']['answers']
        for question in self.kind.questions:
            right = self.answers[question.name]
            for mistake, (factor, summand) in answer_mistakes.get(question.unit, {}).items():
                if isinstance(right, float):
                    wrong = self._wrong({question.name: factor * right + summand})
                    wrong_answers.setdefault(mistake, {}).update(wrong)
        return wrong_answers

    @cached_property
    def dithered(self) -> list[Mapping[str, Answer]]:
        """Return the answers with errors as of three digits in all intermediate results."""
        series = range(1, int(data()['marking']['dither-series']) + 1)
        calculations = [self.kind.calculated(self.givens, f'dither:{k}') for k in series]
        return [calculation.answers for calculation in calculations if calculation]

    def _wrong(self, answers: Mapping[str, Answer]) -> dict[str, Answer]:
        """Return those answers that are not right and did not diverge."""
        wrong = {}
        for question in self.kind.questions:
            name = question.name
            if name not in answers or self.is_right(question, answers[name]):
                continue
            limit = MAX_ANGLE if question.unit == 'deg' else inf
            answer = answers[name]
            if isinstance(answer, str) or abs(answer) < limit:
                wrong[name] = answer
        return wrong

    def tolerance(self, question: Question, answer: Answer | None = None) -> float:
        """Return a unit of the last digit asked for, of the right answer or of another."""
        answer = self.answers[question.name] if answer is None else answer
        if isinstance(answer, str) or question.unit == 'count':
            return 0.0
        exponent = floor(log10(max(abs(answer), question.smallest)))
        return float(10.0 ** (exponent + 1 - self.kind.digits))

    def is_right(self, question: Question, answer: Answer) -> bool:
        """Return whether an answer is right to the digits asked for."""
        return self.is_near(question, answer, self.answers[question.name])

    def is_near(self, question: Question, answer: Answer, reference: Answer) -> bool:
        """Return whether an answer is another one, to the digits asked for."""
        # The last digit itself is rounded.
        tolerance = self.tolerance(question, reference) * (1.0 + 1e-6)
        return difference(question, answer, reference) <= tolerance


def difference(question: Question, answer: Answer, reference: Answer) -> float:
    """Return the distance of two answers, of angles modulo a turn, of words 0 or 1."""
    if isinstance(answer, str) or isinstance(reference, str):
        return float(answer != reference)
    gap = abs(answer - reference)
    if question.unit == 'deg':
        gap %= TURN_DEG
        return min(gap, TURN_DEG - gap)
    return gap


def make_variant(kind: Kind, student: str, name: str = '', secret: str = '') -> Variant:
    """
    Return the variant of a student, whose name changes nothing.

    With a secret it is that of HMAC-SHA256 of the student number: nobody else can draw it.

    Raises
    ------
    ExerciseError
        The student's number is empty, too long or not printable.

    """
    if not student or len(student) > MAX_STUDENT or printable(student) != student:
        raise ExerciseError(
            f'student {printable(student, MAX_STUDENT)!r} is refused: it must be 1 to '
            f'{MAX_STUDENT} printable characters'
        )
    seed = hmac.new(secret.encode(), student.encode(), 'sha256').hexdigest() if secret else student
    draw = Draw(f'{kind.name}:{seed}')
    for _ in range(data()['variants']['draws']):
        variant = _suitable(kind, student, name, kind.draw(draw))
        if variant:
            return variant
    raise AssertionError(f'{kind.name}: no suitable variant')


def _suitable(kind: Kind, student: str, name: str, givens: dict[str, float]) -> Variant | None:
    """Return the variant of givens if it assembles, is well conditioned and has fair answers."""
    worked = kind.calculated(givens)
    guarded = worked and kind.calculated(givens, data()['variants']['guard']['mistake'])
    if not worked or not guarded:
        return None
    for question in kind.questions:
        answer = worked.answers[question.name]
        if not isinstance(answer, str) and not question.smallest <= abs(answer) < inf:
            return None
    try:
        key = kind.key(givens)
        answers = {question.name: key[question.name] for question in kind.questions}
    except (KinematicsError, KeyError):
        # No such linkage, or not one that the kind asks about, such as one without limits.
        return None
    variant = Variant(kind, student, name, givens, answers, tuple(worked.steps))
    for question in kind.questions:
        right = answers[question.name]
        size = 1.0 if isinstance(right, str) else max(abs(right), 1.0)
        rounding = data()['variants']['guard']['share'] * variant.tolerance(question)
        if difference(question, right, worked.answers[question.name]) > AGREEMENT * size:
            return None
        if difference(question, right, guarded.answers[question.name]) > rounding:
            return None
    return variant


def texts() -> dict[str, Any]:
    """Return the texts of the exercises, by subject and language."""
    content: dict[str, Any] = data()['texts']
    return content


@lru_cache
def unit_of(given: str) -> str:
    """Return the unit of a given; mm unless exercises.yaml has another."""
    units: dict[str, str] = data()['units']
    return next((unit for unit, names in units.items() if given in names.split()), 'mm')


def look_up(name: str, names: Mapping[str, Any], subject: str) -> Any:
    """Return what a name stands for; an ExerciseError lists the names."""
    if name not in names:
        listing = ', '.join(names)
        raise ExerciseError(
            f'{subject} {printable(name)!r} is unknown: {listing}{did_you_mean(name, names)}'
        )
    return names[name]
