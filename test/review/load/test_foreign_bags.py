"""Runs that other recorders stored: reviewed all the same, and what is missing is reported."""

from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from klann_ros.log.reader import open_log
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_from_file
from leg_runs import LegRun
import pytest
from review_findings import checks
from rosbag2_bags import convert, KINDS, NAMES, write_jazzy_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin

SEM104 = str(Path(__file__).parents[3] / 'config' / 'sem104.yaml')


def by_rosbags(run: Path, folder: Path) -> Path:
    return convert(run, folder, StoragePlugin.MCAP, CompressionMode.NONE)


def by_mcap(run: Path, folder: Path, *, knows_source: bool = True) -> Path:
    """Write a run without sequence numbers, and without source times of its own."""
    with open_log(run) as log:
        messages = [
            replace(m, publish_time=m.log_time if knows_source else 0) for m in log.messages()
        ]
    return write_jazzy_bag(folder.with_suffix('.mcap'), messages)


def without_source(run: Path, folder: Path) -> Path:
    return by_mcap(run, folder, knows_source=False)


@pytest.fixture(params=[by_rosbags, by_mcap, without_source], ids=lambda write: write.__name__)
def foreign(request, healthy, make_run, tmp_path):
    """Return what writes a run as another recorder would."""
    healthy.by_crank_state()
    return lambda: request.param(make_run(healthy), tmp_path / 'foreign')


def test_missing_data_is_reported(foreign, capsys) -> None:
    run = str(foreign())
    assert main([run]) == 1
    output = capsys.readouterr().out
    assert output.count('WARNING') == 1
    assert 'WARNING geometry: the run does not contain the geometry\n' in output
    assert 'give the leg by --geometry FILE, or one of sem104, patent, andrews' in output
    # There is neither a count nor a sequence number.
    lines = [line for line in output.splitlines() if line.startswith('/')][1:]
    assert len(lines) == 3
    assert all(line.endswith('  unknown') for line in lines)


def test_with_a_geometry_the_poses_are_judged(foreign, capsys) -> None:
    run = str(foreign())
    assert main([run, '--geometry', SEM104]) == 0
    assert 'nothing found: every pose is the right one' in capsys.readouterr().out


def test_a_wrong_pose_is_found_all_the_same(foreign, healthy) -> None:
    healthy.answers[100].pose[1] += 1e-3

    review = review_run(foreign(), robot=robot_from_file(SEM104))
    assert checks(review) == ['closure']
    assert review.findings[0].time == pytest.approx(0.5)


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run without its geometry: rosbag2 keeps no metadata of others."""
    return LegRun(count=600).write(tmp_path_factory.mktemp('runs') / 'run')


@pytest.fixture(scope='module')
def run_report(run: Path) -> dict[str, Any]:
    return report_of(run)


def report_of(log: Path) -> dict[str, Any]:
    report = log.parent / 'report.json'
    assert main([str(log), '--geometry', SEM104, '--json', str(report)]) == 0
    return json.loads(report.read_text())


@pytest.mark.parametrize('kind', KINDS, ids=NAMES)
def test_a_bag_of_any_kind_has_the_figures_of_the_run(
    kind: Any, run: Path, run_report: dict[str, Any], tmp_path: Path
) -> None:
    bag_report = report_of(convert(run, tmp_path / 'bag', *kind))
    assert bag_report['legs'] == run_report['legs']
    assert bag_report['findings'] == run_report['findings'] == []
    for topic, expected in zip(bag_report['topics'], run_report['topics'], strict=True):
        for key in ('name', 'count', 'rate', 'longest_gap'):
            assert topic[key] == expected[key]
        # Neither the source time nor a number of the message is in the bag.
        assert topic['latency_p50'] is None
        assert topic['lost'] is None


def test_cranks_without_a_source_time_are_not_called_unanswered(
    healthy: Any, make_run: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An answer has the stamp of its input, which for a plain number is the source time."""
    run = make_run(healthy)
    bag = convert(run, tmp_path / 'bag', StoragePlugin.SQLITE3, CompressionMode.NONE)
    assert main([str(bag), '--geometry', SEM104]) == 0
    assert 'not answered' not in capsys.readouterr().out
