"""The practice mode: the exercises, keys, steps and marks of Python, in node and in the page."""

from collections.abc import Callable, Mapping
import json
from pathlib import Path
from random import Random
from typing import Any

from browser import find
from browser_page import OpenedPage
from klann_ros.exercises import KINDS, make_variant, mark, Question, Variant
from klann_ros.exercises.lab import lab_data
from klann_ros.exercises.marking import read_answer
from klann_ros.exercises.sheet import answer_text
from klann_ros.sanitize.quantity import unit_table
from klann_ros.web.lab.build import LAB_FILE, PRACTICE, QUANTITY
from lab_solver import in_node, NODE
import pytest
from yaml_tables import read_table

FILES = read_table(Path(__file__).with_name('files.yaml'))
TABLES = Path(__file__).parents[2]
SCRIPTS = (*QUANTITY, *PRACTICE[:4])
DATA = {**lab_data(), 'unitTable': unit_table()}
needs_node = pytest.mark.skipif(NODE is None, reason='no node: apt-get install nodejs')
STUDENTS = ['1', '12345', '00770', 'a-7.b_c']
# Of a number's size, or of 1 where it is smaller.
NEAR = 1e-12
ANSWERS = """
function answer({ data, cases }) {
  return cases.map(({ kind, student, answers }) => {
    const exercise = new Exercise(data, kind, student);
    return {
      givens: exercise.givens,
      answers: exercise.answers,
      tolerances: exercise.kind.questions.map((question) => exercise.tolerance(question)),
      steps: exercise.worked.steps,
      marks: answers.map((given) => markAnswers(exercise, given)),
    };
  });
}
"""


def in_browser(cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    exercises: list[dict[str, Any]] = in_node(ANSWERS, {'data': DATA, 'cases': cases}, SCRIPTS)
    return exercises


def assert_near(answer: Any, right: Any) -> None:
    if isinstance(right, str):
        assert answer == right
    else:
        assert answer == right or abs(answer - right) <= NEAR * max(1.0, abs(right))


@pytest.mark.slow
@needs_node
def test_a_student_gets_the_numbers_of_the_sheet() -> None:
    variants = [make_variant(kind, student) for kind in KINDS.values() for student in STUDENTS]
    cases = [{'kind': v.kind.name, 'student': v.student, 'answers': []} for v in variants]
    for variant, exercise in zip(variants, in_browser(cases), strict=True):
        assert exercise['givens'] == variant.givens
        for question, tolerance in zip(
            variant.kind.questions, exercise['tolerances'], strict=True
        ):
            assert_near(exercise['answers'][question.name], variant.answers[question.name])
            assert tolerance == variant.tolerance(question)
        for lab_step, step in zip(exercise['steps'], variant.steps, strict=True):
            texts = (lab_step['symbol'], lab_step['unit'], lab_step['formula'])
            assert texts == (step[0], *step[2:4])
            assert_near(lab_step['value'], step.value)


def wrong_answers(variant: Variant) -> list[dict[str, str]]:
    """Return the answers of students with one slip each, and as they may be written."""
    right = written(variant.answers)
    answers = [right, {}, dict.fromkeys(right, 'x'), dict.fromkeys(right, '7')]
    answers.append({name: f' {text.replace(".", ",")} ' for name, text in right.items()})
    for wrong in variant.mistaken.values():
        answers.append(right | written(wrong))
        answers += [{name: text} for name, text in written(wrong).items()]
    chance = Random(46)  # noqa: S311 - no secret
    for size in (0.001, 0.01, 0.03, 0.2, 0.3):
        errors = {name: 1.0 + size * chance.uniform(-1.0, 1.0) for name in right}
        close = {n: x if isinstance(x, str) else x * errors[n] for n, x in variant.answers.items()}
        answers += [written(close), *(right | {n: x} for n, x in written(close).items())]
    return answers


def written(answers: Mapping[str, float | str]) -> dict[str, str]:
    return {name: x if isinstance(x, str) else f'{x:.6g}' for name, x in answers.items()}


@pytest.mark.slow
@needs_node
def test_slips_and_points_are_those_of_the_marking() -> None:
    variants = [make_variant(kind, '31') for name, kind in KINDS.items() if name != 'foot-path']
    cases = []
    for variant in variants:
        answers = wrong_answers(variant)
        cases.append({'kind': variant.kind.name, 'student': '31', 'answers': answers})
    for variant, case, exercise in zip(variants, cases, in_browser(cases), strict=True):
        for answers, marks in zip(case['answers'], exercise['marks'], strict=True):
            for lab_mark, right in zip(marks, mark(variant, answers), strict=True):
                expected = [right.question, right.points, right.slip, right.carried]
                keys = ('question', 'points', 'slip', 'isCarried')
                assert [lab_mark[key] for key in keys] == expected, (variant.kind.name, answers)


@needs_node
def test_an_answer_is_read_as_python_reads_it() -> None:
    script = """function answer({ data, cases }) {
      return cases.map(([question, text]) => {
        const reading = readAnswer(data, text, question);
        return Number.isNaN(reading) ? 'nan' : reading;
      });
    }"""
    words = read_table(TABLES / 'exercises' / 'answers.yaml')['choices']
    quantities = read_table(TABLES / 'sanitize' / 'quantities.yaml')
    questions = [q for q in KINDS['grashof'].questions if q.choices]
    cases = [(question, str(text)) for question in questions for text in words[question.name]]
    for unit in quantities:
        cases += [(Question('', unit), str(text)) for row in quantities.values() for text in row]
    readings = in_node(
        script, {'data': DATA, 'cases': [(q._asdict(), text) for q, text in cases]}, SCRIPTS
    )
    for (question, text), reading in zip(cases, readings, strict=True):
        right = read_answer(text, question)
        assert reading == (right if str(right) != 'nan' else 'nan'), (text, question)


if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)


