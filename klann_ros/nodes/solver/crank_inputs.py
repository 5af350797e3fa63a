"""The topics that turn cranks: read as CDR in order, stamped, counted."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite, isnan
from typing import Any, NamedTuple, TYPE_CHECKING

from klann_ros.kinematics import KinematicsError
from klann_ros.log import LossCounter
from klann_ros.messages import NumberReader
from klann_ros.nodes.encoders import crank_topics, CrankTopic
from klann_ros.nodes.endpoints import INPUT, overridden, subscribe_raw, type_name
from klann_ros.nodes.raw_executor import Info
from klann_ros.sanitize.text import printable
from rclpy.node import Node
from std_msgs.msg import Float32, Float64

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# Alternations in a report that prove two simultaneous publishers.
_MIN_ALTERNATIONS = 2
_ANGLES = {'float64': Float64, 'float32': Float32}
# Seconds and nanoseconds, as in a message.
Stamp = tuple[int, int]


class BadMessageError(KinematicsError):
    """A message without a crank angle; the text says why."""


class NoFeedbackError(BadMessageError):
    """A NaN before the first reading, as joint_state_broadcaster publishes it at every start."""


class CrankInput(NamedTuple):
    """A crank at a moment."""

    # Its angle [rad].
    alpha: float
    # Its rate [rad/s]; None if unknown.
    rate: float | None


class CrankInputs:
    """
    Subscriptions to crank_angle, which turns all joints, and to crank_state.

    `values` are the node's parameters, which say the types. For each message `turn` receives the
    cranks by their joints, and the stamp; `reject` the reason for an unusable message.
    """

    def __init__(
        self,
        node: Node,
        joints: Sequence[str],
        values: Mapping[str, Any],
        turn: Callable[[Mapping[str, CrankInput], Stamp], None],
        reject: Callable[[KinematicsError], None],
    ) -> None:
        # The number of messages older than their predecessor.
        self.out_of_order = 0
        self._clock = node.get_clock()
        self._joints = joints
        # The joints without any reading.
        self._unread = set(joints)
        self._turn = turn
        self._reject = reject
        self._last_stamp = (0, 0)
        angle_type = _ANGLES[values['crank_angle_type']]
        self._angle_reader = NumberReader(type_name(angle_type))
        self._angles = _Source(node, angle_type, 'crank_angle', self._on_crank_angle)
        self._states: list[_Source] = []
        for index, topic in enumerate(crank_topics(joints, values)):
            on_crank_state = partial(self._on_crank_state, topic, index)
            self._states.append(_Source(node, topic.kind, topic.name, on_crank_state))

    def subscribe(self) -> None:
        """Subscribe to all topics."""
        for source in (self._angles, *self._states):
            source.subscribe()

    def unsubscribe(self) -> None:
        """Leave all topics."""
        for source in (self._angles, *self._states):
            source.unsubscribe()

    @property
    def summary(self) -> str:
        """Return topics and joints in words."""
        joints = ', '.join(printable(joint) for joint in self._joints)
        word = 'joint' if len(self._joints) == 1 else 'joints'
        topics = ', '.join(source.topic for source in self._states)
        return f'{self._angles.topic} and {topics} ({word} {joints})'

    @property
    def lost(self) -> int:
        """Return the number of lost messages since the start."""
        return sum(source.loss.lost for source in (self._angles, *self._states))

    def sources(self) -> str:
        """Return the publishers of the crank if there are several; call it once a report."""
        angle_count = self._angles.active_publishers()
        # Each topic of ticks turns one crank.
        state_count, state_topic = max((s.active_publishers(), s.topic) for s in self._states)
        if angle_count + state_count < 2:
            return ''
        counts = {self._angles.topic: angle_count, state_topic: state_count}
        return ' and '.join(f'{topic} ({count})' for topic, count in counts.items() if count)

    def _on_crank_angle(self, data: bytes, info: Info) -> None:
        self._angles.count(info)
        try:
            crank = CrankInput(self._angle_reader.read(data), None)
        except ValueError as error:
            self._reject(BadMessageError(f'crank_angle: {error}'))
        else:
            self._answer(dict.fromkeys(self._joints, crank), (0, 0), info)

    def _on_crank_state(self, topic: CrankTopic, index: int, data: bytes, info: Info) -> None:
        """Answer the crank angles of a message; those of another joint are rejected."""
        source = self._states[index]
        source.count(info)
        try:
            readings = topic.read(data)
        except ValueError as error:
            text = f'crank_state: {error} (parameter crank_joint)'
            if topic.joint:
                text = f'{source.topic}: {error}'
            self._reject(BadMessageError(text))
            return
        cranks = {}
        stamp = (0, 0)
        for joint, reading in readings.items():
            if joint in self._unread:
                if isnan(reading.position):
                    continue
                self._unread.discard(joint)
            rate = reading.velocity
            if rate is not None and not isfinite(rate):
                rate = None
            cranks[joint] = CrankInput(reading.position, rate)
            stamp = (reading.sec, reading.nanosec)
        if cranks:
            self._answer(cranks, stamp, info)
        else:
            self._reject(NoFeedbackError('crank_state: there is no reading yet'))

    def _answer(self, cranks: Mapping[str, CrankInput], stamp: Stamp, info: Info) -> None:
        if stamp == (0, 0):
            stamp = self._now(info)
        if stamp < self._last_stamp:
            self.out_of_order += 1
        self._last_stamp = stamp
        self._turn(cranks, stamp)

    def _now(self, info: Info) -> Stamp:
        """Return the source's time for a message without a stamp, or simulated time."""
        time = info['source_timestamp']
        if self._clock.ros_time_is_active:
            time = self._clock.now().nanoseconds
        seconds, nanoseconds = divmod(int(time), 10**9)
        return seconds, nanoseconds


class _Source:
    """A subscription, with its counts of received and lost messages."""

    def __init__(
        self, node: Node, kind: type, topic: str, callback: Callable[[bytes, Info], None]
    ) -> None:
        self.loss = LossCounter()
        self.publishers = 0
        self._had_message = False
        # The number of gaps in the sequence numbers, and the last number.
        self._alternations = 0
        self._sequence: int | None = None
        self._node = node
        # Declared at the start, also of a node that is not active.
        overridden(node, topic, 'subscription', INPUT)
        self._arguments = (kind, topic, callback)
        self._subscription: Subscription | None = None
        self.topic = node.resolve_topic_name(topic)

    def subscribe(self) -> None:
        if self._subscription is None:
            self._subscription = subscribe_raw(
                self._node, *self._arguments, on_matched=self._on_matched
            )

    def unsubscribe(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._subscription = None
        self.publishers = 0
        self.loss.publishers_changed()

    def count(self, info: Info) -> None:
        self._had_message = True
        sequence = info['publication_sequence_number']
        if sequence is None or sequence - 1 != self._sequence:
            self._alternations += 1
        self._sequence = sequence
        self.loss.count(sequence, self.publishers)

    def active_publishers(self) -> int:
        """
        Return the number of publishers that have sent since the last call.

        Simultaneous publishers alternate, and each numbers its own messages; a silent one, such as
        a node that yields to a driver, does not. One alternation is a change of drivers.
        """
        count = self.publishers if self._had_message else 0
        if self._alternations < _MIN_ALTERNATIONS:
            count = min(count, 1)
        self._had_message = False
        self._alternations = 0
        return count

    def _on_matched(self, status: Any) -> None:
        self.loss.publishers_changed()
        self.publishers = status.current_count
