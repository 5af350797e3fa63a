"""Which topics are a leg's, and which leg is reviewed."""

from dataclasses import replace

from klann_ros.kinematics import KlannGeometry
from klann_ros.log.records import Message
from klann_ros.review.command import main
import pytest


def test_renamed_joint_states_are_poses_all_the_same(healthy, make_run, capsys) -> None:
    healthy.poses = replace(healthy.poses, name='/leg_states')
    healthy.answers[7].pose[1] += 1e-3
    assert main([str(make_run(healthy))]) == 1
    assert 'FOUND resolve: 1 of 400 poses' in capsys.readouterr().out


def test_a_renamed_crank_state_is_an_input_all_the_same(healthy, make_run, capsys) -> None:
    healthy.crank = replace(healthy.poses, name='/motor')
    healthy.unanswered = [(healthy.answers[7].stamp + 1000, 1.0)]
    assert main([str(make_run(healthy))]) == 1
    assert 'FOUND answers: 1 of 401' in capsys.readouterr().out


def test_points_of_another_name_are_not_the_foot(healthy, make_run, capsys) -> None:
    healthy.feet = replace(healthy.feet, name='/clicked_point')
    healthy.change(7, foot=(9.0, 9.0))
    assert main([str(make_run(healthy))]) == 0
    assert 'worst foot, solved again            - m off' in capsys.readouterr().out


def test_numbers_of_another_name_are_not_the_crank(healthy, make_run, capsys) -> None:
    time = healthy.answers[7].stamp + 1000
    other = replace(healthy.crank, name='/battery')
    healthy.messages = [Message(other, b'\0\1\0\0' + b'\0' * 8, time, time, 0)]
    assert main([str(make_run(healthy))]) == 0
    capsys.readouterr()


@pytest.fixture
def two_legs(make_script):
    """Return a run of two legs, each in its namespace and with its geometry."""
    first = make_script().in_namespace('/a')
    second = make_script(KlannGeometry.patent()).in_namespace('/b')
    second.others = [first]
    return second


def test_of_several_legs_the_first_is_reviewed(two_legs, make_run, capsys) -> None:
    assert main([str(make_run(two_legs))]) == 0
    output = capsys.readouterr().out
    assert 'only the leg in /a was reviewed, not what is in /b\n' in output
    assert '400 poses' not in output


def test_a_namespace_without_poses_is_passed_over(two_legs, make_run, capsys) -> None:
    (first,) = two_legs.others
    first.poses = replace(first.poses, name='/c/joint_states')
    two_legs.answers[7].pose[1] += 1e-3
    assert main([str(make_run(two_legs))]) == 1
    output = capsys.readouterr().out
    assert 'only the leg in /b was reviewed, not what is in /a, /c\n' in output
    assert 'FOUND resolve: 1 of 400 poses' in output


def test_a_leg_without_a_solver_of_its_namespace_takes_the_last(healthy, make_run, capsys) -> None:
    healthy.in_namespace('/a').namespace = '/elsewhere'
    assert main([str(make_run(healthy))]) == 0
    assert 'nothing found: every pose' in capsys.readouterr().out


def test_several_legs_of_one_solver_are_said_not_to_be_judged(
    make_script, make_run, capsys
) -> None:
    walker = make_script()
    walker.parameters['legs'] = ['front', 'rear']
    main([str(make_run(walker))])
    said = capsys.readouterr().out
    assert 'the run is of the legs front, rear: several legs are not judged yet' in said
