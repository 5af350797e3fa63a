"""Exercises for learning platforms: Moodle XML, PrairieLearn, notebooks for otter-grader."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
import json
import re
from typing import Any, NamedTuple
from uuid import NAMESPACE_URL, uuid5
from xml.etree.ElementTree import Element, SubElement, tostring

from klann_ros.web.markup import element, joined, Markup

from .calculation import data, slip_of, TURN_DEG
from .kinds import KINDS
from .marking import credit_of, mark
from .sheet import answer_text, asked, decimals, picture, problem, question_markup, unit_sign
from .variant import known, make_variant, Question, reason, texts, Variant

Files = dict[str, bytes]
# Answers of a Moodle question at most; marks that end a part of a Cloze field.
MAX_ALTERNATIVES = 14
NOT_IN_CLOZE = re.compile(r'[}#~\\]')
NOT_IN_NAMES = re.compile(r'[^A-Za-z0-9-]+')
# The address of package.xml.
INSTALL = '%pip install -q git+https://h-seed-5572db61.example/klann_ros otter-grader'
DOCTEST = """\
>>> from klann_ros.exercises import check
>>> check('{kind}', student, '{question}', {question}, '{language}')
'{right}'
"""


class Alternative(NamedTuple):
    """An answer that Moodle recognises, with its percentage of the points, and what it tells."""

    percent: str
    value: str
    tolerance: str = ''
    reason: str = ''


def moodle(variants: Sequence[Variant], _names: Sequence[str], language: str) -> Files:
    """
    Return two Moodle XML files, each with a category of its own.

    KIND.xml has a Cloze question a student; KIND_parts.xml a numerical question for each quantity,
    which takes convertible units, and multiple choice for a word.
    """
    name = variants[0].kind.name
    whole, parts = Element('quiz'), Element('quiz')
    for quiz, category in ((whole, name), (parts, f'{name}/parts')):
        head = SubElement(quiz, 'question', type='category')
        _text(head, 'category', f'$course$/top/klann_ros/{category}')
    for variant in variants:
        drawing, content = picture(variant), problem(variant, language)
        if drawing:
            image = element('img', src='@@PLUGINFILE@@/linkage.svg', alt='linkage')
            content = Markup(content.replace(drawing, image))
        rows = []
        for question in variant.kind.questions:
            words, digits = question_markup(question, language), asked(variant, question, language)
            answers = _alternatives(variant, question, language)
            sign = unit_sign(question.unit)
            cells = Markup(_cloze(answers)), sign, digits
            rows.append(element('tr', element('th', words), *(element('td', x) for x in cells)))
            text = joined([content, element('p', words, f' {sign and f"[{sign}] "}({digits})')])
            title = f'{name} {variant.student} {question.name}'
            _part(_question(parts, title, text, drawing), question, answers)
        text = joined([content, element('table', *rows)])
        _question(whole, f'{name} {variant.student}', text, drawing).set('type', 'cloze')
    return {
        f'{name}{end}.xml': b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(quiz)
        for end, quiz in (('', whole), ('_parts', parts))
    }


def _text(parent: Element, name: str, text: str, **attributes: str) -> Element:
    added = SubElement(parent, name, attributes)
    SubElement(added, 'text').text = text
    return added


def _question(quiz: Element, name: str, text: str, drawing: str) -> Element:
    """Add a question with its text and drawing, without a type."""
    question = SubElement(quiz, 'question')
    _text(question, 'name', name)
    place = _text(question, 'questiontext', text, format='html')
    if drawing:
        file = SubElement(place, 'file', name='linkage.svg', path='/', encoding='base64')
        file.text = b64encode(drawing.encode()).decode()
    return question


def _part(element_: Element, question: Question, answers: Sequence[Alternative]) -> None:
    """Make a question one of numbers with units, or of choices."""
    element_.set('type', 'multichoice' if question.choices else 'numerical')
    for each in answers:
        text_format = 'html' if question.choices else 'moodle_auto_format'
        answer = _text(element_, 'answer', each.value, fraction=each.percent, format=text_format)
        if not question.choices:
            SubElement(answer, 'tolerance').text = each.tolerance
        _text(answer, 'feedback', escape(each.reason), format='html')
    sign = unit_sign(question.unit)
    if not sign:
        return
    units = SubElement(element_, 'units')
    # Moodle strips spaces from an answer; a multiplier is the number of units in the first one.
    factors = data()['marking']['factors']
    spellings = {sign: 1.0, **factors.get(question.unit, {})}
    names = {name.replace(' ', '').replace('n', 'N'): each for name, each in spellings.items()}
    for name, factor in names.items():
        unit = SubElement(units, 'unit')
        SubElement(unit, 'multiplier').text = f'{1.0 / factor:.15g}'
        SubElement(unit, 'unit_name').text = name


def _alternatives(variant: Variant, question: Question, language: str) -> list[Alternative]:
    """Return the right answers of a question, and the slips as answers of part credit."""
    right = variant.answers[question.name]
    if isinstance(right, str):
        words = texts()['choices']
        return [
            Alternative('100' if each == right else '0', words.get(each, {}).get(language, each))
            for each in question.choices
        ]
    tolerance = variant.tolerance(question)
    places = decimals(tolerance) + 2 if tolerance else 0
    # An angle may be written as a positive or a negative one.
    turns = (0.0, -TURN_DEG if right > 0.0 else TURN_DEG) if question.unit == 'deg' else (0.0,)
    found = [Alternative('100', f'{right + turn:.{places}f}', f'{tolerance:g}') for turn in turns]
    for mistake, wrong in variant.mistaken.items():
        value = wrong.get(question.name)
        if value is None or isinstance(value, str) or abs(value) >= 1e12:
            continue
        near = variant.tolerance(question, value)
        number = f'{value:.{decimals(near) + 2}f}'
        if len(found) < MAX_ALTERNATIVES and number not in {each.value for each in found}:
            credit = 100.0 * credit_of(slip_of(mistake))
            found.append(
                Alternative(f'{credit:.0f}', number, f'{near:g}', reason(mistake, language))
            )
    return found


def _cloze(answers: Sequence[Alternative]) -> str:
    """Return a field of a Cloze question. Moodle decodes the entities of a reason once."""
    kind = 'NUMERICAL' if answers[0].tolerance else 'MULTICHOICE'
    found = []
    for each in answers:
        head = {'100': '=', '0': ''}.get(each.percent, f'%{each.percent}%')
        tolerance = f':{each.tolerance}' if each.tolerance else ''
        words = NOT_IN_CLOZE.sub(lambda found: f'&#{ord(found[0])};', escape(each.reason))
        found.append(f'{head}{each.value}{tolerance}{words and "#"}{escape(words)}')
    return f'{{1:{kind}:{"~".join(found)}}}'


def prairielearn(variants: Sequence[Variant], _names: Sequence[str], language: str) -> Files:
    """Return a PrairieLearn question, whose variants are drawn from PrairieLearn's own seeds."""
    kind = variants[0].kind
    info = {
        'uuid': str(uuid5(NAMESPACE_URL, f'klann_ros/exercises/{kind.name}/{language}')),
        'title': texts()['kinds'][kind.name][language]['title'],
        'topic': 'klann_ros',
        'tags': ['klann_ros', kind.name],
        'type': 'v3',
    }
    lines = (
        element(
            'p',
            element(
                'pl-string-input',
                answers_name=question.name,
                label=str(question_markup(question, language)),
                suffix=unit_sign(question.unit),
            ),
            asked(variants[0], question, language),
        )
        for question in kind.questions
    )
    page = element('pl-question-panel', Markup('{{{params.problem}}}'))
    server = (
        'from klann_ros.exercises import platforms\n\n\n'
        'def generate(data):\n'
        f'    platforms.generate(data, {kind.name!r}, {language!r})\n\n\n'
        'def grade(data):\n'
        f'    platforms.grade(data, {kind.name!r}, {language!r})\n'
    )
    return {
        f'{kind.name}/info.json': f'{json.dumps(info, indent=2, ensure_ascii=False)}\n'.encode(),
        f'{kind.name}/question.html': '\n'.join([page, *lines, '']).encode(),
        f'{kind.name}/server.py': server.encode(),
    }


