"""recorder_node while its files are removed or changed: reported, never claimed, exit 1."""

from collections.abc import Iterator
import os
from pathlib import Path
import shutil
import signal
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import topic_counts
from klann_ros.review.reviewing import review_run
import pytest
from ros_domain import Domain, Process
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
import yaml

TOPIC = '/crank_angle'


class Recording:
    """A recorder of one topic, and its reports."""

    def __init__(self, stage: 'Stage', name: str) -> None:
        self.ros, self.statuses, self._publisher = stage.ros, stage.statuses, stage.publisher
        self.folder = self.ros.folder / name
        self.statuses.clear()
        self.process = self.ros.start(
            'recorder_node', output=self.folder, topics=f'[{TOPIC}]', flush_period=0.05
        )
        self.ros.probe.until(lambda: self._publisher.get_subscription_count() == 1)
        self.ros.probe.await_subscribers(self._publisher)

    def publish(self, file: str, count: int = 100) -> None:
        """Publish, and wait until that is in a file."""
        path = self.folder / file
        before = messages_in(path)
        for number in range(count):
            self._publisher.publish(Float64(data=float(number)))
        self.ros.probe.until(lambda: messages_in(path) == before + count)

    def remove(self, folder: Path) -> None:
        """Remove a folder while the recorder, which would create files in it, is stopped."""
        self.process.popen.send_signal(signal.SIGSTOP)
        shutil.rmtree(folder)
        self.process.popen.send_signal(signal.SIGCONT)

    def values(self) -> dict[str, str]:
        if not self.statuses:
            return {}
        return {value.key: value.value for value in self.statuses[-1].status[0].values}

    def until_error(self, text: str) -> None:
        """Wait until an error is in the log, once, and on /diagnostics."""
        self.ros.probe.until(lambda: f'[recorder_node]: {text}' in self.process.errors)
        assert self.process.errors.count(text) == 1
        self.statuses.clear()
        self.until_level(DiagnosticStatus.ERROR)
        assert text in self.statuses[-1].status[0].message

    def until_level(self, level: bytes) -> None:
        self.ros.probe.until(lambda: self.statuses and self.statuses[-1].status[0].level == level)

    def stop(self) -> dict[str, Any]:
        """End it; return its last line, and what a reader finds."""
        code = self.process.stop(signal.SIGINT)
        return {'code': code, 'last': self.process.errors.splitlines()[-1], **found(self.folder)}


def messages_in(path: Path) -> int:
    """Return how many messages are in a file, which may be on its way."""
    try:
        with open_log(path) as log:
            return len(list(log.messages([TOPIC])))
    except NotALogError:
        return 0


