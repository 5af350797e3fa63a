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
        'klann_ros.review.report.data.plot_pose', lambda pose, **_: drawn.append(pose)
    )
    healthy.answers[-1].pose[0] = alpha
    main([str(make_run(healthy)), '--picture', str(tmp_path / 'leg.png')])
    capsys.readouterr()
    assert [pose.alpha for pose in drawn] == [healthy.answers[-2].alpha]


@pytest.mark.parametrize('count', [0, 10])
def test_a_run_without_a_pose_that_closes_has_no_picture(
    make_script, make_run, tmp_path, capsys, count
) -> None:
    # All poses are at one angle, which the given leg cannot take.
    run = make_script(turns=0.0, count=10)
    del run.answers[count:]
    run.unanswered = [(1000, 1.0)]
    for answer in run.answers:
        answer.pose[0] = math.pi
    file, out = tmp_path / 'short.yaml', tmp_path / 'leg.png'
    file.write_text('l_dc: 0.12\n')
    assert main([str(make_run(run)), '--geometry', str(file), '--picture', str(out)]) == 3
    reason = 'the leg closes at none of the recorded crank angles'
    assert capsys.readouterr().err == f'review: --picture {out} cannot be written: {reason}\n'
    assert not out.exists()


@pytest.mark.parametrize('ending', ['png', 'svg'])
def test_a_picture_shows_the_run(healthy, make_run, capsys, tmp_path, ending: str) -> None:
    picture = tmp_path / f'leg.{ending}'
    assert main([str(make_run(healthy)), '--picture', str(picture)]) == 0
    capsys.readouterr()
    start = {'png': b'\x89PNG', 'svg': b'<?xml'}[ending]
    assert picture.read_bytes().startswith(start)
    assert len(picture.read_bytes()) > 5000