def generate(data: dict[str, Any], name: str, language: str) -> None:
    """Fill in the variant of a PrairieLearn question, by its seed."""
    variant = make_variant(KINDS[name], str(data['variant_seed']))
    data['params']['problem'] = str(problem(variant, language))
    for question in variant.kind.questions:
        right = answer_text(variant, question, variant.answers[question.name], language)
        data['correct_answers'][question.name] = right


def grade(data: dict[str, Any], name: str, language: str) -> None:
    """Mark the submission of a PrairieLearn question, with reasons."""
    variant = make_variant(KINDS[name], str(data['variant_seed']))
    answers = {key: str(value) for key, value in data['submitted_answers'].items()}
    marks = mark(variant, answers)
    for each in marks:
        score = {'score': each.points, 'weight': 1, 'feedback': each.reason(language)}
        data['partial_scores'][each.question] = score
    data['score'] = sum(each.points for each in marks) / len(marks)


def check(kind: str, student: str, question: str, answer: object, language: str = 'en') -> str:
    """
    Return 'right', or the reason why one answer is wrong.

    Parameters
    ----------
    kind, student, question : str
        The exercise and its question.
    answer : object
        A number in the unit asked for, or a text as `mark` reads it.
    language : str
        'en' or 'pt'.

    Raises
    ------
    ExerciseError
        The kind, the student's number or the question is refused.

    """
    variant = make_variant(known(kind, KINDS, 'kind'), student)
    marks = {each.question: each for each in mark(variant, {question: str(answer)})}
    return str(known(question, marks, f'question of {kind}').reason(language))


