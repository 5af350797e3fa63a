"""recorder_node while its files are removed or changed: reported, never claimed, exit 1."""

import os
from pathlib import Path
import shutil
import signal
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import topic_counts
from klann_ros.review.reviewing import review_run
from recorder_runs import numbers, Recording, TOPIC
from ros_domain import Domain, Process
import yaml


class Faulty(Recording):
    """A recording whose files are damaged meanwhile."""

    def __init__(self, ros: Domain, name: str) -> None:
        super().__init__(ros, name, topics=f'[{TOPIC}]', flush_period=0.05)

    def fill(self, file: str) -> None:
        """Publish, and wait until that is in a file."""
        path = self.folder / file
        first_count = len(numbers(path))
        self.publish()
        self.ros.probe.until(lambda: len(numbers(path)) == first_count + 100)

    def remove(self, folder: Path) -> None:
        """Remove a folder while the recorder, which would create files in it, is stopped."""
        self.process.popen.send_signal(signal.SIGSTOP)
        shutil.rmtree(folder)
        self.process.popen.send_signal(signal.SIGCONT)

    def until_error(self, text: str) -> None:
        """Wait until an error is in the log, once, and on /diagnostics."""
        self.ros.probe.until(lambda: f'[recorder_node]: {text}' in self.process.errors)
        assert self.process.errors.count(text) == 1
        self.ros.probe.until(
            lambda: any(
                status.level == DiagnosticStatus.ERROR and text in status.message
                for status in self.reports.statuses
            )
        )

    def stop(self) -> dict[str, Any]:
        """End it; return its last line, and what a reader finds."""
        code = self.process.stop(signal.SIGINT)
        return {'code': code, 'last': self.process.errors.splitlines()[-1], **found(self.folder)}


def found(run: Path) -> dict[str, Any]:
    """Return the content of a run, and its own records of it."""
    with open_log(run) as log:
        (record,) = log.metadata['klann_ros.loss']
    about = yaml.safe_load((run / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    return {
        'messages': len(numbers(run)),
        'count': topic_counts(record)[TOPIC],
        'metadata': about['message_count'],
        'files': about['relative_file_paths'],
    }


def test_lost_files_are_reported_counted_and_replaced(ros: Domain) -> None:
    recording = Faulty(ros, 'first')
    folder = recording.folder
    recording.fill('first_0.mcap')
    (folder / 'first_0.mcap').unlink()
    recording.until_error('first_0.mcap was removed, moved or replaced while it was recorded')
    recording.fill('first_1.mcap')
    os.truncate(folder / 'first_1.mcap', 500)
    recording.until_error('first_1.mcap was cut off, overwritten or appended to while it was')
    recording.fill('first_2.mcap')
    assert recording.call('split').success
    ros.probe.until((folder / 'first_3.mcap').exists)
    recording.fill('first_3.mcap')
    (folder / 'first_2.mcap').unlink()
    recording.until_error('finished files are gone or changed: first_2.mcap, with 100 messages')
    recording.fill('first_3.mcap')
    ros.probe.until(lambda: recording.reports.values[f'{TOPIC} received'] == '500')
    values = recording.reports.values
    assert (values[f'{TOPIC} written'], values[f'{TOPIC} lost']) == ('200', '300')
    end = recording.stop()
    assert end['code'] == 1
    assert f'200 messages of 1 topic are in {folder}; 300 were lost; first_1' in end['last']
    assert (end['messages'], end['metadata'], end['files']) == (200, 200, ['first_3.mcap'])
    count = end['count']
    assert (count.received, count.written, count.dropped, count.lost) == (500, 200, 300, 300)
    assert 'Traceback' not in recording.process.errors


def test_a_removed_folder_is_created_again_and_the_review_explains_the_loss(ros: Domain) -> None:
    recording = Faulty(ros, 'second')
    recording.fill('second_0.mcap')
    recording.remove(recording.folder)
    recording.until_error('second_0.mcap was removed, moved or replaced')
    recording.fill('second_1.mcap')
    end = recording.stop()
    assert end['code'] == 1
    assert f'100 messages of 1 topic are in {recording.folder}; 100 were lost;' in end['last']
    assert (end['messages'], end['metadata'], end['files']) == (100, 100, ['second_1.mcap'])
    assert (end['count'].written, end['count'].dropped) == (100, 100)
    (lost,) = (f for f in review_run(recording.folder).findings if f.check == 'lost')
    assert lost.text.startswith(f'100 messages of {TOPIC} were lost')
    assert 'second_0.mcap was removed, moved or replaced' in lost.meaning


def test_a_file_lost_just_before_the_end_is_not_claimed(ros: Domain) -> None:
    recording = Faulty(ros, 'third')
    recording.fill('third_0.mcap')
    (recording.folder / 'third_0.mcap').unlink()
    end = recording.stop()
    assert end['code'] == 1
    assert f'0 messages of 1 topic are in {recording.folder}; 100 were lost; thir' in end['last']
    assert (end['messages'], end['metadata'], end['count'].dropped) == (0, 0, 100)


def test_the_recording_ends_where_no_new_file_can_be_created(ros: Domain) -> None:
    recording = Faulty(ros, 'parent/fourth')
    recording.fill('fourth_0.mcap')
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
    recorders: list[Process] = [
        ros.start('recorder_node', output=ros.folder / 'parents' / 'run') for _ in range(2)
    ]
    ros.probe.until(lambda: any(process.popen.poll() is not None for process in recorders))
    (loser,) = (process for process in recorders if process.popen.poll() is not None)
    (winner,) = (process for process in recorders if process is not loser)
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
