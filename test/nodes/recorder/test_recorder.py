"""recorder_node: services, status, ends, and the messages at its start."""

from fnmatch import fnmatchcase
import json
from pathlib import Path
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from klann_ros.log.bag_metadata import FILE_NAME as METADATA
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import recorded_pause, topic_counts
from klann_ros.nodes.recorder.interface import TOPICS
from klann_ros.review.reviewing import review_run
import pytest
from recorder_runs import numbers, Recording, TOPIC
from ros_domain import Domain, IS_FAST_DDS_3, Process, RecorderReports


def split(recording: Recording) -> str:
    answers: list[Any] = []
    call = recording.call
    # What has just been published need not be in the file yet.
    recording.ros.probe.until(lambda: answers.append(call('split')) or answers[-1].success)
    return str(answers[-1].message)


def metadata(path: Path) -> dict[str, list[dict[str, str]]]:
    with open_log(path) as log:
        return log.metadata


@pytest.fixture(scope='module')
def seen(module_ros: Domain) -> dict[str, Any]:
    """Return observations of a recording that was split twice, and paused in between."""
    recording = Recording(module_ros)
    seen: dict[str, Any] = {'folder': recording.folder, 'early split': recording.call('split')}
    module_ros.start('solver_node')
    module_ros.probe.until(lambda: 'klann_ros.solver' in metadata(recording.folder))
    recording.publish()
    seen['first'] = split(recording)
    recording.publish()
    recording.until_received()
    seen['answers'] = [recording.call('pause') for _ in range(2)]
    recording.until_value('paused', 'true')
    recording.publish(70)
    recording.until_received()
    seen['answers'] += [recording.call('resume') for _ in range(2)]
    recording.publish()
    seen['second'] = split(recording)
    recording.publish()
    recording.until_value(f'{TOPIC} written', 400)
    # A report may fall between the file's name and its counters.
    recording.until_value('file', recording.folder / 'run_2.mcap')
    seen['status'], seen['values'] = recording.reports.statuses[-1], recording.reports.values
    # A hangup finishes the run.
    assert recording.process.stop(signal.SIGHUP) == 0
    assert 'Traceback' not in recording.process.errors
    return seen


def test_a_split_answers_with_the_name_of_the_file_that_follows(seen: dict[str, Any]) -> None:
    assert seen['first'] == 'run_1.mcap'
    assert seen['second'] == 'run_2.mcap'
    assert not seen['early split'].success
    assert 'no message in run_0.mcap yet' in seen['early split'].message


def test_no_message_is_lost_doubled_or_moved_by_a_split(seen: dict[str, Any]) -> None:
    folder = seen['folder']
    recorded = [*range(200), *range(270, 470)]
    assert numbers(folder) == recorded
    assert [number for n in range(3) for number in numbers(folder / f'run_{n}.mcap')] == recorded


def test_every_file_of_a_split_run_has_solver_and_recorder(seen: dict[str, Any]) -> None:
    for path in (*seen['folder'].glob('*.mcap'), seen['folder']):
        with open_log(path) as log:
            (recorder,) = log.metadata['klann_ros.recorder']
            (solver,) = log.metadata['klann_ros.solver']
            assert log.complete, log.problem
            assert [attachment.name for attachment in log.attachments] == ['solver_node.yaml']
        assert {'version', 'python', 'rclpy', 'rmw', 'mcap', 'host'} <= set(recorder)
        assert json.loads(solver['parameters'])['l_gh'] == 0.43


def test_a_pause_is_in_the_run_with_its_skipped_messages(seen: dict[str, Any]) -> None:
    answers = [(answer.success, answer.message) for answer in seen['answers']]
    texts = ['paused', 'already paused', 'recording again', 'already recording']
    assert answers == [(True, text) for text in texts]
    with open_log(seen['folder']) as log:
        (record,) = log.metadata['klann_ros.pause']
        (losses,) = log.metadata['klann_ros.loss']
        times = [message.log_time for message in log.messages([TOPIC])]
    pause = recorded_pause(record)
    count = topic_counts(losses)[TOPIC]
    assert pause.skipped[TOPIC] == 70
    assert not [time for time in times if pause.begin <= time < pause.end]
    assert times[199] < pause.begin < pause.end <= times[200]
    assert (count.received, count.written, count.skipped, count.lost) == (470, 400, 70, 0)


def test_the_status_has_the_counters_and_the_file(seen: dict[str, Any]) -> None:
    status, values = seen['status'], seen['values']
    assert status.name == 'recorder_node: recording'
    assert (status.level, status.message) == (DiagnosticStatus.OK, 'recording')
    assert values[f'{TOPIC} received'] == '470'
    assert values[f'{TOPIC} lost'] == '0'
    assert values['file'] == str(seen['folder'] / 'run_2.mcap')
    assert int(values['size']) > 0
    assert int(values['free']) > 0
    assert values['paused'] == 'false'
    assert int(values['queued']) >= 0


