"""The topics that turn cranks: read from the wire in order, stamped, counted."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple, TYPE_CHECKING

from klann_ros.kinematics import KinematicsError
from klann_ros.log.loss import LossCounter
from klann_ros.nodes.endpoints import INPUT, overridden
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.sanitize.text import printable
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from .cdr import JointReader, read_float64

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# In one report, of two publishers that send at once.
MIN_ALTERNATIONS = 2
# Seconds and nanoseconds, as in a message.
Stamp = tuple[int, int]


class BadMessageError(KinematicsError):
    """A message that holds no crank angle; the text says why."""


class CrankInput(NamedTuple):
    """A crank at a moment."""

    # CrankInput angle [rad].
    alpha: float
    # Its rate [rad/s]; None where it is not known.
    rate: float | None


class CrankInputs:
    """
    Subscriptions to crank_angle and crank_state.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    joints : sequence of str
        The joints that turn cranks; crank_angle turns all of them.
    turn : callable
        Is given, for each message, the cranks by their joints, and the stamp.
    reject : callable
        Is given why a message says nothing.

    Attributes
    ----------
    out_of_order : int
        Messages that were older than the one before.

    """

    def __init__(
        self,
        node: Node,
        joints: Sequence[str],
        turn: Callable[[Mapping[str, CrankInput], Stamp], None],
        reject: Callable[[KinematicsError], None],
    ) -> None:
        self.out_of_order = 0
        self._clock = node.get_clock()
        self._joints, self._turn, self._reject = joints, turn, reject
        self._readers = {joint: JointReader(joint) for joint in joints}
        self._last_stamp = (0, 0)
        self._angles = _Source(node, Float64, 'crank_angle', self._on_crank_angle)
        self._states = _Source(node, JointState, 'crank_state', self._on_crank_state)

    def listen(self) -> None:
        """Subscribe."""
        self._angles.listen()
        self._states.listen()

    def ignore(self) -> None:
        """Unsubscribe."""
        self._angles.ignore()
        self._states.ignore()

    @property
    def summary(self) -> str:
        """Return what turns the cranks, in words."""
        joints = ', '.join(printable(joint) for joint in self._joints)
        word = 'joint' if len(self._joints) == 1 else 'joints'
        return f'{self._angles.topic} and {self._states.topic} ({word} {joints})'

    @property
    def lost(self) -> int:
        """Return how many messages were lost since the start."""
        return self._angles.loss.lost + self._states.loss.lost

    def sources(self) -> str:
        """Return the publishers of the crank if there are several; call it once a report."""
        active = {s.topic: s.active_publishers() for s in (self._angles, self._states)}
        if sum(active.values()) < 2:
            return ''
        return ' and '.join(f'{topic} ({count})' for topic, count in active.items() if count)

    def _on_crank_angle(self, data: bytes, info: Info) -> None:
        self._angles.count(info)
        try:
            crank = CrankInput(read_float64(data), None)
        except ValueError as error:
            self._reject(BadMessageError(f'crank_angle: {error}'))
        else:
            self._answer(dict.fromkeys(self._joints, crank), (0, 0), info)

    def _on_crank_state(self, data: bytes, info: Info) -> None:
        self._states.count(info)
        cranks, problem, stamp = {}, '', (0, 0)
        for joint, reader in self._readers.items():
            try:
                position, velocity, *at = reader.read(data)
            except ValueError as error:
                problem = str(error)
                continue
            known = velocity is not None and isfinite(velocity)
            cranks[joint] = CrankInput(position, velocity if known else None)
            stamp = at[0], at[1]
        if cranks:
            self._answer(cranks, stamp, info)
        else:
            self._reject(BadMessageError(f'crank_state: {problem} (parameter crank_joint)'))

    def _answer(self, cranks: Mapping[str, CrankInput], stamp: Stamp, info: Info) -> None:
        if stamp == (0, 0):
            stamp = self._now(info)
        if stamp < self._last_stamp:
            self.out_of_order += 1
        self._last_stamp = stamp
        self._turn(cranks, stamp)

    def _now(self, info: Info) -> Stamp:
        """Return the source's time for a message without a stamp, or simulated time."""
        active = self._clock.ros_time_is_active
        now = self._clock.now().nanoseconds if active else info['source_timestamp']
        seconds, nanoseconds = divmod(int(now), 10**9)
        return seconds, nanoseconds


class _Source:
    """A subscription, with its counts of received and lost messages."""

    def __init__(
        self, node: Node, kind: type, topic: str, callback: Callable[[bytes, Info], None]
    ) -> None:
        self.loss = LossCounter()
        self.publishers = 0
        self._had_message = False
        # How often the numbers of messages did not follow each other, and the last of them.
        self._alternations = 0
        self._number: int | None = None
        self._node = node
        self._profile = overridden(node, topic, 'subscription', INPUT)
        self._arguments = (kind, topic, callback, self._profile)
        self._group = RawCallbackGroup()
        self._subscription: Subscription | None = None
        self.topic = node.resolve_topic_name(topic)

    def listen(self) -> None:
        if self._subscription is not None:
            return
        self._subscription = self._node.create_subscription(
            *self._arguments,
            raw=True,
            callback_group=self._group,
            # Each event costs at every wait. What the others tell cannot happen to an input that
            # takes whatever is offered; one that is overridden may ask for more.
            event_callbacks=SubscriptionEventCallbacks(
                matched=self._on_matched, use_default_callbacks=self._profile != INPUT
            ),
        )

    def ignore(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._subscription = None
        self.publishers = 0
        self.loss.publishers_changed()

    def count(self, info: Info) -> None:
        self._had_message = True
        number = info['publication_sequence_number']
        if number is None or number - 1 != self._number:
            self._alternations += 1
        self._number = number
        self.loss.count(number, self.publishers)

    def active_publishers(self) -> int:
        """
        Return how many publishers have sent since the last call.

        One that is silent, such as a node that yields to a driver, is none of them: several that
        send alternate, and each numbers its own messages. One alternation is a change of drivers.
        """
        had, alternations = self._had_message, self._alternations
        self._had_message, self._alternations = False, 0
        if not had:
            return 0
        return self.publishers if alternations >= MIN_ALTERNATIONS else min(self.publishers, 1)

    def _on_matched(self, status: Any) -> None:
        # A publisher joined or left: the next message may be of another one.
        self.loss.publishers_changed()
        self.publishers = status.current_count
