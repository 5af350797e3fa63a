"""Exercises for learning platforms: Moodle XML, PrairieLearn, notebooks for otter-grader."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
import json
import re
from typing import Any
from uuid import NAMESPACE_URL, uuid5
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.web.markup import element, joined, Markup

from .calculation import slip_of, TURN_DEG
from .kinds import KINDS
from .marking import DEFAULT_CREDIT, mark, SLIP_CREDIT
from .sheet import answer_text, asked, decimals, picture, problem, question_markup, UNIT_SIGNS
from .variant import known, make_variant, Question, reason, texts, Variant

Files = dict[str, bytes]
# Answers with feedback of a Cloze field at most.
MAX_ALTERNATIVES = 12
CLOZE_ESCAPES = re.compile(r'([}#~/"\\])')
NOT_IN_NAMES = re.compile(r'[^A-Za-z0-9-]+')
# The address of package.xml.
INSTALL = '%pip install -q git+https://h-seed-5572db61.example/klann_ros otter-grader'
DOCTEST = """\
>>> from klann_ros.exercises import check
>>> check('{kind}', student, '{question}', {question}, '{language}')
'{right}'
"""


def moodle(variants: Sequence[Variant], _names: Sequence[str], language: str) -> Files:
    """Return a Moodle XML file: a category of the kind, and a Cloze question a student."""
    kind = variants[0].kind
    quiz = Element('quiz')
    category = SubElement(quiz, 'question', type='category')
    _text(SubElement(category, 'category'), f'$course$/top/klann_ros/{kind.name}')
    for variant in variants:
        question = SubElement(quiz, 'question', type='cloze')
        _text(SubElement(question, 'name'), f'{kind.name} {variant.student}')
        text = SubElement(question, 'questiontext', format='html')
        drawing = picture(variant)
        content = problem(variant, language)
        if drawing:
            image = element('img', src='@@PLUGINFILE@@/linkage.svg', alt='linkage')
            content = Markup(content.replace(drawing, image.replace('</img>', '')))
        fields = (
            element(
                'tr',
                element('th', question_markup(each, language)),
                element('td', Markup(_cloze(variant, each, language))),
                element('td', UNIT_SIGNS.get(each.unit, each.unit)),
                element('td', asked(variant, each, language)),
            )
            for each in kind.questions
        )
        _text(text, joined([content, element('table', *fields)]))
        if drawing:
            place = {'name': 'linkage.svg', 'path': '/', 'encoding': 'base64'}
            SubElement(text, 'file', place).text = b64encode(drawing.encode()).decode()
    indent(quiz)
    return {f'{kind.name}.xml': b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(quiz)}


def _text(parent: Element, text: str) -> None:
    SubElement(parent, 'text').text = text


def _cloze(variant: Variant, question: Question, language: str) -> str:
    """Return a field of a Cloze question, with the slips as answers of part credit."""
    right = variant.answers[question.name]
    if isinstance(right, str):
        words = texts()['choices']
        names = [words.get(each, {}).get(language, each) for each in question.choices]
        pairs = zip(names, question.choices, strict=True)
        choices = '~'.join(f'={name}' if each == right else name for name, each in pairs)
        return f'{{1:MULTICHOICE:{choices}}}'
    tolerance = variant.tolerance(question)
    places = decimals(tolerance) + 2 if tolerance else 0
    turns = (0.0, -TURN_DEG) if question.unit == 'deg' else (0.0,)
    found = [f'={right + turn:.{places}f}:{tolerance:g}' for turn in turns]
    seen: set[str] = set()
    for mistake, wrong in variant.mistaken.items():
        value = wrong.get(question.name)
        if value is None or isinstance(value, str) or abs(value) >= 1e12:
            continue
        near = variant.tolerance(question, value)
        slip, number = slip_of(mistake), f'{value:.{decimals(near) + 2}f}'
        if number in seen or len(seen) == MAX_ALTERNATIVES:
            continue
        seen.add(number)
        credit = 100.0 * SLIP_CREDIT.get(slip, DEFAULT_CREDIT)
        words = CLOZE_ESCAPES.sub(r'\\\1', reason(mistake, language))
        found.append(f'%{credit:.0f}%{number}:{near:g}#{words}')
    return f'{{1:NUMERICAL:{"~".join(found)}}}'


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
                suffix=UNIT_SIGNS.get(question.unit, question.unit),
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
        unit = UNIT_SIGNS.get(question.unit, question.unit)
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
