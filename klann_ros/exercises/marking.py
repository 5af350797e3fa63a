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
    text = SUPERSCRIPT.sub(lambda found: f'10^{found[1].translate(EXPONENTS)}', text)
    text = ' '.join(text.translate(TYPED).split())
    if not text or len(text) > MAX_ANSWER:
        return None
    if question.choices:
        return _choice(text, question)
    found = NUMBER.fullmatch(SEXAGESIMAL.sub(_degrees, text.casefold()))
    if not found:
        return None
    sign, number, denominator, exponent, unit = found.groups()
    try:
        value = float(f'{sign}{_decimal(number)}e{exponent or 0}') / float(denominator or 1)
    except (ValueError, ZeroDivisionError):
        return None
    value *= _factor(unit, question.unit)
    return value if isfinite(value) else None


def _factor(unit: str, asked: str) -> float:
    table = data()['marking']
    unit = ' '.join(
        table['spellings'].get(unit, unit).replace('°', 'deg').replace('º', 'deg').split()
    )
    return float(table['factors'].get(asked, {}).get(unit, nan)) if unit else 1.0


def _degrees(found: re.Match[str]) -> str:
    """Return degrees, minutes and seconds as decimal degrees."""
    whole, minutes, seconds = (float(part.replace(',', '.')) for part in found.groups(default='0'))
    return f'{whole + minutes / 60.0 + seconds / 3600.0} deg'


def _decimal(number: str) -> str:
    """Return a number with a decimal point and without the separators of thousands."""
    if re.search('[., ].*[., ]| ', number):
        found = GROUPED.fullmatch(number)
        if not found:
            raise ValueError(number)
        number = re.sub('[., ]', '', found[1]) + (found[3] or '')
    return number.replace(',', '.')


def _choice(text: str, question: Question) -> str | None:
    folded = _plain(text).removeprefix('class ').removeprefix('classe ')
    words = texts()['choices']
    for k, choice in enumerate(question.choices, 1):
        names = {choice, *words.get(choice, {}).values()}
        if folded in {_plain(name) for name in names} or (
            choice not in words and folded == str(k)
        ):
            return choice
    return None


def _plain(text: str) -> str:
    folded = unicodedata.normalize('NFD', text.casefold()).replace('-', ' ')
    return ''.join(c for c in folded if not unicodedata.combining(c))


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
    read = {each.name: read_answer(answers.get(each.name, ''), each) for each in questions}
    fitting = {
        question.name: _fitting(variant, question, value)
        for question in questions
        if (value := read[question.name]) is not None and not variant.is_right(question, value)
    }
    weights = Counter(mistake for mistakes in fitting.values() for mistake in mistakes)
    marks: list[Mark] = []
    for question in questions:
        text, value = answers.get(question.name, '').strip(), read[question.name]
        if value is None:
            slip = UNREADABLE if text else EMPTY
        elif question.name in fitting:
            fits = fitting[question.name]
            # The first of equal ones, in the order of the mistakes.
            slip = slip_of(min(fits, key=lambda each: (-weights[each], fits[each])))
        else:
            slip = RIGHT
        carried = slip in texts()['slips'] and any(each.slip == slip for each in marks)
        points = max(credit_of(slip), credit_of('carried')) if carried else credit_of(slip)
        marks.append(Mark(question.name, text, points, slip, carried))
    return marks


def _fitting(variant: Variant, question: Question, answer: Answer) -> dict[str, int]:
    """
    Return the mistakes that give an answer, and their distances from it; else rounding or WRONG.

    A distance is in thousandths of the last digit: noise must not decide between equal ones.
    """
    values = {mistake: wrong.get(question.name) for mistake, wrong in variant.mistaken.items()}
    found = {
        mistake: round(
            1e3 * difference(question, answer, value) / (variant.tolerance(question, value) or 1.0)
        )
        for mistake, value in values.items()
        if value is not None and variant.is_near(question, answer, value)
    }
    reach = ROUNDING_REACH * variant.tolerance(question)
    is_near = difference(question, answer, variant.answers[question.name]) <= reach
    return found or {'rounding' if is_near else WRONG: 0}


def statistics(marked: Marks) -> dict[str, dict[str, float]]:
    """Return for each kind: students, mean part of the points, and answers with each slip."""
    found = {}
    for kind in dict.fromkeys(kind for _, kind in marked):
        exercises = [marks for (_, own), marks in marked.items() if own == kind]
        marks = [mark for each in exercises for mark in each]
        part = sum(mark.points for mark in marks) / len(marks)
        slips = Counter(mark.slip for mark in marks).most_common()
        found[kind] = {'students': len(exercises), 'part': part, **dict(slips)}
    return found
