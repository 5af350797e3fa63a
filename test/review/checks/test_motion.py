"""How the crank and the foot move: jumps, standstill and drift, each found as such."""

from dataclasses import replace
import math

from findings import checks, moments
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Severity
from klann_ros.review.reviewing import review_run
import pytest


@pytest.fixture
def slow(make_script):
    """Return a run that is long enough for quarters of more than a turn."""
    return make_script(turns=9.0, count=1800)


def stop(script) -> None:
    """Let the crank stand still from 2 s to 5 s."""
    still = script.answers[400]
    skipped = script.answers[1000].alpha - still.alpha
    for n in range(401, 1000):
        script.change(n, alpha=still.alpha, pose=still.pose, foot=still.foot)
    for n in range(1000, 1800):
        script.move(n, script.answers[n].alpha - skipped)


def test_a_jump_of_the_crank_is_found(healthy, finds) -> None:
    for n in range(100, 400):
        healthy.move(n, healthy.answers[n].alpha + 1.0)
    assert finds(healthy) == ['jump 0.5: the crank angle jumps once, by up to 1.03 rad']


def test_a_crank_that_stands_still_is_a_note(slow, make_run) -> None:
    stop(slow)
    (finding,) = review_run(make_run(slow)).findings
    assert (finding.check, finding.severity) == ('frozen', Severity.NOTE)
    assert finding.time == pytest.approx(2.0)


def test_a_path_that_drifts_is_found_where_no_geometry_judges_it(slow, make_run) -> None:
    given = slow.geometry
    slow.geometry = None
    assert checks(review_run(make_run(slow))) == ['geometry']
    for n, answer in enumerate(slow.answers):
        x, y = answer.foot
        slow.change(n, foot=(x, y + 0.003 * n / 1800))
    review = review_run(make_run(slow, 'drifting'))
    assert checks(review) == ['geometry', 'drift']
    # With the geometry each foot is wrong by itself, and the drift but follows.
    slow.geometry = given
    assert checks(review_run(make_run(slow, 'given'))) == ['foot']


@pytest.mark.parametrize('turns', [13.0, 60.3, 97.7])
def test_a_fast_crank_is_not_drift(make_script, make_run, turns) -> None:
    fast = make_script(turns=turns, count=1000)
    fast.geometry = None
    assert checks(review_run(make_run(fast), limits=Limits(crank_jump=3.0))) == ['geometry']


def by_turns(script, offset: float, every: int = 2):
    """Let another source, with an offset, set every n-th angle."""
    for n in range(0, len(script.answers), every):
        script.move(n, script.answers[n].alpha + offset)
    return script


def test_two_sources_that_turn_the_crank_are_found(healthy, make_run) -> None:
    review = review_run(make_run(by_turns(healthy, 1.0)))
    assert moments(review) == [('jump', 0.005)]
    text = 'the crank angle jumps back and forth 398 times, by up to 1.03 rad'
    assert review.findings[0].text == text
    assert review.findings[0].meaning.startswith('two sources alternate, or')


def test_several_publishers_of_the_crank_are_named(healthy, make_run) -> None:
    # Their inputs come out of order as well, as a rule.
    healthy.by_crank_state()
    healthy.swap_stamps(100, 101)
    healthy.crank = replace(healthy.crank, qos=qos_to_yaml([Qos(), Qos()]))
    (finding,) = review_run(make_run(by_turns(healthy, 2.0, every=3))).findings
    assert finding.check == 'jump'
    assert finding.meaning == (
        'multiple publishers set the crank at once (/crank_state), each with its own angle'
    )


def test_several_publishers_whose_inputs_come_in_blocks_are_named(healthy, make_run) -> None:
    # As of two processes on a busy machine: 150 inputs of the one, 100 of the other, and so on.
    healthy.crank = replace(healthy.crank, qos=qos_to_yaml([Qos(), Qos()]))
    for n in [*range(150, 250), *range(350, 400)]:
        healthy.move(n, healthy.answers[n].alpha + 2.0)
    (finding,) = review_run(make_run(healthy)).findings
    assert finding.text.startswith('the crank angle jumps back and forth twice, by up to 2.0')
    assert finding.meaning.startswith('multiple publishers set the crank at once')


@pytest.mark.parametrize(
    'angle',
    [lambda n: math.sin(n * math.tau / 8.0), lambda n: 0.1 * n + 0.4 * (n % 2)],
    ids=['a sine', 'a step of 0.5 rad and one back of 0.3 rad'],
)
def test_a_fast_crank_that_rocks_is_turned_by_one(make_script, make_run, angle) -> None:
    script = make_script()
    for n in range(400):
        script.move(n, angle(n))
    assert checks(review_run(make_run(script))) == []


def test_a_silent_crank_is_not_a_stall(slow, make_run) -> None:
    stop(slow)
    del slow.answers[450:950]
    slow.renumber()
    assert checks(review_run(make_run(slow))) == ['gap']


@pytest.mark.parametrize(('turns', 'is_path'), [(2.0, True), (1.0, True), (0.9, False)])
def test_less_than_a_turn_has_no_stride(make_script, make_run, turns, is_path) -> None:
    (leg,) = review_run(make_run(make_script(turns=turns))).legs
    assert math.isnan(leg.figures.stride) is not is_path
    assert math.isnan(leg.figures.lift) is not is_path
    assert not math.isnan(leg.figures.duty_factor)
