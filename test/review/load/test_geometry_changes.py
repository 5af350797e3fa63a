"""A geometry that changes during the run: what is older is not held against it."""

from klann_ros.kinematics import KlannGeometry
from klann_ros.review.command import main

OTHER = KlannGeometry(l_ef=0.271)


def test_only_poses_after_the_change_are_checked(healthy, printed) -> None:
    healthy.change_leg(200, l_ef=0.271)
    output = printed(healthy)
    line = 'the leg changed during the run; poses before 1.00 s are not checked\n'
    assert line in output
    assert 'nothing found: each of the 200 checked poses is the right one' in output


def test_a_given_geometry_holds_for_the_whole_run(healthy, make_run, tmp_path, capsys) -> None:
    healthy.change_leg(200, l_ef=0.271)
    file = tmp_path / 'given.yaml'
    file.write_text('l_ab: 0.120\n')
    assert main([str(make_run(healthy)), '--geometry', str(file)]) == 1
    output = capsys.readouterr().out
    assert 'ERROR closure: 200 of 400 poses' in output
    assert 'the leg changed' not in output


def test_nothing_is_right_where_nothing_was_judged(healthy, printed) -> None:
    healthy.add_solver(healthy.answers[-1].stamp + 10**9, OTHER)
    output = printed(healthy, '--details')
    assert '\nnothing found, but no pose could be checked\n' in output
    for figure in ('residual', 'angle, solved again', 'foot, by its angles'):
        assert f'worst {figure}'.ljust(27) + ' ' * 9 + '- ' in output
