"""The recorded lengths of a run, against measured points of its leg."""

from pathlib import Path
from typing import Any

from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_of
from measured_robots import crank_topic, DRAWN, points_topic, Robot, write_run
import pytest
from review_findings import checks, found

ROBOT = Robot(count=200, period=0.025)
SEM = robot_of('sem104')


def _run(folder: Path, robot: Robot = ROBOT, **topics: Any) -> Path:
    points = topics or {'h': points_topic(robot, 'H'), 'g': points_topic(robot, 'G')}
    named = {f'/mocap/{name}': content for name, content in points.items()}
    return write_run(folder / 'run', {'/crank_state': crank_topic(robot), **named})


def test_a_leg_that_was_built_otherwise_is_found(tmp_path: Path) -> None:
    texts = found(_run(tmp_path), robot=SEM)
    (text,) = [text for text in texts if text.startswith('dimensions: ')]
    assert 'mm, the file says' in text
    assert 'more dimensions' in text
    name, _, value, _, error, *_ = text.removeprefix('dimensions: ').split()
    true = ROBOT.linkage.dimensions[name] * (1e3 if name[1] == '_' else 57.29577951308232)
    assert abs(float(value) - true) < 5.0 * float(error) + 0.01


@pytest.mark.parametrize(
    'topics',
    [
        {},
        {'target': points_topic(ROBOT, 'H')},
        {'point_h': points_topic(ROBOT, 'H')},
        {'point_h': points_topic(ROBOT, 'H', 'geometry_msgs/msg/PoseStamped')},
        {'h': points_topic(ROBOT, 'H', 'tf2_msgs/msg/TFMessage')},
        {'h': points_topic(Robot(ROBOT.linkage, count=5), 'H')},
    ],
)
def test_no_other_points_are_a_finding(tmp_path: Path, topics: dict[str, Any]) -> None:
    robot = ROBOT if topics else Robot(DRAWN, phase=0.0, count=200, period=0.025)
    assert 'dimensions' not in checks(review_run(_run(tmp_path, robot, **topics), robot=SEM))


def test_a_calibration_run_needs_no_poses(tmp_path: Path) -> None:
    robot = Robot(DRAWN, phase=0.0, count=200, period=0.025)
    note = 'poses: there is no pose in the run: a calibration run, with points measured on '
    review = review_run(_run(tmp_path, robot), robot=SEM)
    assert review.is_healthy
    assert [f'{f.check}: {f.text}' for f in review.findings] == [note + '/mocap/g, /mocap/h']
    # Points alone calibrate nothing; a foot is that of a solver whose poses are missing.
    points = {'/mocap/h': points_topic(robot, 'H')}
    answered = {**points, '/crank_state': crank_topic(robot), '/point_h': points['/mocap/h']}
    for name, topics in (('points', points), ('answered', answered)):
        findings = review_run(write_run(tmp_path / name, topics), robot=SEM).findings
        assert findings[0].text == 'there is no pose in the run (no joint_states of a leg)', name
