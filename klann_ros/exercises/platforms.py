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

from klann_ros import __version__
from klann_ros.sanitize.quantity import conversion_factor
from klann_ros.sanitize.yaml_text import parse_file
from klann_ros.web import element, joined, Markup, table_row

from .calculation import data, TURN_DEG
from .kinds import KINDS
from .marking import explain, Mark, mark
from .sheet import answer_text, asked, decimals, picture, problem, question_markup, unit_sign
from .variant import look_up, make_variant, Question, texts, Variant

# Paths within a folder, and their contents.
Files = dict[str, bytes]
# Answers of a Moodle question at most; marks that end a part of a Cloze field.
MAX_ALTERNATIVES = 14
NOT_IN_CLOZE = re.compile(r'[}#~\\]')
# Names of devices, which are no files in Windows, whatever their ending.
DEVICES = (
    'con',
    'prn',
    'aux',
    'nul',
    *(f'{port}{n}' for port in ('com', 'lpt') for n in range(10)),
)
NOT_IN_NAMES = re.compile(r'[^A-Za-z0-9-]+')


@cache
def _templates() -> dict[str, Any]:
    content: dict[str, Any] = parse_file(Path(__file__).parent / 'static' / 'platforms.yaml')
    return content


def _filled(template: str, **words: str) -> str:
    return Template(_templates()[template]).substitute(words)


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
    kind = variants[0].kind.name
    cloze_questions = []
    part_questions = []
    for variant in variants:
        drawing = picture(variant)
        content = problem(variant, language)
        if drawing:
            image = element('img', src='@@PLUGINFILE@@/linkage.svg', alt='linkage')
            content = Markup(content.replace(drawing, image))
        fields = []
        for question in variant.kind.questions:
            words = question_markup(question, language)
            digits = asked(variant, question, language)
            answers = _alternatives(variant, question, language)
            sign = unit_sign(question.unit)
            fields.append(table_row(words, Markup(cloze_field(answers)), sign, digits))
            text = joined([content, element('p', words, f' {sign and f"[{sign}] "}({digits})')])
            sort = 'multichoice' if question.choices else 'numerical'
            title = f'{kind} {variant.student} {question.name}'
            marked = _marked(question, answers)
            part_questions.append(moodle_question(sort, title, text, drawing, marked))
        text = joined([content, element('table', *fields)])
        title = f'{kind} {variant.student}'
        cloze_questions.append(moodle_question('cloze', title, text, drawing))
    return {
        f'{kind}.xml': _moodle_quiz(kind, cloze_questions),
        f'{kind}_parts.xml': _moodle_quiz(f'{kind}/parts', part_questions),
    }


def _moodle_quiz(category: str, questions: Sequence[str]) -> bytes:
    quiz = _filled('moodle_quiz', category=category, questions=''.join(questions))
    return quiz.rstrip().encode('ascii', 'xmlcharrefreplace')


def moodle_question(kind: str, name: str, text: str, drawing: str = '', answers: str = '') -> str:
    """Return a question of a Moodle quiz; name and text are escaped."""
    encoded = b64encode(drawing.encode()).decode()
    file = _filled('moodle_drawing', drawing=encoded) if drawing else ''
    return _filled(
        'moodle_question',
        type=kind,
        name=escape(name, quote=False),
        text=escape(text, quote=False),
        file=file,
        answers=answers,
    )


def _marked(question: Question, answers: Sequence[Alternative]) -> str:
    """Return the answers of a question of numbers with units, or of choices."""
    template = 'moodle_choice' if question.choices else 'moodle_number'
    elements = []
    for answer in answers:
        # The reason is HTML within XML.
        escaped = answer._replace(reason=escape(escape(answer.reason)))
        elements.append(_filled(template, **escaped._asdict()))
    if sign := unit_sign(question.unit):
        # Moodle strips spaces from an answer; a multiplier is the number of units in the first.
        factors = {sign: 1.0}
        for name in data()['marking']['moodle-units'].get(question.unit, '').split():
            factors[name] = conversion_factor(name, question.unit) or 1.0
        units = [
            _filled('moodle_unit', multiplier=f'{1.0 / factor:.15g}', name=name)
            for name, factor in factors.items()
        ]
        elements.append(f'<units>{"".join(units)}</units>')
    return ''.join(elements)


def _alternatives(variant: Variant, question: Question, language: str) -> list[Alternative]:
    """Return the right answers of a question, and the slips as answers of part credit."""
    right = variant.answers[question.name]
    if isinstance(right, str):
        words = texts()['choices']
        choices = []
        for choice in question.choices:
            percent = '100' if choice == right else '0'
            choices.append(Alternative(percent, words.get(choice, {}).get(language, choice)))
        return choices
    tolerance = variant.tolerance(question)
    places = decimals(tolerance) + 2 if tolerance else 0
    numbers = [right]
    if question.unit == 'deg':
        # An angle may be written as a positive or a negative one.
        numbers.append(right - TURN_DEG if right > 0.0 else right + TURN_DEG)
    alternatives = [
        Alternative('100', f'{number:.{places}f}', f'{tolerance:g}') for number in numbers
    ]
    right_texts = {alternative.value for alternative in alternatives}
    slips: dict[str, tuple[float, Alternative]] = {}
    for mistake, wrong_answers in variant.mistaken.items():
        wrong = wrong_answers.get(question.name)
        if wrong is None or isinstance(wrong, str) or abs(wrong) >= 1e12:
            continue
        tolerance = variant.tolerance(question, wrong)
        text = f'{wrong:.{decimals(tolerance) + 2}f}'
        slip, points = explain(variant, question, wrong, mistake)
        # Of mistakes with the same answer the first of those with most points.
        if text not in right_texts and (text not in slips or points > slips[text][0]):
            words = Mark(question.name, text, points, slip).reason(language)
            slips[text] = (
                points,
                Alternative(f'{100.0 * points:.0f}', text, f'{tolerance:g}', words),
            )
    alternatives += [alternative for _, alternative in slips.values()]
    return alternatives[:MAX_ALTERNATIVES]


