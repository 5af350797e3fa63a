"""Marking: answers as students write them, points, and the slip that explains a wrong one."""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite, nan
import re
from typing import NamedTuple
import unicodedata

from .calculation import Answer, data, slip_of
from .variant import difference, Question, texts, Variant

RIGHT, WRONG, EMPTY, UNREADABLE = 'right', 'wrong', 'empty', 'unreadable'
# A wrong answer this near (in units of the last digit) was rounded on the way.
ROUNDING_REACH = 30.0
# Longest answer [characters].
MAX_ANSWER = 64
# Sign, number (a space may stand before three digits), denominator, power of ten, unit.
NUMBER = re.compile(
    r'([+-]?) ?((?:\d(?:[\d.,]| (?=\d{3}(?!\d)))*|[.,]\d+)) ?(?:/ ?(\d+) ?)?'
    r'(?:(?:e|[x*·×] ?10 ?(?:\^|\*\*)?) ?\(?([+-]?\d{1,3})\)?)? ?(.*)',
    re.ASCII,
)
# Thousands in groups, the decimal separator another one.
GROUPED = re.compile(r'([1-9]\d{0,2}([ .,])\d{3}(?:\2\d{3})*)(?:(?!\2)([.,]\d*))?', re.ASCII)
# Degrees, minutes and seconds of arc.
SEXAGESIMAL = re.compile(
    r"""(\d+) ?[°º] ?([0-5]?\d(?:[.,]\d+)?) ?'(?: ?([0-5]?\d(?:[.,]\d+)?) ?(?:"|''))?""", re.ASCII
)
# Minus sign and en dash, typographic quotes and primes.
TYPED = str.maketrans('\u2212\u2013\u2019\u2032\u201d\u2033', '--\'\'""')
SUPERSCRIPT = re.compile('10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)')
EXPONENTS = str.maketrans('⁰¹²³⁴⁵⁶⁷⁸⁹⁻', '0123456789-')


class Mark(NamedTuple):
    """
    The mark of an answer as written: 0 to 1 points, and the slip that explains it.

    The slip is 'right', 'wrong', 'empty', 'unreadable', or one such as 'radians'; it is carried
    where it follows from the same slip in an earlier answer.
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

    A decimal comma, grouped thousands, a true minus, a fraction, a power of ten, minutes of arc,
    and the unit or a convertible one are legal.
    """
    text = SUPERSCRIPT.sub(lambda match: f'10^{match[1].translate(EXPONENTS)}', text)
    text = ' '.join(text.translate(TYPED).split())
    if not text or len(text) > MAX_ANSWER:
        return None
    if question.choices:
        return _choice(text, question)
    match = NUMBER.fullmatch(SEXAGESIMAL.sub(_degrees, text.casefold()))
    if not match:
        return None
    sign, digits, denominator, exponent, unit = match.groups()
    try:
        number = float(f'{sign}{_decimal(digits)}e{exponent or 0}') / float(denominator or 1)
    except (ValueError, ZeroDivisionError):
        return None
    number *= _factor(unit, question.unit)
    return number if isfinite(number) else None


def _factor(unit: str, asked: str) -> float:
    units = data()['marking']
    spelling = units['spellings'].get(unit, unit).replace('°', 'deg').replace('º', 'deg')
    unit = ' '.join(spelling.split())
    return float(units['factors'].get(asked, {}).get(unit, nan)) if unit else 1.0


def _degrees(match: re.Match[str]) -> str:
    """Return degrees, minutes and seconds as decimal degrees."""
    numbers = [text.replace(',', '.') for text in match.groups(default='0')]
    whole, minutes, seconds = map(float, numbers)
    return f'{whole + minutes / 60.0 + seconds / 3600.0} deg'


def _decimal(number: str) -> str:
    """Return a number with a decimal point and without the separators of thousands."""
    if re.search('[., ].*[., ]| ', number):
        groups = GROUPED.fullmatch(number)
        if not groups:
            raise ValueError(number)
        number = re.sub('[., ]', '', groups[1]) + (groups[3] or '')
    return number.replace(',', '.')


def _choice(text: str, question: Question) -> str | None:
    answer = _plain(text).removeprefix('class ').removeprefix('classe ')
    words = texts()['choices']
    for number, choice in enumerate(question.choices, 1):
        names = {_plain(name) for name in (choice, *words.get(choice, {}).values())}
        is_number = choice not in words and answer == str(number)
        if answer in names or is_number:
            return choice
    return None


def _plain(text: str) -> str:
    decomposed = unicodedata.normalize('NFD', text.casefold()).replace('-', ' ')
    return ''.join(c for c in decomposed if not unicodedata.combining(c))


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
        if answer is not None and not variant.is_right(question, answer):
            fitting[name] = _fitting(variant, question, answer)
    weights = Counter(mistake for mistakes in fitting.values() for mistake in mistakes)
    marks: list[Mark] = []
    for question in questions:
        text = answers.get(question.name, '').strip()
        if read_answers[question.name] is None:
            slip = UNREADABLE if text else EMPTY
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
