"""Untrusted names are reported and skipped, and the rest goes on: real processes, real DDS."""

from pathlib import Path

from klann_ros.log.definitions import definition
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD
from klann_ros.nodes.leg_declarations import GEOMETRY_NAMES
from mcap.writer import Writer
from playable_logs import number, START
import pytest
from raw_publishers import Stranger
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from ros_domain import Domain, Probe, Process, RecorderReports
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from yaml_tables import read_table

GOOD = 'std_msgs/msg/Float64'
NAMES = read_table(Path(__file__).with_name('hostile_names.yaml'))
TYPES = NAMES['sent types']
TOPICS = [*NAMES['topics'], '/' + 'x' * 10_000]
COUNT = 40


@pytest.fixture
def marker(tmp_path: Path) -> Path:
    """Return a file that any import of a module of the working folder makes."""
    package = tmp_path / 'marker_msgs'
    package.mkdir()
    code = f'open({str(tmp_path / "marker")!r}, "w")\n'
    (package / '__init__.py').write_text(code)
    (package / 'msg.py').write_text(code)
    return tmp_path / 'marker'


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Return a log of a good topic among all that is hostile."""
    path = tmp_path / 'hostile.mcap'
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        names = [('/number', GOOD)]
        names += [(f'/typed_{n}', kind) for n, kind in enumerate(TYPES)]
        names += [(name, GOOD) for name in TOPICS]
        for n, (name, kind) in enumerate(names):
            schema = writer.register_schema(kind, 'ros2msg', definition(GOOD).encode())
            channel = writer.register_channel(name, 'cdr', schema)
            for k in range(1 if n else COUNT):
                time = START + k * 1_000_000
                writer.add_message(channel, time, number(k), time, k + 1)
        writer.finish()
    return path


def printed(process: Process) -> list[str]:
    """Return the lines that a process has written; they hold nothing but what can be seen."""
    lines = (process.output + process.errors).split('\n')
    assert [line for line in lines if not line.isprintable()] == []
    assert max(map(len, lines)) < 2000
    return lines


@pytest.mark.parametrize('namespace', ['', '/replay'])
def test_an_untrusted_log_plays_its_intact_part_and_executes_nothing(
    ros: Domain, bag: Path, marker: Path, namespace: str
) -> None:
    received = ros.probe.listen(Float64, f'{namespace}/other')
    arguments = ['--remap', 'number:=other', '--delay', '0', '--start-paused']
    arguments += ['--ros-args', '-r', f'__ns:={namespace}'] if namespace else []
    process = ros.start('player_node', str(bag), *arguments)
    ros.probe.await_publishers(f'{namespace}/other')
    assert ros.probe.call(Trigger, f'{namespace}/player_node/resume', Trigger.Request()).success
    assert process.wait() == 0
    ros.probe.until(lambda: len(received) >= COUNT)
    assert [message.data for message in received] == list(range(COUNT))
    assert not marker.exists()
    warnings = [line for line in printed(process) if 'is not played: ' in line]
    more = [line for line in printed(process) if 'more warnings about topics' in line]
    assert len(warnings) == 20
    assert f'and {len(TYPES) + len(TOPICS) - 20} more' in more[0]


def test_every_topic_that_ros_refuses_is_named_once(ros: Domain, bag: Path) -> None:
    names = [name for name in TOPICS if name and '\0' not in name]
    process = ros.start('player_node', str(bag), '--delay', '0', '--topics', *names)
    # Nothing is left to play.
    assert process.wait() == 1
    lines = printed(process)
    warnings = [line for line in lines if 'is not played: topic ' in line]
    # '~' is read as '/~'.
    assert len(warnings) == len(names) - 1
    assert any(r'/a\n[ERROR] forged is not played: ' in line for line in warnings)
    assert any('/{node} is not played: ' in line for line in warnings)
    assert any('xxx... (10001 characters) is not played: ' in line for line in warnings)


def test_a_recorder_survives_whatever_is_on_the_network(
    ros: Domain, marker: Path, tmp_path: Path
) -> None:
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output='run', all_topics=True)
    sound = ros.probe.publisher(Float64, '/sound')
    # Each in a participant of its own: one that rclpy cannot tell of hides what is beside it.
    named, typed, unreadable = (ros.other_node() for _ in range(3))
    # DDS has names up to 255 bytes, and those of ROS begin with a slash.
    names = [
        name for name in TOPICS if name.startswith('/') and len(name) < 250 and '\0' not in name
    ]
    strangers = [Stranger(named, name.encode()) for name in names]
    strangers += [
        Stranger(typed, f'/typed_{n}'.encode(), kind.encode()) for n, kind in enumerate(TYPES)
    ]
    ros.probe.until(lambda: recorder.errors.count('is not recorded: ') == len(strangers))
    strangers += [
        Stranger(unreadable, b'/\xff\xfe'),
        Stranger(unreadable, b'/sound', b'std_msgs\xff/msg/Float64'),
    ]
    ros.probe.spin(0.5)
    # Who comes later is received all the same.
    late = ros.probe.publisher(Float64, '/late')
    for n in range(COUNT):
        sound.publish(Float64(data=float(n)))
        late.publish(Float64(data=float(n)))
    reports.until_received({'/sound': COUNT, '/late': COUNT})
    assert recorder.stop() == 0
    for stranger in strangers:
        stranger.close()
    assert not marker.exists()
    lines = printed(recorder)
    assert any(
        'typed_3 of type marker_msgs/msg/X is not recorded: message type' in s for s in lines
    )
    assert any(r' /\x1b[2J\x9b31m of type std_msgs/msg/Float64 is not' in line for line in lines)
    with open_log(tmp_path / 'run') as log:
        assert log.complete
        counts = {name: sum(1 for _ in log.messages([name])) for name in ('/sound', '/late')}
        assert not {topic.name for topic in log.topics} & set(TOPICS)
    assert counts == {'/sound': COUNT, '/late': COUNT}


class Liar:
    """A node that publishes poses, and answers for its parameters as no solver would."""

    def __init__(self, probe: Probe, name: str, values: list[ParameterValue]) -> None:
        node = probe.add_node(name, start_parameter_services=False)
        self.requests = 0
        self._values = values
        node.create_publisher(JointState, '/joint_states', 10)
        node.create_service(ListParameters, f'{name}/list_parameters', self._list)
        node.create_service(GetParameters, f'{name}/get_parameters', self._get)

    def _list(self, _: object, response: ListParameters.Response) -> ListParameters.Response:
        response.result.names = [*GEOMETRY_NAMES, 'a\x1b[2J']
        return response

    def _get(self, _: object, response: GetParameters.Response) -> GetParameters.Response:
        self.requests += 1
        response.values = self._values
        return response


def solver_records(run: Path) -> list[dict[str, str]]:
    """Return what a run, which may still be written, has of solvers."""
    try:
        with open_log(run) as log:
            return log.metadata.get(SOLVER_RECORD, [])
    except NotALogError:
        return []


def test_a_recorder_survives_any_solver_answer(ros: Domain, tmp_path: Path) -> None:
    recorder = ros.start('recorder_node', output='run')
    odd = ParameterValue(type=ParameterType.PARAMETER_BYTE_ARRAY, byte_array_value=[b'\xff'])
    liars = [
        Liar(ros.probe, 'too_few', [odd]),
        Liar(ros.probe, 'no_type', [ParameterValue(type=77)] * (len(GEOMETRY_NAMES) + 1)),
        Liar(ros.probe, 'odd', [odd] * (len(GEOMETRY_NAMES) + 1)),
    ]
    ros.probe.until(lambda: all(liar.requests for liar in liars))
    warning = 'returned invalid parameters: '
    ros.probe.until(lambda: recorder.errors.count(warning) >= 2)
    ros.probe.until(lambda: solver_records(tmp_path / 'run'))
    assert recorder.stop() == 0
    lines = printed(recorder)
    for name in ('too_few', 'no_type'):
        assert any(f'/{name} returned invalid parameters: ' in line for line in lines)
    with open_log(tmp_path / 'run') as log:
        (record,) = log.metadata[SOLVER_RECORD]
    assert solver_parameters(record).node == '/odd'