def cloze_field(answers: Sequence[Alternative]) -> str:
    """Return a field of a Cloze question. Moodle decodes the entities of a reason once."""
    kind = 'NUMERICAL' if answers[0].tolerance else 'MULTICHOICE'
    fields = []
    for answer in answers:
        head = {'100': '=', '0': ''}.get(answer.percent, f'%{answer.percent}%')
        tolerance = f':{answer.tolerance}' if answer.tolerance else ''
        words = NOT_IN_CLOZE.sub(lambda match: f'&#{ord(match[0])};', escape(answer.reason))
        fields.append(f'{head}{answer.value}{tolerance}{words and "#"}{escape(words)}')
    return f'{{1:{kind}:{"~".join(fields)}}}'


def prairielearn(variants: Sequence[Variant], language: str) -> Files:
    """Return a PrairieLearn question, whose variants are drawn from PrairieLearn's own seeds."""
    kind = variants[0].kind
    title = texts()['kinds'][kind.name][language]['title']
    identity = str(uuid5(NAMESPACE_URL, f'klann_ros/exercises/{kind.name}/{language}'))
    page = [element('pl-question-panel', Markup('{{{params.problem}}}'))]
    for question in kind.questions:
        label = str(question_markup(question, language))
        suffix = unit_sign(question.unit)
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
        right = answer_text(variant, question, language)
        data['correct_answers'][question.name] = right


def grade(data: dict[str, Any], name: str, language: str) -> None:
    """Mark the submission of a PrairieLearn question, with reasons."""
    variant = make_variant(KINDS[name], str(data['variant_seed']))
    answers = {name: str(answer) for name, answer in data['submitted_answers'].items()}
    marks = mark(variant, answers)
    total = 0.0
    for answer_mark in marks:
        total += answer_mark.points
        feedback = answer_mark.reason(language)
        score = {'score': answer_mark.points, 'weight': 1, 'feedback': feedback}
        data['partial_scores'][answer_mark.question] = score
    data['score'] = total / len(marks)


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
    variant = make_variant(look_up(kind, KINDS, 'kind'), student)
    reasons = {}
    for answer_mark in mark(variant, {question: str(answer)}):
        reasons[answer_mark.question] = answer_mark.reason(language)
    return str(look_up(question, reasons, f'question of {kind}'))


def notebooks(variants: Sequence[Variant], language: str) -> Files:
    """Return a Jupyter notebook a student, and the tests of otter-grader for all of them."""
    kind = variants[0].kind
    right = texts()['marks']['right'][language]
    words = {'kind': kind.name, 'language': language, 'right': right}
    files: Files = {}
    for question in kind.questions:
        test = _filled('otter_test', question=question.name, **words)
        files[f'{kind.name}/tests/{question.name}.py'] = test.encode()
    used_names = {*DEVICES}
    for k, variant in enumerate(variants, 1):
        name = NOT_IN_NAMES.sub('', variant.student) or f'student{k}'
        # Small and capital letters are the same name to some file systems.
        suffix = f'_{k}' if name.casefold() in used_names else ''
        path = f'{kind.name}/{name}{suffix}.ipynb'
        used_names.add(name.casefold())
        files[path] = f'{json.dumps(notebook(variant, language), indent=1)}\n'.encode()
    return files


def notebook(variant: Variant, language: str) -> Mapping[str, Any]:
    """Return the notebook of a variant, in nbformat 4.5."""
    cells = [_cell(k, *cell) for k, cell in enumerate(_cells(variant, language))]
    return {**_templates()['notebook'], 'cells': cells}


def _cells(variant: Variant, language: str) -> Iterator[tuple[str, str]]:
    title = texts()['kinds'][variant.kind.name][language]['title']
    yield 'code', install_cell(language, 'otter-grader', 'otter')
    yield 'markdown', _filled('notebook_task', title=title, problem=problem(variant, language))
    yield 'code', _filled('notebook_start', student=repr(variant.student))
    for question in variant.kind.questions:
        words = question_markup(question, language)
        unit = unit_sign(question.unit)
        digits = asked(variant, question, language)
        yield 'markdown', _filled('notebook_question', words=words, unit=unit, asked=digits)
        yield 'code', _filled('notebook_answer', question=question.name)
    yield 'code', _filled('notebook_end')


def install_cell(language: str, package: str, module: str) -> str:
    """Return the first cell of a notebook: it installs what is missing, and says what is then."""
    words = {'package': package, 'module': module, 'version': __version__}
    for name, text in _templates()['notebook_words'][language].items():
        words[name] = Template(text).substitute(version=__version__)
    return _filled('notebook_install', **words)


def _cell(number: int, kind: str, source: str) -> dict[str, Any]:
    code: dict[str, Any] = {'execution_count': None, 'outputs': []} if kind == 'code' else {}
    return {'cell_type': kind, 'id': f'cell-{number}', 'metadata': {}, 'source': source, **code}
