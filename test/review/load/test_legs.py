"""Which topics are a leg's, and whose; all legs of a run are reviewed."""

from dataclasses import replace
import struct

from findings import checks, found
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.records import Message
from klann_ros.review.reviewing import review_run
import pytest


def test_points_and_numbers_of_other_names_are_neither_foot_nor_crank(healthy, make_run) -> None:
    healthy.feet = replace(healthy.feet, name='/clicked_point')
    healthy.change(7, foot=(9.0, 9.0))
    time = healthy.answers[7].stamp + 1000
    other = replace(healthy.crank, name='/battery')
    healthy.messages = [Message(other, struct.pack('<4sd', b'\0\1\0\0', 7.0), time, time, 0)]
    review = review_run(make_run(healthy))
    assert checks(review) == []
    assert len(review.legs[0].recording.feet) == 0


@pytest.fixture
def two_legs(make_script):
    """Return a run of two legs, each in its namespace and with its geometry."""
    first = make_script().in_namespace('/a')
    second = make_script(KlannGeometry.patent()).in_namespace('/b')
    second.others = [first]
    return second


def test_legs_in_several_namespaces_are_all_judged(two_legs, make_run) -> None:
    review = review_run(make_run(two_legs))
    assert checks(review) == []
    evaluated = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs}
    assert evaluated == {'a': 400, 'b': 400}
    assert review.legs[1].recording.solver.leg.linkage == KlannGeometry.patent().linkage


def test_a_wrong_pose_is_found_in_its_own_leg(two_legs, make_run) -> None:
    two_legs.answers[7].pose[1] += 1e-3
    (finding,) = review_run(make_run(two_legs)).findings
    assert (finding.check, finding.leg) == ('closure', 'b')


def test_a_silence_of_one_leg_names_its_own_topics_only(two_legs, make_run) -> None:
    two_legs.delay(100, 300_000_000)
    silent = '/b/crank_angle, /b/joint_states, /b/point_h'
    assert found(make_run(two_legs)) == [f'gap: nothing on {silent} for 0.305 s']


def test_a_namespace_without_poses_is_not_a_leg(two_legs, make_run) -> None:
    (first,) = two_legs.others
    first.poses = replace(first.poses, name='/c/joint_states')
    # Those of a are taken for the leg of the last solver, which is that in a.
    assert [leg.recording.title for leg in review_run(make_run(two_legs)).legs] == ['b', 'c']


def test_a_leg_without_a_solver_of_its_namespace_takes_the_last(healthy, make_run) -> None:
    healthy.in_namespace('/a').namespace = '/elsewhere'
    review = review_run(make_run(healthy))
    assert checks(review) == []
    assert review.legs[0].errors is not None


@pytest.fixture
def walker(make_script):
    """Return a run of a walker of which one leg only was driven."""
    made = make_script()
    made.parameters['legs'] = ['front', 'rear']
    made.prefix = 'front/'
    made.feet = replace(made.feet, name='/front/point_h')
    return made


def test_a_leg_that_was_not_driven_is_a_note(walker, make_run) -> None:
    review = review_run(make_run(walker))
    assert review.is_healthy
    ((check, leg),) = [(finding.check, finding.leg) for finding in review.findings]
    assert (check, leg) == ('poses', 'rear')


def test_poses_of_unrecorded_legs_are_ignored(walker, make_run) -> None:
    walker.parameters['legs'] = ['left', 'right']
    (finding,) = found(make_run(walker))
    assert finding.startswith('poses: there is no pose in the run')
