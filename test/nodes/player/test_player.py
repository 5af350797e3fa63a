"""A replay controlled by services and parameters; real processes, real DDS, real signals."""

from pathlib import Path
import signal
from typing import Any

from mcap.writer import CompressionType, Writer
from playable_logs import COUNT, number, PERIOD, START, write_bag, write_split_bag
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import Domain, Process
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

# So slow that nothing but the first message is ever due, and still of the log's time.
STILL = 1e-5


class Controlled:
    """A player that was started paused, and all that it publishes."""

    def __init__(self, ros: Domain, bag: Path) -> None:
        self.ros = ros
        self.numbers = ros.probe.listen(Float64, 'number')
        self.texts = ros.probe.listen(String, 'robot_description')
        self.clock = ros.probe.listen(Clock, '/clock')
        self.process = ros.start(
            'player_node', str(bag), '--start-paused', '--loop', '--clock', '50', '--delay', '0'
        )
        ros.probe.until(lambda: self.texts == [] and self.clock)

    def call(self, name: str) -> Trigger.Response:
        return self.ros.probe.call(Trigger, f'player_node/{name}', Trigger.Request())

    def change(self, name: str, value: object) -> Any:
        return self.ros.probe.set_parameters('player_node', {name: value})

    @property
    def position(self) -> float:
        request = GetParameters.Request(names=['position'])
        answer = self.ros.probe.call(GetParameters, 'player_node/get_parameters', request)
        return float(answer.values[0].double_value)

    @property
    def time(self) -> int:
        stamps = [message.clock for message in self.clock[-1:]]
        return sum(int(stamp.sec * 10**9 + stamp.nanosec) for stamp in stamps)

    def pause_at(self, position: float) -> None:
        """Stand at a position, and forget what came before."""
        assert self.call('pause').success
        assert self.change('rate', 1.0).successful
        self.ros.probe.spin(0.05)
        self.texts.clear()
        assert self.change('position', position).successful
        # What is latched there is the last that comes of the jump.
        self.ros.probe.until(lambda: self.texts and self.time == START + round(position * 1e9))
        for received in (self.numbers, self.texts, self.clock):
            received.clear()


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_split_bag(tmp_path_factory.mktemp('bags') / 'split')


@pytest.fixture(scope='module')
def one_player(module_ros: Domain, bag: Path) -> Controlled:
    return Controlled(module_ros, bag)


@pytest.fixture
def player(one_player: Controlled) -> Controlled:
    one_player.pause_at(0.5)
    return one_player


def values(numbers: list[Float64]) -> list[float]:
    return [message.data for message in numbers]


def test_a_paused_player_publishes_nothing_but_a_clock_that_stands(player: Controlled) -> None:
    player.ros.probe.until(lambda: len(player.clock) >= 5)
    assert player.numbers == []
    assert {stamp.clock.nanosec for stamp in player.clock} == {500_000_000}


def test_a_step_publishes_exactly_the_next_message(player: Controlled) -> None:
    for n in (50, 51, 52):
        answer = player.call('step')
        assert answer.success, answer.message
        player.ros.probe.until(lambda n=n: values(player.numbers)[-1:] == [n])
        assert player.position == pytest.approx(n * PERIOD / 1e9)
    player.ros.probe.spin(0.1)
    assert values(player.numbers) == [50, 51, 52]


def test_a_rate_is_changed_while_it_plays(player: Controlled) -> None:
    assert player.change('rate', STILL).successful
    assert player.call('resume').success
    player.ros.probe.until(lambda: values(player.numbers) == [50])
    player.ros.probe.spin(0.1)
    assert player.change('rate', 2).successful
    player.ros.probe.until(lambda: len(player.numbers) >= 50)
    assert values(player.numbers)[:50] == list(range(50, 100))


def test_a_jump_publishes_the_latched_messages(player: Controlled) -> None:
    assert player.change('position', 0.005).successful
    player.ros.probe.until(lambda: player.texts)
    assert player.change('position', 0.99).successful
    player.ros.probe.until(lambda: len(player.texts) >= 2)
    assert [message.data for message in player.texts] == ['older', 'newer']
    assert player.numbers == []


def test_a_late_subscriber_receives_latched_messages_once(player: Controlled) -> None:
    qos = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    received = player.ros.probe.listen(String, 'robot_description', qos)
    player.ros.probe.until(lambda: received)
    player.ros.probe.spin(0.1)
    assert [message.data for message in received] == ['newer']


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('position', -1, 'position = -1.0 is refused: it must be within 0 .. 0.99'),
        ('position', 1.0, 'position = 1.0 is refused: it must be within 0 .. 0.99'),
        ('position', 'end', 'Wrong parameter type, expected '),
        ('rate', 0, 'rate = 0.0 is refused: it must be within 1e-06 .. 1e+06'),
        ('rate', float('nan'), 'rate = nan is refused'),
    ],
)
def test_an_invalid_value_is_refused_with_the_reason(
    player: Controlled, name: str, value: object, reason: str
) -> None:
    result = player.change(name, value)
    assert not result.successful
    assert reason in result.reason
    assert player.position == 0.5


