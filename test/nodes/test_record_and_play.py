"""A run recorded and played back: its content for every reader, and the same bytes again."""

import json
from pathlib import Path
import resource
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import Log, open_log
from klann_ros.log.run_parameters import solver_parameters, topic_counts
from klann_ros.nodes.player.node import main as player_main
from klann_ros.nodes.solver.node import SolverNode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rclpy.executors import SingleThreadedExecutor
from recorder_runs import numbers
from ros_domain import Domain, Process, RecorderReports
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
import yaml

TURNS = 2
RATE = 200.0
COUNT = round(TURNS * RATE) + 1
TOPICS = ['/crank_state', '/joint_states', '/point_h', '/velocity_h']


def record(ros: Domain, folder: Path, **parameters: object) -> Process:
    """Let the three nodes make a run; return the recorder, finished."""
    solver = ros.solver()
    poses = ros.probe.listen(JointState, 'joint_states')
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=folder, **parameters)
    ros.probe.await_publishers('joint_states')
    # The recorder has to listen to the solver, too, before the crank turns.
    ros.probe.until(lambda: ros.probe.node.count_subscribers('velocity_h') >= 1)
    # Whom the solver has answered it knows.
    ros.probe.until(lambda: solver_lengths(folder))
    crank = ros.start(
        'crank_node', output='crank_state', rate=RATE, revolutions=TURNS, min_subscribers=2
    )
    ros.probe.until(lambda: len(poses) >= COUNT)
    assert crank.wait() == 0
    reports.until_received(dict.fromkeys(TOPICS, COUNT))
    # Until it has noticed that the crank left, it says that all losses were seen.
    reports.until('/crank_state publishers left', 1)
    assert recorder.stop() == 0
    assert solver.stop() == 0
    return recorder


def by_topic(log: Log) -> dict[str, list[bytes]]:
    return {
        topic.name: [message.data for message in log.messages([topic.name])]
        for topic in log.topics
    }


@pytest.fixture(scope='module')
def recorded_run(module_ros: Domain) -> Path:
    """Return a run that the three nodes made; the tests only read it."""
    folder = module_ros.folder / 'run'
    recorder = record(module_ros, folder)
    assert f'messages of 7 topics are in {folder}; at least 0 were lost' in recorder.errors
    return folder


def test_a_run_opens_in_rosbags_with_all_messages(recorded_run: Path) -> None:
    leg = KlannLeg()
    with AnyReader([recorded_run]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        assert {topic: counts[topic] for topic in TOPICS} == dict.fromkeys(TOPICS, COUNT)
        for connection, _, data in reader.messages():
            if connection.topic == '/joint_states':
                pose = reader.deserialize(data, connection.msgtype)
                expected = leg.closed_form(pose.position[0]).x
                assert pose.position[1:] == pytest.approx(expected, abs=1e-9)
                assert len(pose.velocity) == 5


def test_a_run_opens_in_mcap_ros2_support_with_all_messages(recorded_run: Path) -> None:
    (path,) = recorded_run.glob('*.mcap')
    assert path.name == 'run_0.mcap'
    with path.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = list(reader.iter_decoded_messages(topics=['/point_h']))
    assert len(decoded) == COUNT
    sequences = [message.sequence for _, _, message, _ in decoded]
    assert sequences == list(range(1, COUNT + 1))
    for _, channel, message, foot in decoded:
        assert foot.header.frame_id == 'leg_plane'
        assert channel.metadata['topic_type_hash'].startswith('RIHS01_')
        (qos,) = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        assert qos['reliability'] == 'reliable'
        assert 0 < message.publish_time <= message.log_time


def test_a_run_explains_itself(recorded_run: Path) -> None:
    with open_log(recorded_run) as log:
        (record_,) = log.metadata['klann_ros.solver']
        (attachment,) = log.attachments
        assert log.complete
        counts = topic_counts(log.metadata['klann_ros.loss'][0])
        assert {name: count.lost for name, count in counts.items()} == {
            **dict.fromkeys(TOPICS, 0),
            '/diagnostics': 0,
            '/leg_description': 0,
            '/markers': 0,
        }
    assert record_['node'] == '/solver_node'
    parameters = json.loads(record_['parameters'])
    geometry = KlannGeometry().as_dict()
    assert {name: parameters[name] for name in geometry} == geometry
    assert attachment.name == 'solver_node.yaml'
    file = yaml.safe_load(attachment.data)
    assert file['/solver_node']['ros__parameters'] == parameters


def test_a_run_is_played_and_recorded_again_byte_for_byte(
    ros: Domain, recorded_run: Path, tmp_path: Path
) -> None:
    again = tmp_path / 'again'
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=again)
    player = ros.start(
        'player_node', str(recorded_run), '--rate', '2', '--delay', '0', '--start-paused'
    )
    # It hears them as soon as they are there; they have to know of it, too.
    ros.probe.until(lambda: all(ros.probe.node.count_subscribers(topic) >= 1 for topic in TOPICS))
    ros.probe.spin(2.0)
    assert ros.probe.call(Trigger, 'player_node/resume', Trigger.Request()).success
    assert player.wait() == 0
    reports.until_received(dict.fromkeys(TOPICS, COUNT))
    assert recorder.stop() == 0
    with open_log(recorded_run) as first, open_log(again) as second:
        assert by_topic(first) == by_topic(second)


