"""What was asked and what was answered."""

import math
import re

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.review.command import main
import pytest


def found(run, capsys) -> list[str]:
    """Return the findings of a run."""
    main([str(run)])
    return re.findall(r'^FOUND (.*)', capsys.readouterr().out, flags=re.MULTILINE)


def test_a_pose_for_another_crank_angle_is_found(healthy, make_run, capsys) -> None:
    # A right pose, one bit beside the angle that was asked.
    asked = healthy.answers[100].alpha
    pose = KlannLeg().solve(math.nextafter(asked, 9.0))
    healthy.change(100, pose=list(pose[:5]), foot=pose.h)
    text = '1 of 400 poses are not for the crank angle that was asked (first at 0.500 s)'
    assert found(make_run(healthy), capsys) == [f'alpha: {text}']


def test_a_stamp_that_two_inputs_share_tells_no_angle(healthy, make_run, capsys) -> None:
    pose = KlannLeg().solve(1.0)
    healthy.change(100, pose=list(pose[:5]), foot=pose.h)
    healthy.unanswered = [(healthy.answers[100].stamp, 1.0)]
    assert found(make_run(healthy), capsys) == []


@pytest.mark.parametrize('alpha', [math.nan, math.inf, -math.inf, 1.1e6, -1e300])
def test_what_is_no_crank_angle_is_found_as_such(healthy, make_run, capsys, alpha) -> None:
    stamp = healthy.answers[100].stamp
    healthy.unanswered = [(stamp + 1000, alpha), (stamp + 2000, 1e6)]
    assert found(make_run(healthy), capsys) == [
        'rejected: 1 crank angles were none: not finite, or beyond 1e6 rad (first at 0.500 s)',
        'answers: 1 of 402 crank angles were not answered (first at 0.500 s)',
    ]


@pytest.fixture
def rocking(make_script):
    """Return a run of a leg that cannot turn fully, with one input out of its reach."""
    leg = KlannGeometry(l_dc=0.12)
    run = make_script(turns=0.0, count=10)
    run.geometry = leg
    solver = KlannLeg(leg)
    for n in range(10):
        pose = solver.closed_form(-0.1 + 0.01 * n)
        run.change(n, alpha=pose.alpha, pose=list(pose[:5]), foot=pose.h)
    run.unanswered = [(run.answers[5].stamp + 1000, math.pi)]
    return run


def test_an_angle_out_of_reach_is_found_as_such(rocking, make_run, capsys) -> None:
    text = '1 of 11 crank angles cannot be reached by this leg (first at 0.025 s)'
    assert found(make_run(rocking), capsys) == [f'reach: {text}']


def test_without_a_geometry_nobody_knows_why(rocking, make_run, capsys) -> None:
    rocking.geometry = None
    rocking.unanswered.append((rocking.answers[5].stamp + 2000, math.nan))
    _, answers = found(make_run(rocking), capsys)
    assert answers == 'answers: 2 of 12 crank angles were not answered (first at 0.025 s)'


def test_the_edges_are_no_finding_whatever_was_asked(rocking, make_run, capsys) -> None:
    before, after = rocking.answers[0].stamp - 1000, rocking.answers[-1].stamp + 1000
    rocking.unanswered = [(before, math.nan), (after, math.pi)]
    assert found(make_run(rocking), capsys) == []
