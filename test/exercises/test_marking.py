"""Marking: every legal form is right, every slip has its name, and points follow."""

from pathlib import Path
from random import Random

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


def test_rounding_is_no_excuse_for_another_number() -> None:
    variant = make_variant(KINDS['four-bar-position'], '7')
    theta_4 = variant.answers['theta_4']
    assert isinstance(theta_4, float)
    for factor, is_excused in ((1.002, True), (1.02, False), (1.06, False)):
        marks = mark(variant, right_answers(variant) | {'theta_4': f'{factor * theta_4:.7g}'})
        points = {answer.question: answer.points for answer in marks}
        assert (points['theta_4'] > 0.0) == is_excused, factor


@pytest.mark.slow
@pytest.mark.parametrize('case', ['alone', 'beside right answers', 'all wrong', 'words'])
def test_a_wrong_answer_has_no_points_by_chance(case: str) -> None:
    chance = Random(46)  # noqa: S311 - no secret
    for name in 4 * [name for name in KINDS if name != 'foot-path']:
        variant = make_variant(KINDS[name], str(chance.randrange(10**6)))
        wrong = {}
        for question in variant.kind.questions:
            key = question.name
            answer = variant.answers[key]
            if isinstance(answer, str):
                wrong[key] = next(choice for choice in question.choices if choice != answer)
            else:
                error = chance.choice([-1.0, 1.0]) * chance.uniform(0.05, 0.2)
                wrong[key] = f'{answer * (1.0 + error):.{variant.kind.digits}g}'
        if case == 'words':
            wrong = {q.name: wrong[q.name] for q in variant.kind.questions if q.choices}
        elif case != 'all wrong':
            wrong = dict([chance.choice([*wrong.items()])])
        answers = right_answers(variant) | wrong if case == 'beside right answers' else wrong
        for answer_mark in mark(variant, answers):
            assert answer_mark.question not in wrong or answer_mark.points == 0.0, answer_mark


def test_a_number_of_a_slip_close_to_the_right_one_is_a_slip_by_two_answers(
    four_bar: Variant,
) -> None:
    # Both are within a quarter of the right answers.
    slip = four_bar.mistaken['side:input']
    answers = {name: f'{slip[name]:.6g}' for name in ('Z', 'alpha')}
    words = 'o ângulo foi medido a partir do outro lado'
    for name, answer in answers.items():
        marks = {other.question: other for other in mark(four_bar, {name: answer})}
        assert marks[name].points == 0.0
        assert marks[name].reason('pt') == f'errado; causa possível: {words}'
    marks = {answer.question: answer for answer in mark(four_bar, answers)}
    assert (marks['Z'].points, marks['Z'].reason('pt')) == (0.5, words)
    assert marks['alpha'].points == 0.8
    # Two others that the slip would have changed are right.
    right = right_answers(four_bar)
    answers |= {name: right[name] for name in ('beta', 'mu')}
    assert {answer.points for answer in mark(four_bar, answers)} == {0.0, 1.0}


@pytest.mark.parametrize('name', ['newton', 'four-bar-newton'])
def test_a_count_is_a_slip_by_itself_only_if_that_changes_nothing_else(name: str) -> None:
    # Of 8 and 28 another slip gives the same count, beside other angles.
    for student in ('0', '1', '8', '28'):
        variant = make_variant(KINDS[name], student)
        count = variant.answers['iterations']
        assert isinstance(count, float)
        points = []
        for error in (-2, -1, 1, 2):
            answers = right_answers(variant) | {'iterations': f'{count + error:.0f}'}
            points.append(mark(variant, answers)[-1].points)
        # One less is the slip of the last iteration, whose angles are right.
        assert points == [0.0, 0.7, 0.0, 0.0], student


def test_a_slip_is_charged_once(four_bar: Variant) -> None:
    wrong = {name: f'{angle:.6g}' for name, angle in four_bar.mistaken['assembly:1'].items()}
    marks = mark(four_bar, right_answers(four_bar) | wrong)
    charged = [answer for answer in marks if answer.slip == 'assembly']
    assert [answer.points for answer in charged] == [0.5, 0.8]
    assert charged[1].reason('pt') == 'a outra montagem; segue de um erro anterior'


def test_a_consequence_is_computed_from_the_slip() -> None:
    variant = make_variant(KINDS['four-bar-position'], '7')
    # Only theta_4 and theta_3 are computed from others of these.
    wrong = {}
    for name in ('mu', 'alpha', 'theta_4', 'theta_3'):
        wrong[name] = f'{variant.mistaken["radians:answer"][name]:.6g}'
    marks = {answer.question: answer for answer in mark(variant, right_answers(variant) | wrong)}
    assert [marks[name].points for name in wrong] == [0.5, 0.5, 0.8, 0.8]
    assert [marks[name].carried for name in wrong] == [False, False, True, True]


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
