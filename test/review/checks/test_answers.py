"""What was asked and what was answered."""

from findings import checks, found
from klann_ros.kinematics import KinematicsError, KlannGeometry, KlannLeg
from klann_ros.review.reviewing import review_run
import pytest


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


def test_without_a_geometry_the_reason_is_unknown(rocking, make_run) -> None:
    rocking.geometry = None
    out = len(rocking.unanswered)
    _, answers = found(make_run(rocking))
    assert answers == f'answers: {out} of 60 crank angles were not answered'
