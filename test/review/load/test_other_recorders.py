"""Runs of other recorders are reviewed all the same, and what is missing is said."""

from pathlib import Path

from findings import checks
from klann_ros.log.reader import open_log
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_from_file
from mcap.writer import Writer as McapWriter
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

ROOT = Path(__file__).resolve().parents[3]
STORE = get_typestore(Stores.ROS2_JAZZY)
SEM104 = str(ROOT / 'config' / 'sem104.yaml')


def messages(run):
    with open_log(run) as log:
        return list(log.messages())


def by_rosbags(run, folder: Path) -> Path:
    """Write the messages of a run as rosbags does: without numbers and without our records."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connections = {}
        for message in messages(run):
            topic = message.topic
            if topic.name not in connections:
                added = bag.add_connection(topic.name, topic.type, typestore=STORE)
                connections[topic.name] = added
            bag.write(connections[topic.name], message.log_time, message.data)
    return folder


def by_mcap(run, folder: Path, *, knows_source: bool = True) -> Path:
    """Write them as a plain writer does that knows no numbers, and one time at most."""
    path = folder.with_suffix('.mcap')
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.start('ros2')
        channels = {}
        for message in messages(run):
            topic = message.topic
            if topic.name not in channels:
                definition = topic.definition.encode()
                schema = writer.register_schema(topic.type, 'ros2msg', definition)
                channels[topic.name] = writer.register_channel(topic.name, 'cdr', schema)
            time = message.log_time
            source = time if knows_source else 0
            writer.add_message(channels[topic.name], time, message.data, source, 0)
        writer.finish()
    return path


def without_source(run, folder: Path) -> Path:
    return by_mcap(run, folder, knows_source=False)


@pytest.fixture(params=[by_rosbags, by_mcap, without_source], ids=lambda write: write.__name__)
def foreign(request, healthy, make_run, tmp_path):
    """Return what writes a run as another recorder would."""
    healthy.by_crank_state()
    return lambda: request.param(make_run(healthy), tmp_path / 'foreign')


def test_what_is_missing_is_said(foreign, capsys) -> None:
    run = str(foreign())
    assert main([run]) == 1
    output = capsys.readouterr().out
    assert output.count('WARNING') == 1
    assert 'WARNING geometry: the run does not contain the geometry\n' in output
    assert 'give the leg by --geometry FILE, or one of sem104, patent, andrews' in output
    # Nobody counted, and no number tells.
    lines = [line for line in output.splitlines() if line.startswith('/')][1:]
    assert len(lines) == 3
    assert all(line.endswith(' ?') for line in lines)


def test_with_a_geometry_the_poses_are_judged(foreign, capsys) -> None:
    run = str(foreign())
    assert main([run, '--geometry', SEM104]) == 0
    assert 'nothing found: every pose is the right one' in capsys.readouterr().out


def test_a_wrong_pose_is_found_all_the_same(foreign, healthy) -> None:
    healthy.answers[100].pose[1] += 1e-3

    review = review_run(foreign(), robot=robot_from_file(SEM104))
    assert checks(review) == ['closure']
    assert review.findings[0].time == pytest.approx(0.5)