def test_a_loop_takes_the_clock_back(player: Controlled) -> None:
    assert player.change('position', 0.9).successful
    assert player.call('resume').success
    player.ros.probe.until(lambda: values(player.numbers)[:11] == [*range(90, 100), 0])
    player.ros.probe.until(lambda: player.time < START + 5e8)


def started(ros: Domain, bag: Path, *arguments: str, namespace: str = '') -> tuple[Process, Any]:
    """Start to play a log when a subscriber is there; return the process and the messages."""
    received = ros.probe.listen(Float64, f'{namespace}/number')
    inside = ['--ros-args', '-r', f'__ns:={namespace}'] if namespace else []
    process = ros.start(
        'player_node', str(bag), '--delay', '0', '--start-paused', *arguments, *inside
    )
    ros.probe.await_publishers(f'{namespace}/number')
    assert ros.probe.call(Trigger, f'{namespace}/player_node/resume', Trigger.Request()).success
    return process, received


def played(ros: Domain, bag: Path, *arguments: str) -> tuple[Process, list[float]]:
    """Play a log to its last number; return the process and the numbers that came."""
    process, received = started(ros, bag, *arguments)
    assert process.wait() == 0
    ros.probe.until(lambda: values(received)[-1:] == [COUNT - 1])
    return process, values(received)


def test_a_split_bag_plays_from_an_offset_and_warns_of_unplayable_topics(
    ros: Domain, bag: Path
) -> None:
    process, received = played(ros, bag, '--start-offset', '0.31', '--rate', '5')
    assert received == list(range(31, COUNT))
    assert "/unknown is not played: message type 'nobody_msgs/msg/Has'" in process.errors
    assert '/json is not played: its messages are json, not cdr' in process.errors
    assert '/number is not played as std_msgs/msg/String (cdr): in the same log' in process.errors


def test_a_damaged_log_plays_its_intact_part_and_reports_the_damage(
    ros: Domain, tmp_path: Path
) -> None:
    path = write_bag(tmp_path / 'bag.mcap', compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    data[data.index(b'\0\1\0\0' + bytes(6) + b'\x49\x40') + 4] ^= 1  # the number 50
    path.write_bytes(data)
    process, received = played(ros, path, '--rate', '5')
    assert 50 not in received
    assert received == sorted(received)
    assert len(received) > 80
    assert 'the CRC of the chunk does not match' in process.errors


def test_a_message_with_an_impossible_log_time_is_left_out_and_reported(
    ros: Domain, tmp_path: Path
) -> None:
    path = tmp_path / 'bag.mcap'
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
        channel = writer.register_channel('/number', 'cdr', schema)
        for n in range(COUNT):
            time = 2**64 - 5 * 10**9 if n == 50 else START + n * PERIOD
            writer.add_message(channel, time, number(n), time)
        writer.finish()
    process, received = played(ros, path, '--rate', '5')
    assert received == [n for n in range(COUNT) if n != 50]
    assert '1 of 100 log times is impossible (2554-07-21 23:34:28)' in process.errors
    assert process.errors.count('impossible') == 1


@pytest.mark.parametrize(
    ('topic', 'reason'),
    [('/json', 'messages are json, not cdr'), ('/nothing', 'nothing to play')],
)
def test_a_log_without_a_playable_topic_is_refused_with_its_topics(
    ros: Domain, bag: Path, topic: str, reason: str
) -> None:
    process = ros.start('player_node', str(bag), '--topics', topic)
    assert process.wait() == 1
    assert reason in process.errors
    last_line = process.errors.splitlines()[-1]
    assert last_line.startswith('player_node: nothing to play: ')
    assert last_line.endswith('has /clock, /json, /number, /robot_description, /unknown')


def test_a_player_resumed_by_sigcont_causes_no_burst(ros: Domain, bag: Path) -> None:
    process, received = started(ros, bag)
    ros.probe.until(lambda: len(received) >= 10)
    process.popen.send_signal(signal.SIGSTOP)
    ros.probe.spin(1.0)
    process.popen.send_signal(signal.SIGCONT)
    assert process.wait() == 0
    ros.probe.until(lambda: len(received) >= COUNT)
    assert values(received) == list(range(COUNT))
    assert 'playback stalled for ' in process.errors


def test_two_players_on_one_topic_play_both_and_report_each_other(ros: Domain, bag: Path) -> None:
    received = ros.probe.listen(Float64, 'number')
    options = [str(bag), '--loop', '--rate', '5', '--ros-args', '-r']
    players = [ros.start('player_node', *options, f'__node:={name}') for name in ('one', 'two')]
    ros.probe.until(lambda: ros.probe.node.count_publishers('number') == 2)
    received.clear()
    ros.probe.until(lambda: len(received) >= 5 * COUNT)
    assert max(values(received).count(number) for number in range(COUNT)) >= 5
    for player in players:
        assert player.stop(signal.SIGINT) == 0
        assert 'other nodes publish on /clock, /number, /robot_description too' in player.errors


def test_two_topics_of_different_types_cannot_become_one(ros: Domain, bag: Path) -> None:
    process, received = played(ros, bag, '--remap', 'robot_description:=number', '--rate', '9')
    assert received == list(range(COUNT))
    assert '/robot_description is not played: ' in process.errors
    assert 'a message of /number is left out: Failed to publish' in process.errors
