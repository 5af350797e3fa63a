"""Drives by ros2_control and by drivers are judged by what they are: drives.yaml."""

from pathlib import Path
from typing import Any

from drive_runs import DriveRun
from klann_ros.review.reviewing import review_run
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