def test_a_part_of_a_run_is_played_under_other_names(ros: Domain, recorded_run: Path) -> None:
    plain = ros.probe.listen(JointState, '/joint_states')
    renamed = ros.probe.listen(JointState, '/replay/legs')
    with open_log(recorded_run) as log:
        poses = list(log.messages(['/joint_states']))
        offset = (poses[100].log_time - log.start_time) / 1e9
        expected = [m for m in poses if 0 <= m.log_time - poses[100].log_time <= 10**9]
    player = ros.start(
        'player_node',
        str(recorded_run),
        *('--topics', 'joint_states', '--remap', 'joint_states:=legs'),
        *('--start-offset', f'{offset:.9f}', '--duration', '1', '--delay', '0'),
        '--start-paused',
        *('--ros-args', '-r', '__ns:=/replay'),
    )
    ros.probe.await_publishers('/replay/legs')
    assert ros.probe.call(Trigger, '/replay/player_node/resume', Trigger.Request()).success
    assert player.wait() == 0
    ros.probe.until(lambda: len(renamed) >= len(expected) - 1)
    ros.probe.spin(0.3)
    assert plain == []
    # Microseconds decide at the edges.
    assert len(renamed) == pytest.approx(len(expected), abs=1)
    assert len(expected) > 50


def test_a_non_log_file_is_exit_code_2_and_one_line(ros: Domain, tmp_path: Path) -> None:
    path = tmp_path / 'text'
    path.write_text('hello')
    player = ros.start('player_node', str(path))
    assert player.wait() == 2
    assert player.errors.startswith(f'player_node: {path} is not a readable log')
    assert player.errors.count('\n') == 1


def test_only_the_selected_topics_are_recorded(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    crank = ros.probe.node.create_publisher(Float64, 'crank_angle', 10)
    publisher = ros.probe.node.create_publisher(Float64, 'my/number', 10)
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=folder, topics='["my/*"]', compression='lz4')
    ros.probe.await_subscribers(publisher)
    for number in range(10):
        publisher.publish(Float64(data=float(number)))
        crank.publish(Float64(data=0.0))
    reports.until_received({'/my/number': 10})
    assert recorder.stop(signal.SIGTERM) == 0
    with open_log(folder) as log:
        assert {name: len(data) for name, data in by_topic(log).items()} == {'/my/number': 10}


def test_queued_messages_are_recorded_at_the_end(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    publisher = ros.probe.node.create_publisher(Float64, 'crank_angle', 2000)
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=folder)
    ros.probe.await_subscribers(publisher)
    publisher.publish(Float64(data=0.0))
    # The publisher may know the recorder before the recorder knows it, on a busy machine.
    reports.until_received({'/crank_angle': 1})
    for number in range(1, 1000):
        publisher.publish(Float64(data=float(number)))
        if number % 100 == 0:
            # For what receives them to have the processor, before the last hundred wait.
            time.sleep(0.03)
    assert recorder.stop() == 0
    recorded = numbers(folder)
    assert recorded == [float(number) for number in range(len(recorded))]
    assert len(recorded) > 1


