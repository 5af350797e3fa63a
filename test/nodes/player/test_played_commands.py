"""However a replay ends, the last that it commands a robot is to stand; real processes."""

from pathlib import Path
import signal
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.log.definitions import definition
from klann_ros.nodes.crank_output import standstill
from klann_ros.nodes.endpoints import LAST_MESSAGES, type_name
from mcap.writer import Writer
from playable_logs import START
import pytest
from rclpy.serialization import serialize_message
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

CRANKS = JointState(name=['left', 'right'], position=[1.0, 2.0], velocity=[0.5, -0.5])
TWIST = TwistStamped()
TWIST.header.stamp.sec = 12
TWIST.twist.linear.x = 0.1
MESSAGES: dict[str, Any] = {
    '/robot/crank_command': CRANKS,
    '/cmd_vel': TWIST,
    '/controller/commands': Float64MultiArray(data=[0.5, -0.5]),
    # Numbers, but nobody's rates.
    '/number': Float64(data=0.5),
    '/numbers': Float64MultiArray(data=[0.5]),
}


def write(path: Path, seconds: float) -> Path:
    """Write a log in which each of the messages comes every 10 ms."""
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        channels = {}
        for topic, message in MESSAGES.items():
            name = type_name(type(message))
            schema = writer.register_schema(name, 'ros2msg', definition(name).encode())
            channels[topic] = writer.register_channel(topic, 'cdr', schema)
        for k in range(round(100 * seconds)):
            time = START + k * 10_000_000
            for topic, message in MESSAGES.items():
                data = bytes(serialize_message(message))
                writer.add_message(channels[topic], time, data, time)
        writer.finish()
    return path


@pytest.mark.parametrize('end', ['of the log', signal.SIGINT, signal.SIGTERM])
def test_a_replay_ends_with_zero(ros: Domain, tmp_path: Path, end: str | signal.Signals) -> None:
    path = write(tmp_path / 'log.mcap', 30.0 if isinstance(end, signal.Signals) else 1.0)
    played = {topic: ros.probe.listen(type(m), topic) for topic, m in MESSAGES.items()}
    process = ros.start('player_node', str(path), '--delay', '1')
    ros.probe.until(lambda: all(played.values()))
    assert list(played['/robot/crank_command'][0].velocity) == [0.5, -0.5]
    if isinstance(end, signal.Signals):
        process.popen.send_signal(end)
    ros.probe.until(lambda: process.popen.poll() is not None)
    ros.probe.spin(0.3)
    assert process.wait() == 0
    cranks, twists, rates, number, numbers = (messages[-1] for messages in played.values())
    assert list(cranks.name) == ['left', 'right']
    assert list(cranks.position) == [1.0, 2.0]
    assert list(cranks.velocity) == [0.0, 0.0]
    assert twists == TwistStamped()
    assert list(rates.data) == [0.0, 0.0]
    assert number.data == numbers.data[0] == 0.5
    last = played['/controller/commands'][-LAST_MESSAGES:]
    assert not any(any(message.data) for message in last)


def test_what_is_no_command_is_none() -> None:
    assert standstill('/crank_command', JointState, b'\0\1\0\0' + bytes(3)) is None
    assert standstill('/crank_state', JointState, serialize_message(CRANKS)) is None
    assert standstill('/commands', JointState, serialize_message(CRANKS)) is None
