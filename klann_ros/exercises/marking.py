"""Marking: answers as students write them, points, and the slip that explains a wrong one."""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import hypot, isnan, sqrt
import re
from typing import NamedTuple

from klann_ros.sanitize.quantity import MAX_QUANTITY, read_quantity, tidy

from .calculation import Answer, data, slip_of
from .lab import sources
from .variant import difference, Question, texts, Variant

RIGHT, WRONG, EMPTY, UNREADABLE = 'right', 'wrong', 'empty', 'unreadable'
DIMENSION, ROUNDING = 'dimension', 'rounding'
# Part of a right answer within which a wrong one may be one by chance.
CLOSE = 0.25
# Part of it that rounding may reach at most, and errors of it in root mean squares.
MAX_ROUNDING, ROUNDING_REACH = 0.03, 2.0


class Mark(NamedTuple):
    """
    The mark of an answer as written: 0 to 1 points, and the slip that explains it.

    The slip is 'right', 'wrong', 'empty', 'unreadable', 'dimension', or one such as 'radians'; it
    is carried where it follows from the same slip in an earlier answer.
    """

    question: str
    given: str
    points: float
    slip: str
    carried: bool = False

    def reason(self, language: str) -> str:
        """Return the reason in words."""
        slips = [self.slip, 'carried'] if self.carried else [self.slip]
        words = '; '.join(reason(slip, language) for slip in slips)
        is_doubtful = not self.points and self.slip in texts()['slips']
        return reason('perhaps', language).format(words) if is_doubtful else words


def reason(slip: str, language: str) -> str:
    """Return the words of a mark or a slip."""
    words = texts()
    return str((words['marks'].get(slip) or words['slips'][slip])[language])


Marks = Mapping[tuple[str, str], Sequence[Mark]]
"""The marks of a class by student and kind."""


def credit_of(slip: str) -> float:
    """Return the points of an answer with a slip."""
    credit = data()['marking']['credit']
    return float(credit.get(slip, credit['other']))


def read_answer(text: str, question: Question) -> Answer | None:
    """
    Return an answer as a number in the unit asked for, or a word; None where it is neither.

    Numbers and units are those of `read_quantity`; NaN where the unit does not fit.
    """
    return _choice(text, question) if question.choices else read_quantity(text, question.unit)


def _choice(text: str, question: Question) -> str | None:
    """Return the choice that a text names, with or without words that mean nothing beside it."""
    marking = data()['marking']
    answer = _plain(text) if len(text) <= MAX_QUANTITY else ''
    fillers = marking['fillers'].split()
    for name in (answer, ' '.join(word for word in answer.split() if word not in fillers)):
        for choice in question.choices:
            words = texts()['choices'].get(choice, {}).values()
            if name in {
                _plain(str(word)) for word in (choice, *words, *marking['synonyms'][choice])
            }:
                return choice
    return None


def _plain(text: str) -> str:
    return re.sub("[^a-z0-9']+", ' ', tidy(text)).replace("'", '').strip()