def notebooks(variants: Sequence[Variant], _names: Sequence[str], language: str) -> Files:
    """Return a Jupyter notebook a student, and the tests of otter-grader for all of them."""
    kind = variants[0].kind
    right = texts()['marks']['right'][language]
    found: Files = {}
    for question in kind.questions:
        case = DOCTEST.format(
            kind=kind.name, question=question.name, language=language, right=right
        )
        suite = {'cases': [{'code': case, 'hidden': False, 'locked': False}], 'scored': True,
                 'setup': '', 'teardown': '', 'type': 'doctest'}  # fmt: skip
        test = {'name': question.name, 'points': 1, 'suites': [suite]}
        content = f'OK_FORMAT = True\n\ntest = {test!r}\n'
        found[f'{kind.name}/tests/{question.name}.py'] = content.encode()
    for k, variant in enumerate(variants, 1):
        name = NOT_IN_NAMES.sub('', variant.student) or f'student{k}'
        path = f'{kind.name}/{name}.ipynb'
        if path in found:
            path = f'{kind.name}/{name}_{k}.ipynb'
        found[path] = f'{json.dumps(notebook(variant, language), indent=1)}\n'.encode()
    return found


def notebook(variant: Variant, language: str) -> Mapping[str, Any]:
    """Return the notebook of a variant, in nbformat 4.5."""
    words, kind = texts(), variant.kind
    title = f'# {words["kinds"][kind.name][language]["title"]}\n\n'
    cells = [
        ('code', INSTALL),
        ('markdown', f'{title}{problem(variant, language)}'),
        ('code', f'import otter\n\ngrader = otter.Notebook()\nstudent = {variant.student!r}'),
    ]
    for question in kind.questions:
        head = question_markup(question, language)
        unit = unit_sign(question.unit)
        cells += [
            ('markdown', f'**{head}** {unit} ({asked(variant, question, language)})'),
            ('code', f'{question.name} = ...\ngrader.check({question.name!r})'),
        ]
    cells.append(('code', 'grader.check_all()'))
    return {
        'cells': [_cell(k, *cell) for k, cell in enumerate(cells)],
        'metadata': {
            'kernelspec': {'display_name': 'Python 3', 'language': 'python', 'name': 'python3'},
            'language_info': {'name': 'python'},
        },
        'nbformat': 4,
        'nbformat_minor': 5,
    }


def _cell(number: int, kind: str, source: str) -> dict[str, Any]:
    code: dict[str, Any] = {'execution_count': None, 'outputs': []} if kind == 'code' else {}
    return {'cell_type': kind, 'id': f'cell-{number}', 'metadata': {}, 'source': source, **code}
