"""The picture of a run, also of one whose last pose cannot be drawn."""

import math

from klann_ros.review.command import main
import pytest


@pytest.mark.parametrize('alpha', [math.nan, math.inf, 1e7])
def test_the_last_pose_that_closes_is_drawn(
    healthy, make_run, tmp_path, capsys, *, monkeypatch, alpha
) -> None:
    drawn = []
    monkeypatch.setattr(
        'klann_ros.review.report.picture.plot_pose', lambda pose, **_: drawn.append(pose)
    )
    healthy.answers[-1].pose[0] = alpha
    main([str(make_run(healthy)), '--picture', str(tmp_path / 'leg.png')])
    capsys.readouterr()
    assert [pose.alpha for pose in drawn] == [healthy.answers[-2].alpha]


def test_a_leg_that_closes_nowhere_is_one_line(make_script, make_run, tmp_path, capsys) -> None:
    # All poses are at one angle, which the given leg cannot take.
    run = make_script(turns=0.0, count=10)
    for n in range(10):
        run.answers[n].pose[0] = math.pi
    file = tmp_path / 'short.yaml'
    file.write_text('l_dc: 0.12\n')
    out = tmp_path / 'leg.png'
    assert main([str(make_run(run)), '--geometry', str(file), '--picture', str(out)]) == 3
    error = capsys.readouterr().err
    reason = 'there is no pose in the run at which this leg can be drawn'
    assert error == f'review: --picture {out} cannot be written: {reason}\n'
    assert not out.exists()


def test_a_run_without_poses_has_no_picture(healthy, make_run, tmp_path, capsys) -> None:
    healthy.answers = []
    healthy.unanswered = [(1000, 1.0)]
    assert main([str(make_run(healthy)), '--picture', str(tmp_path / 'leg.png')]) == 3
    assert capsys.readouterr().err.count('\n') == 1


@pytest.mark.parametrize('ending', ['png', 'svg'])
def test_a_picture_shows_the_run(healthy, make_run, capsys, tmp_path, ending: str) -> None:
    picture = tmp_path / f'leg.{ending}'
    assert main([str(make_run(healthy)), '--picture', str(picture)]) == 0
    capsys.readouterr()
    start = {'png': b'\x89PNG', 'svg': b'<?xml'}[ending]
    assert picture.read_bytes().startswith(start)
    assert len(picture.read_bytes()) > 5000