def mark(variant: Variant, answers: Mapping[str, str]) -> list[Mark]:
    """
    Return the marks of a student's answers, in the order of the questions.

    A wrong answer is explained by the mistake that explains most wrong answers of the exercise. A
    number close to the right one may be a mistake's by chance: the mistake has to explain others
    too, and most of those that it changes. Rounding explains errors of its own size.

    Parameters
    ----------
    variant : Variant
        The exercise.
    answers : mapping of str to str
        The answers as written, by question; a question without one has no points.

    """
    questions = variant.kind.questions
    readings = {q.name: read_answer(answers.get(q.name, ''), q) for q in questions}
    fitting: dict[str, dict[str, int]] = {}
    for question in questions:
        answer = readings[question.name]
        if answer is not None and not variant.is_right(question, answer):
            fitting[question.name] = _fitting(variant, question, answer)
    # A word is easily a mistake's by chance.
    numbers = {name for name in readings if isinstance(readings[name], float)}
    weights = Counter(mistake for name in numbers & {*fitting} for mistake in fitting[name])
    proven = set()
    for mistake, weight in weights.items():
        changed = numbers & {*variant.mistaken[mistake]}
        is_most = weight >= 2 and 2 * weight > len(changed)
        if is_most or _changes_only_a_count(variant, mistake):
            proven.add(mistake)
    marks: list[Mark] = []
    for question in questions:
        text = answers.get(question.name, '').strip()
        answer = readings[question.name]
        slip, points = RIGHT, 1.0
        if answer is None:
            slip, points = UNREADABLE if text else EMPTY, 0.0
        elif question.name in fitting:
            # The first of equal ones, in the order of the mistakes.
            ranks = {
                mistake: (mistake not in proven, -weights[mistake], distance)
                for mistake, distance in fitting[question.name].items()
            }
            mistake = min(ranks, key=lambda mistake: ranks[mistake], default=WRONG)
            slip, points = explain(variant, question, answer, mistake, mistake in proven)
        marks.append(Mark(question.name, text, points, slip))
    for place, answer_mark in enumerate(marks):
        names = sources(variant.kind.name)[answer_mark.question]
        slips = {source.slip for source in marks if source.question in names}
        if 0.0 < answer_mark.points < 1.0 and answer_mark.slip in slips:
            points = max(answer_mark.points, credit_of('carried'))
            marks[place] = answer_mark._replace(points=points, carried=True)
    return marks


def explain(
    variant: Variant, question: Question, answer: Answer, mistake: str, is_proven: bool = False
) -> tuple[str, float]:
    """Return the slip that explains a wrong answer, and its points."""
    right = variant.answers[question.name]
    size = 0.0 if isinstance(right, str) else abs(right)
    gap = difference(question, answer, right)
    if isnan(gap):
        return DIMENSION, 0.0
    slip = slip_of(mistake)
    is_rounded = False
    if question.unit != 'count' and gap <= MAX_ROUNDING * size:
        errors = [difference(question, a[question.name], right) for a in variant.dithered]
        reach = ROUNDING_REACH * hypot(*errors) / sqrt(len(errors) or 1)
        is_rounded = slip == ROUNDING or gap <= reach
    if slip == WRONG and is_rounded:
        slip = ROUNDING
    is_far = bool(size) and gap >= CLOSE * size
    if question.unit == 'count':
        is_far = _changes_only_a_count(variant, mistake)
    return slip, credit_of(slip) if is_proven or is_rounded or is_far else 0.0


def _changes_only_a_count(variant: Variant, mistake: str) -> bool:
    """Return whether a mistake shows in a count alone: else a count is one by chance."""
    changed = variant.mistaken.get(mistake, {})
    return [q.unit for q in variant.kind.questions if q.name in changed] == ['count']


def _fitting(variant: Variant, question: Question, answer: Answer) -> dict[str, int]:
    """
    Return the mistakes that give an answer, and their distances from it.

    A distance is in thousandths of the last digit: noise must not decide between equal ones.
    """
    distances = {}
    for mistake, wrong_answers in variant.mistaken.items():
        wrong = wrong_answers.get(question.name)
        if wrong is not None and variant.is_near(question, answer, wrong):
            last_digit = variant.tolerance(question, wrong) or 1.0
            distances[mistake] = round(1e3 * difference(question, answer, wrong) / last_digit)
    return distances


def statistics(class_marks: Marks) -> dict[str, dict[str, float]]:
    """Return for each kind: students, mean part of the points, and answers with each slip."""
    marks_of: dict[str, list[Mark]] = {}
    students: Counter[str] = Counter()
    for (_, kind), marks in class_marks.items():
        marks_of.setdefault(kind, []).extend(marks)
        students[kind] += 1
    counts = {}
    for kind, marks in marks_of.items():
        share = sum(mark.points for mark in marks) / len(marks)
        slips = Counter(mark.slip for mark in marks).most_common()
        counts[kind] = {'students': students[kind], 'part': share, **dict(slips)}
    return counts
