"""How the crank and the foot move: jumps, standstill and drift, each found as such."""

from findings import checks, moments
from klann_ros.kinematics import KlannLeg
from klann_ros.review.finding import Severity
from klann_ros.review.limits import Limits
from klann_ros.review.reviewing import review_run
import pytest


@pytest.fixture
def slow(make_script):
    """Return a run that is long enough for quarters of more than a turn."""
    return make_script(turns=9.0, count=1800)


def test_a_jump_of_the_crank_is_found(healthy, make_run) -> None:
    leg = KlannLeg()
    for n in range(100, 400):
        pose = leg.solve(healthy.answers[n].alpha + 1.0)
        healthy.change(n, alpha=pose.alpha, pose=list(pose[:5]), foot=pose.h)
    review = review_run(make_run(healthy))
    assert moments(review) == [('jump', 0.5)]
    assert review.findings[0].text.startswith('the crank angle jumps 1 times, by up to 1.03 rad')


def test_a_crank_that_stands_still_is_a_note(slow, make_run) -> None:
    still = slow.answers[400]
    for n in range(401, 1000):
        slow.change(n, alpha=still.alpha, pose=still.pose, foot=still.foot)
    behind = slow.answers[1000:]
    leg = KlannLeg()
    for n, answer in enumerate(behind, start=1000):
        pose = leg.solve(answer.alpha - behind[0].alpha + still.alpha)
        slow.change(n, alpha=pose.alpha, pose=list(pose[:5]), foot=pose.h)
    review = review_run(make_run(slow))
    assert review.is_healthy
    assert [(f.check, f.severity) for f in review.findings] == [('frozen', Severity.NOTE)]
    assert review.findings[0].time == pytest.approx(2.0)


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
    assert checks(review_run(make_run(slow, 'told'))) == ['foot']


@pytest.mark.parametrize('turns', [13.0, 60.3, 97.7])
def test_a_fast_crank_is_no_drift(make_script, make_run, turns) -> None:
    fast = make_script(turns=turns, count=1000)
    fast.geometry = None
    assert checks(review_run(make_run(fast), limits=Limits(crank_jump=3.0))) == ['geometry']
