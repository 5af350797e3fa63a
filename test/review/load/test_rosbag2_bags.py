"""A run says the same of its legs, whichever way rosbag2 has stored it."""

import json
from pathlib import Path
from typing import Any

from klann_ros.review.command import main
from leg_runs import LegRun
import pytest
from rosbag2_bags import convert, KINDS, NAMES
from rosbags.rosbag2 import CompressionMode, StoragePlugin

GEOMETRY = Path(__file__).parents[3] / 'config' / 'sem104.yaml'


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run that does not tell its geometry: rosbag2 keeps no metadata of others."""
    return LegRun(count=600).write(tmp_path_factory.mktemp('runs') / 'run')


@pytest.fixture(scope='module')
def wanted(run: Path) -> dict[str, Any]:
    return review_recording(run)


def review_recording(log: Path) -> dict[str, Any]:
    report = log.parent / 'report.json'
    assert main([str(log), '--geometry', str(GEOMETRY), '--json', str(report)]) == 0
    found: dict[str, Any] = json.loads(report.read_text())
    return found


@pytest.mark.parametrize('kind', KINDS, ids=NAMES)
def test_a_bag_of_any_kind_has_the_figures_of_the_run(
    kind: Any, run: Path, wanted: dict[str, Any], tmp_path: Path
) -> None:
    found = review_recording(convert(run, tmp_path / 'bag', *kind))
    assert found['legs'] == wanted['legs']
    assert found['findings'] == wanted['findings'] == []
    for topic, recorder_findings in zip(found['topics'], wanted['topics'], strict=True):
        for key in ('name', 'count', 'rate', 'longest_gap'):
            assert topic[key] == recorder_findings[key]
        # Neither the source time nor a number of the message is in the bag.
        assert topic['latency_p50'] is None
        assert topic['lost'] is None


def test_cranks_without_a_source_time_are_not_called_unanswered(
    healthy: Any, make_run: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An answer has the stamp of its question, which for a plain number is the source time."""
    run = make_run(healthy)
    bag = convert(run, tmp_path / 'bag', StoragePlugin.SQLITE3, CompressionMode.NONE)
    assert main([str(bag), '--geometry', str(GEOMETRY)]) == 0
    assert 'not answered' not in capsys.readouterr().out
