"""Marking: every legal form is right, every slip has its name, and points follow."""

from pathlib import Path

from klann_ros.exercises import KINDS, make_variant, mark, statistics, Variant
from klann_ros.exercises.marking import read_answer
import pytest
from yaml_tables import read_table

ANSWERS = read_table(Path(__file__).with_name('answers.yaml'))


@pytest.fixture(scope='module')
def four_bar() -> Variant:
    return make_variant(KINDS['four-bar-position'], '7')


def right_answers(variant: Variant) -> dict[str, str]:
    answers = {}
    for name, answer in variant.answers.items():
        answers[name] = answer if isinstance(answer, str) else f'{answer:.7g}'
    return answers


CHOICES = [(name, *pair) for name, words in ANSWERS['choices'].items() for pair in words.items()]


@pytest.mark.parametrize(('name', 'text', 'choice'), CHOICES)
def test_a_choice_is_read_by_its_usual_names(name: str, text: object, choice: str | None) -> None:
    (question,) = [q for q in KINDS['grashof'].questions if q.name == name]
    assert read_answer(str(text), question) == choice


@pytest.mark.parametrize('name', KINDS)
def test_the_key_itself_has_all_points(name: str) -> None:
    variant = make_variant(KINDS[name], '11')
    marks = mark(variant, right_answers(variant))
    assert [answer.slip for answer in marks] == ['right'] * len(KINDS[name].questions)


SLIPS = [(name, *pair) for name, slips in ANSWERS['slips'].items() for pair in slips.items()]


@pytest.mark.parametrize(('name', 'mistake', 'slip'), SLIPS)
def test_a_slip_has_its_name(name: str, mistake: str, slip: str) -> None:
    variant = make_variant(KINDS[name], '5')
    wrong = {key: f'{number:.6g}' for key, number in variant.mistaken[mistake].items()}
    marks = mark(variant, right_answers(variant) | wrong)
    slips = {answer.question: answer.slip for answer in marks}
    assert slips == dict.fromkeys(slips, 'right') | dict.fromkeys(wrong, slip)


def test_a_number_near_the_right_one_is_rounded_too_early(four_bar: Variant) -> None:
    theta_4 = four_bar.answers['theta_4']
    tolerance = four_bar.tolerance(next(q for q in four_bar.kind.questions if q.name == 'theta_4'))
    answers = right_answers(four_bar) | {'theta_4': f'{theta_4 + 1.5 * tolerance:.7g}'}
    slips = {answer.question: answer.slip for answer in mark(four_bar, answers)}
    assert slips['theta_4'] == 'rounding'


def test_a_slip_is_charged_once(four_bar: Variant) -> None:
    wrong = {name: f'{angle:.6g}' for name, angle in four_bar.mistaken['assembly:1'].items()}
    marks = mark(four_bar, right_answers(four_bar) | wrong)
    charged = [answer for answer in marks if answer.slip == 'assembly']
    assert [answer.points for answer in charged] == [0.5, 0.8]
    assert charged[1].reason('pt') == 'a outra montagem; segue de um erro anterior'


def test_other_answers_have_no_points(four_bar: Variant) -> None:
    answers = {'Z': '7', 'mu': 'x', 'alpha': '5 kg'}
    marks = {answer.question: answer for answer in mark(four_bar, answers)}
    assert (marks['Z'].slip, marks['Z'].points) == ('wrong', 0.0)
    assert (marks['mu'].slip, marks['mu'].points) == ('unreadable', 0.0)
    assert (marks['alpha'].slip, marks['alpha'].points) == ('dimension', 0.0)
    assert (marks['beta'].slip, marks['beta'].points) == ('empty', 0.0)


def test_the_class_has_statistics_of_slips(four_bar: Variant) -> None:
    class_marks = {
        ('1', 'four-bar-position'): mark(four_bar, right_answers(four_bar)),
        ('2', 'four-bar-position'): mark(four_bar, {}),
    }
    expected = {'students': 2, 'part': 0.5, 'right': 6, 'empty': 6}
    assert statistics(class_marks)['four-bar-position'] == expected
