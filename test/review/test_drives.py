"""Drives by ros2_control and by drivers are judged by what they are: drives.yaml."""

from pathlib import Path
from typing import Any

from drive_runs import ARRAY, DriveRun
from klann_ros.log.records import Message
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.reviewing import review_run
from leg_runs import filled, START, STORE, topic_of
import pytest
from review_findings import are_alike, timed
from yaml_tables import read_table

DRIVES = read_table(Path(__file__).with_name('drives.yaml'))


@pytest.mark.parametrize('drive', DRIVES.values(), ids=DRIVES)
def test_a_drive_has_its_findings(tmp_path: Path, drive: dict[str, Any]) -> None:
    review = review_run(DriveRun(**drive['run']).write(tmp_path / 'run'))
    lines = []
    for finding, line in zip(review.findings, timed(review), strict=True):
        lines.append(f'{finding.severity.name} {line}')
    assert are_alike(lines, drive['finds']), lines


def test_commands_for_more_cranks_than_any_robot_has_are_not_read(tmp_path: Path) -> None:
    # Each length would be other joints.
    run = DriveRun(solver=False)
    wide = topic_of('/wide_velocity_controller/commands', ARRAY)
    with RunWriter(tmp_path / 'run') as writer:
        for message in run.received():
            writer.write(message)
        for count in (2, 64, 65, 30_000):
            data = STORE.serialize_cdr(filled(ARRAY, {'data': [1.0] * count}), ARRAY)
            writer.write(Message(wide, bytes(data), START, START, 0))
    (walk,) = review_run(tmp_path / 'run').recording.walks
    assert len(walk.velocities) == 64
