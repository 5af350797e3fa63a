"""Exercises for learning platforms: Moodle XML, PrairieLearn, notebooks for otter-grader."""

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from html import escape
import json
from pathlib import Path
import re
from string import Template
from typing import Any, NamedTuple
from uuid import NAMESPACE_URL, uuid5

from klann_ros.sanitize.yaml_text import parse_file
from klann_ros.web import element, joined, Markup, table_row

from .calculation import data, slip_of, TURN_DEG
from .kinds import KINDS
from .marking import credit_of, mark, reason
from .sheet import answer_text, asked, decimals, picture, problem, question_markup, unit_sign
from .variant import known, make_variant, Question, texts, Variant

# Paths within a folder, and their contents.
Files = dict[str, bytes]
# Answers of a Moodle question at most; marks that end a part of a Cloze field.
MAX_ALTERNATIVES = 14
NOT_IN_CLOZE = re.compile(r'[}#~\\]')
NOT_IN_NAMES = re.compile(r'[^A-Za-z0-9-]+')


@cache
def _templates() -> dict[str, Any]:
    found: dict[str, Any] = parse_file(Path(__file__).parent / 'static' / 'platforms.yaml')
    return found


def _filled(template: str, **values: str) -> str:
    return Template(_templates()[template]).substitute(values)


class Alternative(NamedTuple):
    """An answer that Moodle recognises, with its percentage of the points, and what it tells."""

    percent: str
    value: str
    tolerance: str = ''
    reason: str = ''


def moodle(variants: Sequence[Variant], language: str) -> Files:
    """
    Return two Moodle XML files, each with a category of its own.

    KIND.xml has a Cloze question a student; KIND_parts.xml a numerical question for each quantity,
    which takes convertible units, and multiple choice for a word.
    """
    name = variants[0].kind.name
    quizzes: dict[str, list[str]] = {name: [], f'{name}/parts': []}
    whole, parts = quizzes.values()
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
            rows.append(table_row(words, Markup(cloze_field(answers)), sign, digits))
            text = joined([content, element('p', words, f' {sign and f"[{sign}] "}({digits})')])
            kind = 'multichoice' if question.choices else 'numerical'
            title = f'{name} {variant.student} {question.name}'
            parts.append(moodle_question(kind, title, text, drawing, _marked(question, answers)))
        text = joined([content, element('table', *rows)])
        whole.append(moodle_question('cloze', f'{name} {variant.student}', text, drawing))
    return {
        f'{category.replace("/", "_")}.xml': _filled(
            'moodle_quiz', category=category, questions=''.join(questions)
        )
        .rstrip()
        .encode('ascii', 'xmlcharrefreplace')
        for category, questions in quizzes.items()
    }


def moodle_question(kind: str, name: str, text: str, drawing: str = '', answers: str = '') -> str:
    """Return a question of a Moodle quiz; name and text are escaped."""
    encoded = b64encode(drawing.encode()).decode()
    file = _filled('moodle_drawing', drawing=encoded) if drawing else ''
    name, text = (escape(each, quote=False) for each in (name, text))
    return _filled('moodle_question', type=kind, name=name, text=text, file=file, answers=answers)


def _marked(question: Question, answers: Sequence[Alternative]) -> str:
    """Return the answers of a question of numbers with units, or of choices."""
    template = 'moodle_choice' if question.choices else 'moodle_number'
    # The reason is HTML within XML.
    found = [
        _filled(template, **each._replace(reason=escape(escape(each.reason)))._asdict())
        for each in answers
    ]
    if sign := unit_sign(question.unit):
        # Moodle strips spaces from an answer; a multiplier is the number of units in the first.
        spellings = {sign: 1.0, **data()['marking']['factors'].get(question.unit, {})}
        names = {name.replace(' ', '').replace('n', 'N'): each for name, each in spellings.items()}
        units = (
            _filled('moodle_unit', multiplier=f'{1.0 / factor:.15g}', name=name)
            for name, factor in names.items()
        )
        found.append(f'<units>{"".join(units)}</units>')
    return ''.join(found)


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
            credit = f'{100.0 * credit_of(slip_of(mistake)):.0f}'
            found.append(
                Alternative(credit, number, f'{near:g}', reason(slip_of(mistake), language))
            )
    return found


