"""`drive`: what it sends and shows, and that what it moves stands at its end."""

from collections.abc import Iterator, Mapping
from pathlib import Path
import re
import signal

from domain import own_domain
from geometry_msgs.msg import Pose, Twist, TwistStamped
from klann_ros.messages import ANGLE_TYPES
from klann_ros.nodes.drive import node as drive
from klann_ros.nodes.drive.node import _print, COMMANDS, JOINT_STATE, read_options
from klann_ros.nodes.endpoints import LATCHED
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain, open_domain, Process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float64, String
from std_srvs.srv import Trigger
from yaml_tables import read_table

HOSTILE = 'a\x1b[2Jb\u202ec\nd\n'


@pytest.fixture(scope='module')
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Domain]:
    """Open a domain for all tests, each with topics of its own."""
    with own_domain() as domain, open_domain(domain, tmp_path_factory.mktemp('drive')) as ros:
        yield ros


def ended(ros: Domain, *processes: Process) -> list[int]:
    """Return the exit codes of processes, while the probe answers them."""
    ros.probe.until(lambda: all(process.popen.poll() is not None for process in processes))
    # Their last messages have arrived, but not all are taken.
    ros.probe.spin(0.2)
    return [process.wait() for process in processes]


def named(namespace: str) -> tuple[str, str, str]:
    return '--ros-args', '-r', f'__ns:=/{namespace}'


def test_what_it_moves_stands_when_it_ends_in_whatever_way(ros: Domain) -> None:
    signals = {'int': signal.SIGINT, 'term': signal.SIGTERM, 'hup': signal.SIGHUP}
    commands = {}
    drives = {}
    for name in ('time', *signals):
        commands[name] = ros.probe.listen(JointState, f'/{name}/crank_command')
        seconds = '0.5' if name == 'time' else '100'
        crank = ('crank', 'left=0.5rad/s', 'right=-30deg/s', '--for', seconds)
        drives[name] = ros.start('drive', *crank, *named(name))
    walks = ros.probe.listen(TwistStamped, '/walk/cmd_vel')
    unstamped = ros.probe.listen(Twist, '/unstamped/cmd_vel')
    for name in ('walk', 'unstamped'):
        walk = ('walk', '5cm/s', '--turn', '0.2', '--for', '0.5')
        drives[name] = ros.start('drive', *walk, *named(name))
    turning = ros.probe.listen(JointState, '/turning/crank_command')
    drives['turning'] = ros.start(
        'crank_node', *named('turning'), output='crank_command', speed=0.5, min_subscribers=1
    )
    ros.probe.until(lambda: all([*commands.values(), walks, unstamped, turning]))
    for name, number in signals.items():
        assert drives[name].popen.poll() is None
        drives[name].popen.send_signal(number)
    drives['turning'].popen.send_signal(signal.SIGTERM)
    assert {*ended(ros, *drives.values())} == {0}
    for received in commands.values():
        assert list(received[0].velocity) == pytest.approx([0.5, -0.5236], abs=1e-4)
        assert list(received[-1].name) == ['left', 'right']
        assert list(received[-1].velocity) == [0.0, 0.0]
        assert received[0].header.stamp.sec > 0
    assert (walks[0].twist.linear.x, walks[0].twist.angular.z) == (0.05, 0.2)
    assert (unstamped[0].linear.x, unstamped[0].angular.z) == (0.05, 0.2)
    assert (walks[-1].twist, unstamped[-1]) == (Twist(), Twist())
    assert [turning[0].velocity[0], turning[-1].velocity[0]] == [0.5, 0.0]


def test_an_angle_goes_to_a_solver_in_the_type_that_it_takes(ros: Domain) -> None:
    angles = ros.probe.listen(Float64, '/double/crank_angle')
    singles = ros.probe.listen(Float32, '/single/crank_angle')
    states = ros.probe.listen(JointState, '/several/crank_state')
    poses = ros.probe.listen(Pose, '/pose')
    drives = [
        ros.start('drive', 'crank', '60deg', *named('double')),
        ros.start('drive', 'crank', '60deg', *named('single')),
        ros.start('drive', 'crank', 'left=60deg', 'right=0.5rad', *named('several')),
        ros.start('drive', 'pub', 'pose', '{position.x: 1}'),
    ]
    assert ended(ros, *drives) == [0, 0, 0, 0]
    assert [angle.data for angle in angles] == pytest.approx([1.0471975511965976])
    assert [angle.data for angle in singles] == pytest.approx([1.0471975511965976])
    assert [list(state.name) for state in states] == [['left', 'right']]
    assert list(states[0].position) == pytest.approx([1.0471975511965976, 0.5])
    assert [pose.position.x for pose in poses] == [1.0]


