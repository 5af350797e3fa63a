"""Marking: answers as students write them, points, and the slip that explains a wrong one."""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isnan
import re
from typing import NamedTuple

from klann_ros.sanitize.quantity import folded, MAX_QUANTITY, read_quantity

from .calculation import Answer, data, slip_of
from .variant import difference, Question, texts, Variant

RIGHT, WRONG, EMPTY, UNREADABLE = 'right', 'wrong', 'empty', 'unreadable'
DIMENSION = 'dimension'
# A wrong answer this near (in units of the last digit) was rounded on the way.
ROUNDING_REACH = 30.0


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
        return '; '.join(reason(slip, language) for slip in slips)


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
    return ' '.join(re.sub("[^a-z0-9']+", ' ', folded(text)).replace("'", '').split())


def _is_nan(answer: Answer) -> bool:
    return isinstance(answer, float) and isnan(answer)


def mark(variant: Variant, answers: Mapping[str, str]) -> list[Mark]:
    """
    Return the marks of a student's answers, in the order of the questions.

    A wrong answer is explained by the mistake that explains most wrong answers of the exercise.

    Parameters
    ----------
    variant : Variant
        The exercise.
    answers : mapping of str to str
        The answers as written, by question; a question without one has no points.

    """
    questions = variant.kind.questions
    read_answers: dict[str, Answer | None] = {}
    fitting: dict[str, dict[str, int]] = {}
    for question in questions:
        name = question.name
        answer = read_answers[name] = read_answer(answers.get(name, ''), question)
        if answer is None or _is_nan(answer):
            continue
        if not variant.is_right(question, answer):
            fitting[name] = _fitting(variant, question, answer)
    weights = Counter(mistake for mistakes in fitting.values() for mistake in mistakes)
    marks: list[Mark] = []
    for question in questions:
        text = answers.get(question.name, '').strip()
        answer = read_answers[question.name]
        if answer is None:
            slip = UNREADABLE if text else EMPTY
        elif _is_nan(answer):
            slip = DIMENSION
        elif question.name in fitting:
            distances = fitting[question.name]
            # The first of equal ones, in the order of the mistakes.
            ranks = {mistake: (-weights[mistake], distances[mistake]) for mistake in distances}
            slip = slip_of(min(ranks, key=lambda mistake: ranks[mistake]))
        else:
            slip = RIGHT
        is_carried = slip in texts()['slips'] and any(mark.slip == slip for mark in marks)
        points = credit_of(slip)
        if is_carried:
            points = max(points, credit_of('carried'))
        marks.append(Mark(question.name, text, points, slip, is_carried))
    return marks


def _fitting(variant: Variant, question: Question, answer: Answer) -> dict[str, int]:
    """
    Return the mistakes that give an answer, and their distances from it; else rounding or WRONG.

    A distance is in thousandths of the last digit: noise must not decide between equal ones.
    """
    distances = {}
    for mistake, wrong_answers in variant.mistaken.items():
        wrong = wrong_answers.get(question.name)
        if wrong is not None and variant.is_near(question, answer, wrong):
            last_digit = variant.tolerance(question, wrong) or 1.0
            distances[mistake] = round(1e3 * difference(question, answer, wrong) / last_digit)
    if distances:
        return distances
    reach = ROUNDING_REACH * variant.tolerance(question)
    is_near = difference(question, answer, variant.answers[question.name]) <= reach
    return {'rounding' if is_near else WRONG: 0}


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
