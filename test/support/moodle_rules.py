"""
The rules by which Moodle 4 imports questions and marks answers, as its sources state them.

qformat_xml (question/format/xml/format.php), qtype_multianswer_extract_question and
qtype_multianswer_validate_question (question/type/multianswer), qtype_numerical.
"""

from base64 import b64decode
from html import unescape
import re
from typing import NamedTuple
from xml.etree import ElementTree as ET

# Fractions of a mark that a question may give; others are refused at import.
FRACTIONS = {1, 0.9, 0.8333333, 0.8, 0.75, 0.7, 0.6666667, 0.6, 0.5, 0.4, 0.3333333, 0.3, 0.25,
             0.2, 0.1666667, 0.1428571, 0.125, 0.1111111, 0.1, 0.05, 0}  # fmt: skip
NUMBER = r'-?(?:(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)'
ANSWER = r'(=|%(-?[0-9]+(?:[.,][0-9]+)?)%)?(.+?(?<!\\|&)(?=[~#}]|$))(#(.*?(?<!\\)(?=[~}]|$)))?'
FIELD = re.compile(rf'\{{([0-9]*):(NUMERICAL|MULTICHOICE):({ANSWER}(~{ANSWER})*)\}}', re.DOTALL)
SPACES = re.compile(r'\s+')


class MoodleAnswer(NamedTuple):
    """An answer that Moodle knows: its fraction of the mark, and what it tells (HTML)."""

    fraction: float
    text: str
    tolerance: float
    feedback: str


class MoodleQuestion(NamedTuple):
    """A question, or a field of a Cloze question."""

    name: str
    kind: str
    text: str
    answers: list[MoodleAnswer]
    units: dict[str, float]
    files: dict[str, bytes]
    parts: list['MoodleQuestion']

    def marked(self, response: str) -> MoodleAnswer | None:
        """Return the answer that a response is taken for."""
        if self.kind == 'multichoice':
            return next((answer for answer in self.answers if answer.text == response), None)
        response = SPACES.sub('', response).replace(',', '.')
        number = re.match(r'[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[-+]?\d+)?', response)
        if not number:
            return None
        as_written = float(number[0])
        in_unit = as_written / self.units.get(response.removeprefix(number[0]), 1.0)
        for answer in self.answers:
            key = float(answer.text)
            tolerance = answer.tolerance + 1e-14 * max(1.0, abs(key))
            if min(abs(in_unit - key), abs(as_written - key)) <= tolerance:
                return answer
        return None


def imported(content: bytes) -> tuple[str, list[MoodleQuestion]]:
    """Return the category and the questions of a file; a ValueError if Moodle refuses one."""
    category = ''
    questions = []
    for element in ET.fromstring(content):  # noqa: S314 - our own
        if element.get('type') == 'category':
            category = _text(element, 'category')
            continue
        question = _question(element)
        for part in question.parts or [question]:
            _check(part)
        questions.append(question)
    return category, questions


def _text(element: ET.Element, path: str) -> str:
    text = element.find(f'{path}/text')
    if text is None or len(text):
        raise ValueError(f'{path} is no text')
    return (text.text or '').strip()


def _question(element: ET.Element) -> MoodleQuestion:
    kind = element.get('type') or ''
    text = _text(element, 'questiontext')
    files = {}
    for file in element.findall('questiontext/file'):
        files[f'{file.get("path")}{file.get("name")}'] = b64decode(file.text or '', validate=True)
    fields = [*map(_field, FIELD.finditer(text))] if kind == 'cloze' else []
    answers = []
    for answer in element.findall('answer') if kind != 'cloze' else ():
        fraction = float(answer.get('fraction') or 0.0) / 100.0
        tolerance = float(answer.findtext('tolerance') or 0.0)
        feedback = _text(answer, 'feedback')
        answers.append(MoodleAnswer(fraction, _text(answer, '.'), tolerance, feedback))
    units = {}
    for unit in element.findall('units/unit') if kind != 'cloze' else ():
        units[unit.findtext('unit_name') or ''] = float(unit.findtext('multiplier') or 0.0)
    name = _text(element, 'name')
    return MoodleQuestion(name, kind, FIELD.sub('', text), answers, units, files, fields)


def _field(match: re.Match[str]) -> MoodleQuestion:
    kind = match[2].lower()
    answers = []
    unread = match[3]
    while answer := re.match(rf'~?{ANSWER}', unread, re.DOTALL):
        unread = unread.removeprefix(answer[0])
        percent = 100.0 if answer[1] == '=' else float((answer[2] or '0').replace(',', '.'))
        text = unescape(answer[3])
        tolerance = 0.0
        if kind == 'numerical':
            number = re.fullmatch(rf'({NUMBER})(?::({NUMBER}))?', answer[3])
            if not number:
                raise ValueError(f'{answer[3]} is no number')
            text = number[1]
            tolerance = float(number[2] or 0.0)
        feedback = unescape(answer[5] or '').replace('\\}', '}').replace('\\#', '#')
        answers.append(MoodleAnswer(percent / 100.0, text, tolerance, feedback))
    if unread:
        raise ValueError(f'{unread} is no answer')
    return MoodleQuestion('', kind, '', answers, {}, {}, [])


def _check(question: MoodleQuestion) -> None:
    if question.kind not in ('numerical', 'multichoice'):
        raise ValueError(f'{question.name} has no field')
    if not any(abs(answer.fraction - 1.0) < 1e-6 for answer in question.answers):
        raise ValueError(f'{question.name} has no right answer')
    if question.kind == 'multichoice' and len(question.answers) < 2:
        raise ValueError(f'{question.name} has no choice')
    for answer in question.answers:
        if min(abs(answer.fraction - fraction) for fraction in FRACTIONS) > 1e-5:
            raise ValueError(f'{answer.fraction} is no fraction of Moodle')
        if question.kind == 'numerical' and not re.fullmatch(NUMBER, answer.text):
            raise ValueError(f'{answer.text} is no number')
