"""A geometry that changes during the run: what is older is not held against it."""

from klann_ros.kinematics import KlannGeometry
from klann_ros.review.command import main
import pytest

# Received 0.2 ms after it was published, as all messages of these runs.
LATENCY = 200_000
OTHER = KlannGeometry(l_ef=0.271)


@pytest.fixture
def changed(make_script):
    """Return a run whose first half was made with another geometry than its second."""
    run, second = make_script(OTHER), make_script()
    run.answers[200:] = second.answers[200:]
    run.add_solver(run.answers[200].stamp + LATENCY, second.geometry)
    return run


def test_only_poses_after_the_change_are_checked(changed, printed) -> None:
    output = printed(changed)
    line = 'the leg changed during the run; poses before 1.00 s were not judged\n'
    assert line in output
    assert 'nothing found: each of the 200 judged poses is the right one' in output


def test_a_wrong_pose_after_the_change_is_found(changed, printed) -> None:
    changed.answers[300].pose[2] += 1e-3
    output = printed(changed, code=1)
    assert 'ERROR closure: 1 of 200 poses' in output
    assert '(first at 1.500 s)' in output


def test_a_restart_with_the_same_geometry_is_not_a_change(healthy, printed) -> None:
    healthy.add_solver(healthy.answers[200].stamp, healthy.geometry)
    healthy.answers[100].pose[2] += 1e-3
    output = printed(healthy, code=1)
    assert 'ERROR closure: 1 of 400 poses' in output
    assert 'the leg changed' not in output


def test_a_given_geometry_holds_for_the_whole_run(changed, make_run, tmp_path, capsys) -> None:
    file = tmp_path / 'given.yaml'
    file.write_text('l_ab: 0.120\n')
    assert main([str(make_run(changed)), '--geometry', str(file)]) == 1
    output = capsys.readouterr().out
    assert 'ERROR closure: 200 of 400 poses' in output
    assert 'the leg changed' not in output


def test_an_input_before_the_change_is_not_judged_either(changed, printed) -> None:
    changed.unanswered = [(changed.answers[100].stamp + 1000, 1.0)]
    printed(changed)


def test_nothing_is_right_where_nothing_was_judged(healthy, printed) -> None:
    healthy.add_solver(healthy.answers[-1].stamp + 10**9, OTHER)
    output = printed(healthy)
    assert '\nnothing found, but no pose was judged\n' in output
    for figure in ('residual', 'angle, solved again', 'foot, by its angles'):
        assert f'worst {figure}'.ljust(27) + ' ' * 9 + '- ' in output