def found(run: Path) -> dict[str, Any]:
    """Return the content of a run, and its own records of it."""
    with open_log(run) as log:
        (record,) = log.metadata['klann_ros.loss']
    about = yaml.safe_load((run / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    return {
        'messages': messages_in(run),
        'count': topic_counts(record)[TOPIC],
        'metadata': about['message_count'],
        'files': about['relative_file_paths'],
    }


class Stage:
    """A domain with one publisher, in which one recorder after the other records."""

    def __init__(self, ros: Domain) -> None:
        self.ros = ros
        self.publisher = ros.probe.node.create_publisher(Float64, TOPIC, 2000)
        self.statuses = ros.probe.listen(DiagnosticArray, '/diagnostics')


@pytest.fixture(scope='module')
def stage(module_ros: Domain) -> Stage:
    return Stage(module_ros)


@pytest.fixture(autouse=True)
def ros(stage: Stage) -> Iterator[Domain]:
    """End the recorders of a test that has failed: the next one waits for its own alone."""
    yield stage.ros
    for process in stage.ros._processes:
        process.release()
    stage.ros._processes.clear()


def test_lost_files_are_reported_counted_and_replaced(stage: Stage) -> None:
    ros, recording = stage.ros, Recording(stage, 'first')
    folder = recording.folder
    recording.publish('first_0.mcap')
    (folder / 'first_0.mcap').unlink()
    recording.until_error('first_0.mcap was removed, moved or replaced while it was recorded')
    recording.publish('first_1.mcap')
    os.truncate(folder / 'first_1.mcap', 500)
    recording.until_error('first_1.mcap was cut off, overwritten or appended to while it was')
    recording.publish('first_2.mcap')
    assert ros.probe.call(Trigger, 'recorder_node/split', Trigger.Request()).success
    ros.probe.until((folder / 'first_3.mcap').exists)
    recording.publish('first_3.mcap')
    (folder / 'first_2.mcap').unlink()
    recording.until_error('finished files are gone or changed: first_2.mcap, with 100 messages')
    recording.publish('first_3.mcap')
    ros.probe.until(lambda: recording.values()[f'{TOPIC} received'] == '500')
    values = recording.values()
    assert (values[f'{TOPIC} written'], values[f'{TOPIC} lost']) == ('200', '300')
    end = recording.stop()
    assert end['code'] == 1
    assert f'200 messages of 1 topic are in {folder}; 300 were lost; first_1' in end['last']
    assert (end['messages'], end['metadata'], end['files']) == (200, 200, ['first_3.mcap'])
    count = end['count']
    assert (count.received, count.written, count.dropped, count.lost) == (500, 200, 300, 300)
    assert 'Traceback' not in recording.process.errors


def test_a_removed_folder_is_created_again_and_the_review_explains_the_loss(stage: Stage) -> None:
    recording = Recording(stage, 'second')
    recording.publish('second_0.mcap')
    recording.remove(recording.folder)
    recording.until_error('second_0.mcap was removed, moved or replaced')
    recording.publish('second_1.mcap')
    end = recording.stop()
    assert end['code'] == 1
    assert f'100 messages of 1 topic are in {recording.folder}; 100 were lost;' in end['last']
    assert (end['messages'], end['metadata'], end['files']) == (100, 100, ['second_1.mcap'])
    assert (end['count'].written, end['count'].dropped) == (100, 100)
    (lost,) = (f for f in review_run(recording.folder).findings if f.check == 'lost')
    assert lost.text.startswith(f'100 messages of {TOPIC} were lost')
    assert 'second_0.mcap was removed, moved or replaced' in lost.meaning


def test_a_file_lost_just_before_the_end_is_not_claimed(stage: Stage) -> None:
    recording = Recording(stage, 'third')
    recording.publish('third_0.mcap')
    (recording.folder / 'third_0.mcap').unlink()
    end = recording.stop()
    assert end['code'] == 1
    assert f'0 messages of 1 topic are in {recording.folder}; 100 were lost; thir' in end['last']
    assert (end['messages'], end['metadata'], end['count'].dropped) == (0, 0, 100)


def test_the_recording_ends_where_no_new_file_can_be_created(stage: Stage) -> None:
    ros, recording = stage.ros, Recording(stage, 'parent/fourth')
    recording.publish('fourth_0.mcap')
    recording.remove(ros.folder / 'parent')
    assert recording.process.wait() == 1
    last = recording.process.errors.splitlines()[-1]
    assert 'the recording stopped early: fourth_0.mcap was removed' in last
    assert 'no new file: No such file or directory' in last
    assert f'0 messages of 1 topic are in {recording.folder}; 100 were lost' in last
    assert 'recover' not in last
    assert 'Traceback' not in recording.process.errors
    recording.until_level(DiagnosticStatus.ERROR)
    assert not (ros.folder / 'parent').exists()


def test_of_two_recorders_of_one_run_one_records(ros: Domain) -> None:
    both: list[Process] = [
        ros.start('recorder_node', output=ros.folder / 'parents' / 'run') for _ in range(2)
    ]
    ros.probe.until(lambda: any(process.popen.poll() is not None for process in both))
    (loser,) = (process for process in both if process.popen.poll() is not None)
    (winner,) = (process for process in both if process is not loser)
    assert loser.wait() == 1
    folder = ros.folder / 'parents' / 'run'
    assert loser.errors == (
        f'recorder_node: {folder} exists already, not overwriting; choose a new name\n'
    )
    ros.probe.until(lambda: f'recording to {folder}' in winner.errors)
    assert winner.stop() == 0
    with open_log(folder) as log:
        assert log.complete, log.problem


def test_an_output_that_cannot_be_is_one_line(ros: Domain) -> None:
    os.mkfifo(ros.folder / 'pipe')
    (ros.folder / 'loop').symlink_to('loop')
    outputs = {
        'pipe/run': 'it is no folder, so no run can be made in it',
        'loop': 'exists already',
        'x' * 250: 'File name too long',
    }
    processes = {name: ros.start('recorder_node', output=ros.folder / name) for name in outputs}
    for name, process in processes.items():
        assert process.wait() == 1
        assert outputs[name] in process.errors
        assert process.errors.startswith('recorder_node: ')
        assert process.errors.count('\n') == 1
    assert not (ros.folder / ('x' * 250)).exists()
