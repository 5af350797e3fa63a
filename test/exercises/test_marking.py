"""Marking: every legal form is right, every slip has its name, and points follow."""

from klann_ros.exercises import KINDS, make_variant, mark, Question, statistics, Variant
from klann_ros.exercises.marking import read_answer
import pytest

ANGLE = Question('theta_4', 'deg')


@pytest.fixture(scope='module')
def four_bar() -> Variant:
    return make_variant(KINDS['four-bar-position'], '7')


def right_answers(variant: Variant) -> dict[str, str]:
    return {
        name: value if isinstance(value, str) else f'{value:.7g}'
        for name, value in variant.answers.items()
    }


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('72.14', 72.14),
        ('72,14', 72.14),
        (' +72,14 ° ', 72.14),
        ('\N{MINUS SIGN}12,5º', -12.5),
        ('72.14 deg', 72.14),
        ('72,14 graus', 72.14),
        ('1.25908 rad', 72.13997),
        ('7.214e1', 72.14),
        ('7,214 x 10^1', 72.14),
        ('7.214·10¹', 72.14),
        ('1.234,5', 1234.5),
        ('1,234.5', 1234.5),
        ('.5', 0.5),
        ('1\N{NO-BREAK SPACE}234\N{THIN SPACE}567,8', 1234567.8),
        ('1 234', 1234.0),
        ('1,234,567', 1234567.0),
        ('1.234', 1.234),
        ('- 1,5E\N{MINUS SIGN}3', -0.0015),
        ('1,5 x 10^(-3)', 0.0015),
        ('-3/2', -1.5),
        ("12°30'", 12.5),
        ('-12º 30\' 36"', -12.51),
        ('12°30\N{PRIME}', 12.5),
        ('12° 30,6\N{RIGHT SINGLE QUOTATION MARK}', 12.51),
        ("12°30'36''", 12.51),
    ],
)
def test_a_legal_form_is_read(text: str, value: float) -> None:
    assert read_answer(text, ANGLE) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    'text',
    [
        *('', 'nan', 'inf', '1e999', '12 mm', '1,2,3', '12..5', 'x', '1' * 65, '__import__'),
        *('1 23', '1 234 56', '1.234.567.', '12 34,5', '0,123,4', '1/0', '1 1/2', "12°75'"),
        '12°30',
    ],
)
def test_answers_in_other_units_or_words_are_not_read(text: str) -> None:
    assert read_answer(text, ANGLE) is None


@pytest.mark.parametrize(
    ('text', 'choice'),
    [
        ('Manivela-balancim', 'crank-rocker'),
        ('crank rocker', 'crank-rocker'),
        ('DUPLO BALANCIM', 'double rocker'),
        ('rocker', None),
    ],
)
def test_a_choice_is_read_in_both_languages(text: str, choice: str | None) -> None:
    motion = KINDS['grashof'].questions[-1]
    assert read_answer(text, motion) == choice


@pytest.mark.parametrize('text', ['II', 'class II', 'Classe ii', '2'])
def test_a_class_is_read_as_written(text: str) -> None:
    assert read_answer(text, KINDS['grashof'].questions[2]) == 'II'


@pytest.mark.parametrize('name', KINDS)
def test_the_key_itself_has_all_points(name: str) -> None:
    variant = make_variant(KINDS[name], '11')
    marks = mark(variant, right_answers(variant))
    assert [each.slip for each in marks] == ['right'] * len(KINDS[name].questions)


@pytest.mark.parametrize(
    ('name', 'mistake', 'slip'),
    [
        ('four-bar-position', 'assembly:1', 'assembly'),
        ('four-bar-position', 'radians:answer', 'radians'),
        ('four-bar-position', 'side:input', 'side'),
        ('newton', 'transposed', 'transposed'),
        ('newton', 'short:2', 'short'),
        ('newton', 'f:1', 'sign'),
        ('quick-return', 'clockwise:answer', 'clockwise'),
        ('torque', 'units:mm', 'units'),
        ('torque', 'sine:input', 'sine'),
        ('acceleration', 'rounding:2', 'rounding'),
        ('function-generation', 'radians:trig', 'radians'),
    ],
)
def test_a_slip_has_its_name(name: str, mistake: str, slip: str) -> None:
    variant = make_variant(KINDS[name], '5')
    wrong = {key: f'{value:.6g}' for key, value in variant.mistaken[mistake].items()}
    marks = [
        each for each in mark(variant, right_answers(variant) | wrong) if each.slip != 'right'
    ]
    assert {each.question for each in marks} == set(wrong)
    assert {each.slip for each in marks} == {slip}


def test_a_slip_is_charged_once(four_bar: Variant) -> None:
    wrong = {name: f'{value:.6g}' for name, value in four_bar.mistaken['assembly:1'].items()}
    marks = mark(four_bar, right_answers(four_bar) | wrong)
    charged = [each for each in marks if each.slip == 'assembly']
    assert [each.points for each in charged] == [0.5, 0.8]
    assert charged[1].reason('pt') == 'a outra montagem; segue de um erro anterior'


def test_other_answers_have_no_points(four_bar: Variant) -> None:
    marks = {each.question: each for each in mark(four_bar, {'Z': '7', 'mu': 'x'})}
    assert (marks['Z'].slip, marks['Z'].points) == ('wrong', 0.0)
    assert (marks['mu'].slip, marks['mu'].points) == ('unreadable', 0.0)
    assert (marks['beta'].slip, marks['beta'].points) == ('empty', 0.0)


def test_the_class_has_statistics_of_slips(four_bar: Variant) -> None:
    sets = [right_answers(four_bar), {}]
    marked = {(str(k), 'four-bar-position'): mark(four_bar, each) for k, each in enumerate(sets)}
    found = statistics(marked)['four-bar-position']
    assert found == {'students': 2, 'part': 0.5, 'right': 6, 'empty': 6}
