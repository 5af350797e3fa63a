"""What was asked and what was answered."""

import math

from findings import checks, found, moments
from klann_ros.kinematics import KinematicsError, KlannGeometry, KlannLeg
from klann_ros.log.run_parameters import TopicCount
from klann_ros.review.model.review import Severity
from klann_ros.review.reviewing import review_run
import pytest


def test_a_pose_for_another_crank_angle_is_found(healthy, finds) -> None:
    # A right pose, one bit beside the angle that was asked.
    pose = KlannLeg().solve(math.nextafter(healthy.answers[100].alpha, 9.0))
    healthy.change(100, pose=list(pose.joints), foot=pose.h)
    text = '1 of 400 poses is at another crank angle than their input'
    assert finds(healthy) == [f'alpha 0.5: {text}']


@pytest.mark.parametrize('parameters', [{'phase': 0.5}, {'direction': -1}])
def test_another_phase_or_direction_than_recorded_is_found(healthy, make_run, parameters) -> None:
    healthy.parameters.update(parameters)
    assert checks(review_run(make_run(healthy))) == ['alpha']


def test_a_stamp_that_two_inputs_share_has_no_angle(healthy, finds) -> None:
    alpha = healthy.answers[100].alpha + 1e-3
    pose = KlannLeg().solve(alpha)
    healthy.change(100, pose=list(pose.joints), foot=pose.h)
    healthy.unanswered = [(healthy.answers[100].stamp, alpha)]
    assert finds(healthy) == ['answers 0.5: 1 of 401 crank angles was not answered']


@pytest.mark.parametrize('alpha', [math.nan, math.inf, -math.inf, 1.1e6, -1e300])
def test_an_invalid_crank_angle_is_rejected(healthy, finds, alpha) -> None:
    healthy.unanswered = [(healthy.answers[100].stamp + 1000, alpha)]
    text = '1 of 401 crank angles was invalid: not finite, or beyond 1e6 rad'
    assert finds(healthy) == [f'rejected 0.5: {text}']


def test_an_unanswered_angle_is_found_but_not_at_the_edges(healthy, make_run) -> None:
    for index, later in ((0, -1000), (30, 1000), (399, 1000)):
        healthy.ask(index, later)
    review = review_run(make_run(healthy))
    assert moments(review) == [('answers', 0.15)]
    (finding,) = review.findings
    assert (finding.text, finding.severity) == (
        '1 of 401 crank angles was not answered',
        Severity.WARNING,
    )
    assert 'or its input was lost' in finding.meaning


def test_lost_answers_are_not_missing(healthy, make_run) -> None:
    healthy.ask(30)
    healthy.add_counts({'/joint_states': TopicCount(400, 400, missed=1)})
    assert found(make_run(healthy)) == ['lost: 1 message of /joint_states was lost']


@pytest.fixture
def rocking(make_script):
    """Return a run of a leg that cannot turn fully, of which ten angles are out of its reach."""
    geometry = KlannGeometry(l_dc=0.12)
    run = make_script(turns=0.0, count=60)
    run.geometry = geometry
    solver = KlannLeg(geometry)
    for n in range(60):
        # There and back; it reaches 2.3847 rad.
        alpha = 2.394 - 0.003 * abs(n - 30)
        if alpha > 2.3845:
            run.unanswered.append((run.answers[n].stamp, alpha))
            run.answers[n] = None
        else:
            pose = solver.closed_form(alpha)
            run.change(n, alpha=pose.alpha, pose=list(pose.joints), foot=pose.h)
    run.renumber()
    return run


def test_an_angle_out_of_reach_is_found_as_such(rocking, make_run) -> None:
    out = len(rocking.unanswered)
    text = f'reach: {out} of 60 crank angles cannot be reached by this leg'
    assert found(make_run(rocking)) == [text]


def test_silence_at_unreachable_angles_is_not_a_gap(make_script, make_run) -> None:
    geometry = KlannGeometry(l_dc=0.12)
    run, solver = make_script(turns=2.0), KlannLeg(geometry)
    run.geometry = geometry
    for n, answer in enumerate(run.answers):
        try:
            pose = solver.closed_form(answer.alpha)
        except KinematicsError:
            run.unanswered.append((answer.stamp, answer.alpha))
            run.answers[n] = None
        else:
            run.change(n, pose=list(pose.joints), foot=pose.h)
    run.renumber()
    # About a sixth of each turn, of a second.
    review = review_run(make_run(run))
    assert checks(review) == ['reach']
    lengths = [topic.longest_gap for topic in review.topics if topic.name == '/joint_states']
    assert lengths[0] > 0.1


def test_a_solver_that_stood_still_is_a_gap_of_its_answers(healthy, finds) -> None:
    silent, healthy.answers[100:150] = healthy.answers[100:150], []
    healthy.unanswered = [(answer.stamp, answer.alpha) for answer in silent]
    healthy.renumber()
    silence = 'nothing on /joint_states, /point_h for 0.255 s'
    count = '50 crank angles were not answered meanwhile'
    assert finds(healthy) == [f'gap 0.495: {silence}; {count}']


def test_without_a_geometry_the_reason_is_unknown(rocking, make_run) -> None:
    rocking.geometry = None
    out = len(rocking.unanswered)
    _, answers = found(make_run(rocking))
    assert answers == f'answers: {out} of 60 crank angles were not answered'


def test_poses_that_end_before_the_crank_does_are_stale(healthy, finds) -> None:
    last = healthy.answers[-1]
    healthy.unanswered = [
        (last.stamp + n * 5_000_000, last.alpha + n / 100) for n in range(1, 501)
    ]
    text = 'the poses ended 2.5 s before the crank did; 500 crank angles came after them'
    assert finds(healthy) == [f'stale 1.995: {text}']