class Practice(OpenedPage):
    """The practice mode in the browser."""

    def __init__(self, page: Any, fragment: str) -> None:
        super().__init__(page, LAB_FILE.as_uri() + fragment)
        self.until("!document.querySelector('#practice').hidden || Boolean(lab.refusal)")

    def marks(self) -> list[str]:
        texts: list[str] = self.page.locator('.practice-mark').all_text_contents()
        return texts


@pytest.fixture
def visit(new_page: Callable[..., Any]) -> Callable[..., Practice]:
    return lambda fragment, **options: Practice(new_page(**options), fragment)


@pytest.mark.parametrize('language', [pytest.param('en', marks=pytest.mark.slow), 'pt'])
def test_every_exercise_is_shown_on_a_telephone(visit: Any, language: str) -> None:
    options = {'viewport': {'width': 360, 'height': 640}, 'has_touch': True, 'is_mobile': True}
    opened = visit(f'#practice=newton&seed=1&lang={language}', **options)
    for name, kind in KINDS.items():
        opened.page.evaluate('name => lab.practice.go(name, "1")', name)
        assert opened.page.locator('.practice-row').count() == len(kind.questions)
        assert opened.page.url.endswith(f'#practice={name}&seed=1&lang={language}')
        opened.page.evaluate('lab.practice.solve()')
        assert opened.page.evaluate('document.documentElement.scrollWidth') <= 360, name
    assert opened.complaints == []
    assert opened.requests == [opened.requests[0]]


def test_it_is_worked_through_by_the_keyboard_alone(visit: Any) -> None:
    opened = visit('#practice=limits&seed=9&lang=pt')
    variant = make_variant(KINDS['limits'], '9')
    keyboard = opened.page.keyboard
    opened.page.locator('#practice-theta_2_S').focus()
    for question in variant.kind.questions[:-1]:
        keyboard.type(answer_text(variant, question, 'pt'))
        keyboard.press('Tab')
    keyboard.type('0,5')
    keyboard.press('Enter')
    assert opened.marks()[:5] == ['✓ certo'] * 5
    assert opened.marks()[5].startswith('✗')
    assert opened.page.locator('.practice-points').text_content().startswith('5 de 6 pontos')
    # The first field that is wrong has the focus.
    assert opened.page.evaluate('document.activeElement.id') == 'practice-Q'


def test_a_step_is_shown_in_the_drawing(visit: Any) -> None:
    opened = visit('#practice=velocity&seed=5&lang=en')
    line = opened.page.locator('.shown-line')
    opened.page.locator('#practice-omega_beta').focus()
    assert 'A46 46' in line.get_attribute('d')
    opened.page.get_by_text('Show the solution').click()
    opened.page.locator('.practice-steps button').last.focus()
    # The velocity of H: a ring around the point, and an arrow with two sides.
    assert line.get_attribute('d').count('l') == 2
    assert 'Key: ' in opened.page.locator('.practice-key').first.text_content()


@pytest.mark.slow
def test_axe_finds_no_barrier_in_a_solved_exercise(visit: Any) -> None:
    opened = visit('#practice=grashof&seed=5&lang=pt', color_scheme='light')
    opened.page.evaluate('lab.practice.mark(); lab.practice.solve()')
    assert opened.barriers() == []


def test_paper_has_the_answers_and_no_controls(visit: Any) -> None:
    opened = visit('#practice=newton&seed=5&lang=en')
    opened.page.evaluate('lab.practice.solve()')
    opened.page.emulate_media(media='print')
    assert opened.page.locator('#practice .bar button:visible').count() == 0
    shown = opened.page.locator('#practice :is(input, .practice-key, .practice-steps button)')
    whole = ':is(.practice-row, .practice-steps li, .practice-figure)'
    style = '(nodes) => nodes.map((node) => getComputedStyle(node).breakInside)'
    assert shown.locator('visible=false').count() == 0
    assert set(opened.page.locator(whole).evaluate_all(style)) == {'avoid'}


def test_what_was_typed_outlives_the_language_and_the_lab_comes_back(visit: Any) -> None:
    opened = visit('#practice=toggle&seed=5&lang=en')
    opened.page.locator('#practice-Z').fill('123.4')
    opened.page.get_by_text('Português').click()
    assert opened.page.locator('#practice-Z').input_value() == '123.4'
    assert opened.page.locator('#practice h2').text_content() == 'Projeto de ponto morto'
    opened.page.get_by_text('Voltar ao laboratório').click()
    assert opened.page.locator('#scene').is_visible()
    assert '#' not in opened.page.url
    opened.page.locator('#practise').click()
    opened.until("!document.querySelector('#practice').hidden")
    assert not opened.page.locator('#scene').is_visible()


def test_a_hostile_link_is_one_clear_line(visit: Any) -> None:
    opened = visit('#practice=newton&seed=', locale='en-US')
    long = {'newton&seed=' + '9' * 20_000: 'more than 20000'}
    for fragment, reason in {**long, **FILES['practice links']}.items():
        opened.page.evaluate('(link) => { location.hash = link; }', f'practice={fragment}')
        opened.until(
            f"document.getElementById('refusal').textContent.includes({json.dumps(reason)})"
        )
        assert len(opened.page.locator('#refusal').text_content()) < 200
        assert not opened.page.locator('#practice').is_visible()
    assert opened.complaints == []
