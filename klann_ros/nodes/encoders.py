"""
Encoders that count: std_msgs/Int32 on crank_state, as microcontrollers send them.

An Int32 names no joint, so each of several cranks has a topic of its own: `crank_state/JOINT`.
`counts_per_turn` has no sign: direction and zero of a crank are set as those of a JointState.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.messages import JointReading, JointsReader, NumberReader
from klann_ros.sanitize.text import printable
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Int32

from .endpoints import create_publisher, name_refusal, subscribe_raw
from .parameters import require, StartError
from .process import LOG_PERIOD
from .raw_executor import Info

_TICKS = 'std_msgs/msg/Int32'
_OVERFLOW = 2**32


def encoder_topics(joints: Sequence[str], parameters: Mapping[str, Any]) -> dict[str, str]:
    """Return the topic of each crank's ticks, none for a JointState; a StartError if refused."""
    if parameters['crank_state_type'] != 'ticks':
        return {}
    counts_per_turn = parameters['counts_per_turn']
    requirement = '> 0 where crank_state_type is ticks'
    require(counts_per_turn > 0.0, 'counts_per_turn', counts_per_turn, requirement)
    if len(joints) == 1:
        return {joints[0]: 'crank_state'}
    for joint in joints:
        reason = name_refusal(f'/{joint}')
        if reason:
            raise StartError(f"the ticks of joint '{printable(joint)}' have no topic: {reason}")
    return {joint: f'crank_state/{joint}' for joint in joints}


def encoder_count(angle: float, counts_per_turn: float) -> int:
    """Return the count that an encoder of 32 bits shows at an angle [rad]."""
    return _overflowed(round(angle / TURN * counts_per_turn))


def _overflowed(count: int) -> int:
    """Return a count in an integer of 32 bits, after all overflows."""
    return (count + _OVERFLOW // 2) % _OVERFLOW - _OVERFLOW // 2


class EncoderPublishers:
    """Publishers of the ticks of joints, in the place of one of JointStates."""

    def __init__(self, node: Node, topics: Mapping[str, str], counts_per_turn: float) -> None:
        self._counts_per_turn = counts_per_turn
        self._publishers = {
            joint: create_publisher(node, Int32, topic) for joint, topic in topics.items()
        }

    def publish(self, state: JointState) -> None:
        """Publish the positions of a JointState."""
        for joint, angle in zip(state.name, state.position, strict=True):
            count = encoder_count(angle, self._counts_per_turn)
            self._publishers[joint].publish(Int32(data=count))


class TicksReader:
    """
    Read the angle of a crank from successive std_msgs/Int32 messages.

    Counts may overflow. The whole turns of the first count are left out: they only show for how
    long the encoder has counted.
    """

    def __init__(self, counts_per_turn: float) -> None:
        self._counts_per_turn = counts_per_turn
        self._number = NumberReader(_TICKS)
        # The last count without overflow; None before the first.
        self._count: int | None = None
        # The whole turns that are left out.
        self._first_turns = 0

    def read(self, message: bytes) -> float:
        """Return the angle in a message [rad]; a ValueError for another message."""
        count = int(self._number.read(message))
        if self._count is None:
            self._count = count
            self._first_turns = round(count / self._counts_per_turn)
        self._count += _overflowed(count - self._count)
        return (self._count / self._counts_per_turn - self._first_turns) * TURN


class CrankTopic(NamedTuple):
    """A topic with readings of cranks: the JointStates of all, or the ticks of one."""

    kind: type
    name: str
    # The joint of the ticks; '' of JointStates.
    joint: str
    # Returns the readings in a message by their joints; a ValueError for another message.
    read: Callable[[bytes], Mapping[str, JointReading]]


def crank_topics(joints: Sequence[str], parameters: Mapping[str, Any]) -> list[CrankTopic]:
    """Return the topics of the readings of cranks; a StartError names a refused parameter."""
    topics = []
    for joint, name in encoder_topics(joints, parameters).items():
        read_ticks = partial(_read_ticks, joint, TicksReader(parameters['counts_per_turn']))
        topics.append(CrankTopic(Int32, name, joint, read_ticks))
    return topics or [CrankTopic(JointState, 'crank_state', '', JointsReader(joints).read)]


def _read_ticks(joint: str, reader: TicksReader, message: bytes) -> dict[str, JointReading]:
    return {joint: JointReading(reader.read(message), None, 0, 0)}


def subscribe_cranks(
    node: Node,
    joints: Sequence[str],
    parameters: Mapping[str, Any],
    take: Callable[[Mapping[str, JointReading], Info], None],
) -> None:
    """Subscribe to the readings of cranks; refused messages are logged."""

    def on_message(topic: CrankTopic, message: bytes, info: Info) -> None:
        try:
            readings = topic.read(message)
        except ValueError as error:
            source = f'crank_state of {topic.joint}' if topic.joint else 'crank_state'
            text = printable(f'{source} is rejected: {error}')
            node.get_logger().warning(text, throttle_duration_sec=LOG_PERIOD)
        else:
            take(readings, info)

    for topic in crank_topics(joints, parameters):
        subscribe_raw(node, topic.kind, topic.name, partial(on_message, topic))