@pytest.mark.parametrize('limit', [{'max_file_size': 20_000}, {'max_file_duration': 0.3}])
def test_a_file_that_has_reached_its_limit_is_followed_by_another(
    ros: Domain, limit: dict[str, Any]
) -> None:
    recording = Recording(ros, compression='none', flush_period=0.05, **limit)

    def several_files() -> bool:
        # What arrives at once is written at once, however large a file becomes by it.
        recording.publish()
        recording.until_received()
        return len(list(recording.folder.glob('*.mcap'))) >= 3

    ros.probe.until(several_files)
    assert recording.process.stop(signal.SIGTERM) == 0
    assert numbers(recording.folder) == list(range(recording.next))


def test_a_lost_message_is_a_warning_and_in_the_run(ros: Domain) -> None:
    recording = Recording(ros)
    recording.publish(10)
    # Nobody can take what a shallow queue has overwritten.
    recording.process.popen.send_signal(signal.SIGSTOP)
    recording.publish(5000)
    recording.process.popen.send_signal(signal.SIGCONT)
    recording.publish(10)
    recording.until_level(DiagnosticStatus.WARN)
    recording.until_received()
    assert recording.process.stop() == 0
    with open_log(recording.folder) as log:
        count = topic_counts(log.metadata['klann_ros.loss'][0])[TOPIC]
    recorded = numbers(recording.folder)
    assert recorded == sorted(set(recorded))
    assert count.written == len(recorded)
    assert count.lost == recording.next - len(recorded) > 0


def test_losses_of_departed_publishers_are_not_excluded(ros: Domain) -> None:
    recorder = ros.start('recorder_node', output=ros.folder / 'run')
    reports = RecorderReports(ros.probe)
    for _ in range(3):
        crank = ros.start('crank_node', revolutions=1, speed=30.0, min_subscribers=1)
        assert crank.wait() == 0
    left = {f'{TOPIC} lost': '0', f'{TOPIC} publishers left': '3'}
    ros.probe.until(lambda: left.items() <= reports.values.items())
    assert recorder.stop() == 0
    losses = f'at least 0 were lost; 3 publishers left ({TOPIC}): losses at their end cannot be '
    assert f'; {losses}detected' in recorder.errors
    review = review_run(ros.folder / 'run')
    (topic,) = review.topics
    # A crank that waits for its subscribers loses no first message.
    assert (topic.lost, topic.early, topic.publishers_left) == (0, 0, 3)
    notes = [finding.text for finding in review.findings if finding.check == 'lost']
    assert notes == [f'3 publishers of {TOPIC} left during the run']


def test_an_unfinished_run_beside_it_is_named_at_start(ros: Domain) -> None:
    first: Process = ros.start('recorder_node', output=ros.folder / 'left')
    ros.probe.until(lambda: 'recording to' in first.errors)
    second = ros.start('recorder_node', output=ros.folder / 'second')
    ros.probe.until(lambda: 'recording to' in second.errors)
    # As long as it is in hand it is not unfinished.
    assert 'was not finished' not in second.errors
    first.kill()
    third = ros.start('recorder_node', output=ros.folder / 'third')
    ros.probe.until(lambda: 'recording to' in third.errors)
    left = ros.folder / 'left'
    assert f'{left} was not finished; `recover {left}` repairs it' in third.errors
    assert third.errors.count('was not finished') == 1


def test_a_killed_recorder_leaves_all_but_its_last_second(ros: Domain) -> None:
    ros.start('crank_node', rate=100.0)
    ros.start('solver_node')
    topics = {'/crank_angle', '/joint_states', '/point_h'}
    for number, moment in enumerate((0.1, 0.7)):
        folder = ros.folder / f'run_{number}'
        recorder = ros.start('recorder_node', output=folder, all_topics='true')
        ros.probe.until(lambda folder=folder: ros.probe.spin(0.1) or topics <= topics_in(folder))
        ros.probe.spin(moment)
        end = time.time_ns()
        recorder.kill()
        assert {path.name for path in folder.iterdir()} == {f'{folder.name}_0.mcap', METADATA}
        with open_log(folder) as log:
            assert not log.complete
            for topic in topics:
                messages = list(log.messages([topic]))
                assert end - messages[-1].log_time < 10**9
                sequences = [message.sequence for message in messages]
                if IS_FAST_DDS_3:
                    # What was sent before both sides knew each other comes after what follows it.
                    sequences.sort()
                # In order, each once; what the middleware loses is not the kill's doing.
                assert sequences == sorted(set(sequences))


def topics_in(folder: Path) -> set[str]:
    try:
        with open_log(folder) as log:
            return {topic.name for topic in log.topics}
    except NotALogError:
        return set()


@pytest.mark.parametrize(
    'name',
    [
        'joint_state_broadcaster/joint_states',
        'imu_sensor_broadcaster/imu',
        'crank_velocity_controller/commands',
        'crank_trajectory_controller/joint_trajectory',
        'crank_angle/lease',
    ],
)
def test_what_a_review_reads_of_ros2_control_is_recorded_by_default(name: str) -> None:
    assert any(fnmatchcase(name, pattern) for pattern in TOPICS)