def cloze_field(answers: Sequence[Alternative]) -> str:
    """Return a field of a Cloze question. Moodle decodes the entities of a reason once."""
    kind = 'NUMERICAL' if answers[0].tolerance else 'MULTICHOICE'
    found = []
    for each in answers:
        head = {'100': '=', '0': ''}.get(each.percent, f'%{each.percent}%')
        tolerance = f':{each.tolerance}' if each.tolerance else ''
        words = NOT_IN_CLOZE.sub(lambda found: f'&#{ord(found[0])};', escape(each.reason))
        found.append(f'{head}{each.value}{tolerance}{words and "#"}{escape(words)}')
    return f'{{1:{kind}:{"~".join(found)}}}'


def prairielearn(variants: Sequence[Variant], language: str) -> Files:
    """Return a PrairieLearn question, whose variants are drawn from PrairieLearn's own seeds."""
    kind = variants[0].kind
    title = texts()['kinds'][kind.name][language]['title']
    identity = str(uuid5(NAMESPACE_URL, f'klann_ros/exercises/{kind.name}/{language}'))
    page = [element('pl-question-panel', Markup('{{{params.problem}}}'))]
    for question in kind.questions:
        label, suffix = str(question_markup(question, language)), unit_sign(question.unit)
        field = element('pl-string-input', answers_name=question.name, label=label, suffix=suffix)
        page.append(element('p', field, asked(variants[0], question, language)))
    files = {
        'info.json': _filled('prairielearn_info', uuid=identity, title=title, kind=kind.name),
        'question.html': '\n'.join([*page, '']),
        'server.py': _filled('prairielearn_server', kind=kind.name, language=language),
    }
    return {f'{kind.name}/{name}': content.encode() for name, content in files.items()}


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


def notebooks(variants: Sequence[Variant], language: str) -> Files:
    """Return a Jupyter notebook a student, and the tests of otter-grader for all of them."""
    kind, right = variants[0].kind, texts()['marks']['right'][language]
    words = {'kind': kind.name, 'language': language, 'right': right}
    found: Files = {
        f'{kind.name}/tests/{question.name}.py': _filled(
            'otter_test', question=question.name, **words
        ).encode()
        for question in kind.questions
    }
    taken: set[str] = set()
    for k, variant in enumerate(variants, 1):
        name = NOT_IN_NAMES.sub('', variant.student) or f'student{k}'
        # Small and capital letters are the same name to some file systems.
        path = f'{kind.name}/{name}{f"_{k}" if name.casefold() in taken else ""}.ipynb'
        taken.add(name.casefold())
        found[path] = f'{json.dumps(notebook(variant, language), indent=1)}\n'.encode()
    return found


def notebook(variant: Variant, language: str) -> Mapping[str, Any]:
    """Return the notebook of a variant, in nbformat 4.5."""
    cells = [_cell(k, *cell) for k, cell in enumerate(_cells(variant, language))]
    return {**_templates()['notebook'], 'cells': cells}


def _cells(variant: Variant, language: str) -> Iterator[tuple[str, str]]:
    title = texts()['kinds'][variant.kind.name][language]['title']
    yield 'code', _filled('notebook_install')
    yield 'markdown', _filled('notebook_task', title=title, problem=problem(variant, language))
    yield 'code', _filled('notebook_start', student=repr(variant.student))
    for question in variant.kind.questions:
        words, unit = question_markup(question, language), unit_sign(question.unit)
        digits = asked(variant, question, language)
        yield 'markdown', _filled('notebook_question', words=words, unit=unit, asked=digits)
        yield 'code', _filled('notebook_answer', question=question.name)
    yield 'code', _filled('notebook_end')


def _cell(number: int, kind: str, source: str) -> dict[str, Any]:
    code: dict[str, Any] = {'execution_count': None, 'outputs': []} if kind == 'code' else {}
    return {'cell_type': kind, 'id': f'cell-{number}', 'metadata': {}, 'source': source, **code}