def test_it_shows_latched_and_hostile_messages_of_any_type(ros: Domain) -> None:
    ros.probe.node.create_publisher(String, 'hostile', LATCHED).publish(String(data=HOSTILE))
    odometry = Odometry()
    odometry.pose.covariance[7] = 0.25
    ros.probe.node.create_publisher(Odometry, 'odometry', LATCHED).publish(odometry)
    shown = ros.start('drive', 'echo', 'hostile', '--once')
    text = ros.start('drive', 'echo', 'hostile', '--once', '--field', 'data')
    covariance = ros.start('drive', 'echo', 'odometry', '--once', '--field', 'pose.covariance')
    assert ended(ros, shown, text, covariance) == [0, 0, 0]
    assert shown.output == 'data: a\\x1b[2Jb\\u202ec\\nd\\n\n'
    # For a file: as it is.
    assert text.output == HOSTILE
    assert covariance.output.startswith('[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25,')


def test_each_field_of_a_submessage_has_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    counter = {'key': 'lost', 'value': '0'}
    status = {'message': 'a\x1b', 'values': [counter, counter]}
    _print({'stamp': 1, 'status': [status], 'names': ['a'], 'none': []}, None)
    counters = [
        f'status[0].values[{i}].{field}' for i in (0, 1) for field in ('key: lost', 'value: 0')
    ]
    lines = ['stamp: 1', 'status[0].message: a\\x1b', *counters, "names: ['a']", 'none: []']
    assert capsys.readouterr().out.splitlines() == lines


def test_it_lists_topics_tells_rates_and_calls_services(ros: Domain) -> None:
    publisher = ros.probe.node.create_publisher(Float64, 'ticking', 10)
    sent: list[None] = []
    timer = ros.probe.node.create_timer(0.01, lambda: sent.append(publisher.publish(Float64())))

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = 'no fault'
        return response

    ros.probe.node.create_service(Trigger, 'reset_fault', answer)
    rate = ros.start('drive', 'hz', 'ticking')
    topics = ros.start('drive', 'list', 'tick')
    call = ros.start('drive', 'call', 'reset_fault')
    assert ended(ros, topics, call) == [0, 1]
    assert topics.output.startswith('/ticking  std_msgs/msg/Float64\n    publishers: /probe\n')
    assert call.output == 'no fault\n'
    timer.cancel()
    ros.probe.spin(2.0)
    rate.popen.send_signal(signal.SIGINT)
    assert ended(ros, rate) == [0]
    rates = map(int, re.findall(r'^(\d+) a second$', rate.output, re.MULTILINE))
    assert 0 < sum(rates) <= len(sent)


def test_what_it_cannot_do_is_one_line(ros: Domain) -> None:
    probe = ros.probe
    for kind, topic in ((Float64, 'crank_angel'), (String, 'cmd_vel'), (Float64, 'driven')):
        probe.listen(kind, topic)
    probe.listen(Float64, 'two_types')
    ros.other_node().create_subscription(String, 'two_types', print, 10)
    probe.listen(JointState, 'crank_command')
    probe.add_node('other').create_publisher(Float64, 'driven', 10)
    probe.node.create_publisher(String, 'latched', LATCHED).publish(String())
    table = read_table(Path(__file__).with_name('refused.yaml'))
    drives = [ros.start('drive', *arguments) for arguments, *_ in table]
    codes = ended(ros, *drives)
    errors = [drive.errors for drive in drives]
    assert [*zip(codes, errors, strict=True)] == [
        (code, f'drive: {line}\n') for _, code, line in table
    ]


def test_negative_quantities_are_no_options() -> None:
    options = read_options(['drive', 'walk', '-5cm/s', '--turn', '-10deg/s'])
    assert options.words == ['-5cm/s']
    assert options.turn == pytest.approx(-0.174533, abs=1e-6)


@pytest.mark.parametrize(
    ('quantities', 'topic', 'contents'),
    [
        (['0.5rad/s'], 'crank_command', {JOINT_STATE: {'name': ['crank'], 'velocity': [0.5]}}),
        (
            ['left=1rad', '-2rad'],
            'crank_state',
            {JOINT_STATE: {'name': ['left', 'crank'], 'position': [1.0, -2.0]}},
        ),
        (['1rad'], 'crank_angle', {kind: {'data': 1.0} for kind in ANGLE_TYPES}),
    ],
)
def test_a_crank_without_a_name_is_called_crank_or_has_an_angle_alone(
    quantities: list[str],
    topic: str,
    contents: Mapping[str, object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent: list[object] = []

    def send(*arguments: object) -> Iterator[None]:
        sent.extend(arguments)
        yield

    monkeypatch.setattr(drive, '_send', send)
    assert [*COMMANDS['crank'](None, *quantities)] == [None]
    assert sent == [None, topic, contents]