def test_changes_of_a_leg_and_a_new_solver_are_in_the_run(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    right = 'right.l_gh'
    left = 'left.l_gh'
    recorder = ros.start('recorder_node', output=folder)
    solver = ros.start('solver_node', legs='[left, right]')
    ros.probe.until(lambda: len(solver_lengths(folder, right)) == 1)
    # The present value is no change.
    assert ros.probe.set_parameters('solver_node', {right: 0.43}).successful
    ros.probe.spin(0.5)
    assert ros.probe.set_parameters('solver_node', {right: 0.5}).successful
    ros.probe.until(lambda: len(solver_lengths(folder, right)) == 2)
    assert solver.stop() == 0
    ros.start('solver_node', **{'legs': '[left, right]', right: 0.6})
    ros.probe.until(lambda: len(solver_lengths(folder, right)) == 3)
    assert recorder.stop() == 0
    assert solver_lengths(folder, right) == [0.43, 0.5, 0.6]
    assert solver_lengths(folder, left) == [0.43, 0.43, 0.43]


def test_a_lost_answer_of_a_solver_is_requested_again(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    recorder = ros.start('recorder_node', output=folder)
    solver = SolverNode(context=ros.probe.context)
    executor = SingleThreadedExecutor(context=ros.probe.context)
    (service,) = [s for s in solver.services if s.srv_name.endswith('/list_parameters')]
    # This request is taken and never answered; the node takes those that come after it.
    request_type = service.srv_type.Request
    ros.probe.until(lambda: service.handle.service_take_request(request_type)[0] is not None)
    executor.add_node(solver)
    ros.probe.until(lambda: executor.spin_once(timeout_sec=0.0) or solver_lengths(folder))
    assert recorder.stop() == 0
    assert solver_lengths(folder) == [0.43]
    executor.shutdown()
    solver.destroy_node()


def solver_lengths(folder: Path, name: str = 'l_gh') -> list[float]:
    """Return a length of each solver record in a run that may still be written."""
    try:
        with open_log(folder) as log:
            records = log.metadata.get('klann_ros.solver', [])
    except NotALogError:
        return []
    return [solver_parameters(record).parameters[name] for record in records]


def test_messages_before_discovery_are_reported_and_not_lost(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=folder)
    first = ros.probe.publisher(Float64, 'crank_angle')
    for number in range(5):
        first.publish(Float64(data=float(number)))
    reports.until_received({'/crank_angle': 5})
    # The publishers are looked at as often as it reports.
    reports.until_reports(4)
    ros.probe.node.destroy_publisher(first)
    reports.until('/crank_angle publishers left', 1)
    # As long as it stands still it cannot hear of anybody new, and others can.
    recorder.popen.send_signal(signal.SIGSTOP)
    received = ros.probe.listen(Float64, 'crank_angle')
    second = ros.start('crank_node', rate=1000.0)
    ros.probe.until(lambda: len(received) > 100)
    recorder.popen.send_signal(signal.SIGCONT)
    reports.until_received({'/crank_angle': 5 + 100})
    reports.until('/crank_angle sent before discovery', 1)
    assert recorder.stop() == 0
    second.stop()
    with open_log(folder) as log:
        numbers = [message.sequence for message in log.messages(['/crank_angle'])][5:]
        count = topic_counts(log.metadata['klann_ros.loss'][0])['/crank_angle']
    assert numbers[0] > 1
    lost = numbers[-1] - numbers[0] + 1 - len(numbers)
    assert (count.lost, count.before_discovery, count.departed) == (lost, numbers[0] - 1, 1)
    early = f'{count.before_discovery} were sent before the recorder discovered their publishers'
    assert f'; {early}; 1 publisher left (/crank_angle): losses at' in recorder.errors


def test_a_full_disk_ends_the_recording_with_a_readable_run(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    statuses = ros.probe.listen(DiagnosticArray, '/diagnostics')
    # No file of this process may grow beyond 200 kB, nor of what it starts itself.
    ros.fresh = True
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limits[1]))
    try:
        recorder = ros.start('recorder_node', output=folder, compression='none')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        ros.fresh = False
    ros.probe.await_publishers('/diagnostics')
    ros.start('crank_node', rate=1000.0)
    assert recorder.wait() == 1
    assert 'the recording stopped early: [Errno 27] File too large' in recorder.errors
    assert f'`recover {folder}` finishes the run' in recorder.errors
    assert 'Traceback' not in recorder.errors
    ros.probe.until(lambda: statuses and statuses[-1].status[0].level == DiagnosticStatus.ERROR)
    assert 'File too large' in statuses[-1].status[0].message
    with open_log(folder) as log:
        written = len(list(log.messages()))
    assert written > 1000
    assert f'{written} messages of 1 topic are in {folder}' in recorder.errors


@pytest.mark.parametrize(
    ('arguments', 'warning', 'code'),
    [
        (['--topics', '/nope'], 'has /crank_state, /diagnostics', 1),
        (
            ['--topics', '/nope', '/point_h', '--start-offset', '1000'],
            '/nope is not in the log; it has /crank_state, /diagnostics',
            0,
        ),
        (['--start-offset', '1000'], 'shorter than the start offset', 0),
    ],
)
def test_a_player_without_messages_reports_the_reason(
    ros: Domain, recorded_run: Path, arguments: list[str], warning: str, code: int
) -> None:
    player = ros.start('player_node', str(recorded_run), *arguments, '--delay', '0')
    assert player.wait() == code
    assert warning in player.errors


@pytest.mark.parametrize('option', [['--rate', 'x'], ['--rate', '0'], ['--start-offset', '-1']])
def test_an_invalid_option_is_refused(
    capsys: pytest.CaptureFixture[str], option: list[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        player_main(['player_node', 'run', *option], None)  # type: ignore[arg-type]
    assert end.value.code == 2
    refusal = f'argument {option[0]}: {option[1]} is refused: it must be'
    assert refusal in capsys.readouterr().err
