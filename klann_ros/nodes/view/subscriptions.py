"""The subscriptions of the live page: newest messages and figures of each topic."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

from klann_ros.live.rates import TopicRate
from klann_ros.nodes.endpoints import message_class, name_refusal, UnknownMessageTypeError
from klann_ros.nodes.process import ROS_ERRORS
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.sanitize.text import printable
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

JOINT_STATE = 'sensor_msgs/msg/JointState'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
ODOMETRY = 'nav_msgs/msg/Odometry'
CRANK_ANGLE = 'std_msgs/msg/Float64'
TWIST = 'geometry_msgs/msg/TwistStamped'
# Subscribed types, and the endings of names for types that other nodes use as well.
_ENDINGS = {
    JOINT_STATE: ('',),
    DIAGNOSTICS: ('diagnostics',),
    ODOMETRY: ('odom',),
    CRANK_ANGLE: ('crank_angle',),
    TWIST: ('velocity_h', 'cmd_vel'),
    'geometry_msgs/msg/PointStamped': ('point_h',),
}
# Whose messages are kept; the others are counted only.
_DECODED_TYPES = {JOINT_STATE, DIAGNOSTICS, ODOMETRY}
# Best effort requests no retransmission, so it delays no publisher; losses are shown.
_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# Topics that a page shows at most.
MAX_TOPICS = 60
# A walker's legs may answer in messages of their own; they differ in their names [bytes].
_JOINT_NAME_BYTES = slice(12, 96)
_MAX_NAME_SETS = 32
# A larger message is no leg's [bytes].
_MAX_MESSAGE_SIZE = 300_000


class SubscribedTopic:
    """
    A topic that is heard.

    Parameters
    ----------
    node : rclpy.node.Node
        Who hears it.
    group : RawCallbackGroup
        Of its subscription.
    name, kind : str
        The topic and its type.
    on_update : callable
        Is called when something was kept.

    Attributes
    ----------
    figures : TopicRate
        Its rate and losses.

    """

    def __init__(
        self,
        node: Node,
        group: RawCallbackGroup,
        name: str,
        kind: str,
        on_update: Callable[[], object],
    ) -> None:
        self.name, self.kind = name, kind
        self.figures = TopicRate()
        self._class = message_class(kind)
        self._newest: dict[object, tuple[float, bytes]] = {}
        self._decoded: dict[object, tuple[bytes, Any]] = {}
        self._on_update = on_update if kind in _DECODED_TYPES else None
        self.subscription = node.create_subscription(
            self._class,
            name,
            self._on_message,
            _QOS,
            raw=True,
            callback_group=group,
            event_callbacks=SubscriptionEventCallbacks(
                matched=self._on_matched, use_default_callbacks=False
            ),
        )

    def newest(self) -> list[tuple[float, Any]]:
        """Return when the newest messages came [s], and what they say; any thread may ask."""
        found = []
        for key, (time, data) in list(self._newest.items()):
            known = self._decoded.get(key)
            if known is None or known[0] is not data:
                try:
                    known = data, deserialize_message(data, self._class)
                # Anybody may send any bytes.
                except Exception:  # noqa: S112
                    continue
                self._decoded[key] = known
            found.append((time, known[1]))
        return found

    def _on_matched(self, status: Any) -> None:
        self.figures.loss.publishers_changed()
        self.figures.publishers = status.current_count

    def _on_message(self, data: bytes, info: Info) -> None:
        self.figures.add(info['publication_sequence_number'])
        if self._on_update is None or len(data) > _MAX_MESSAGE_SIZE:
            return
        key = (len(data) if self.kind == JOINT_STATE else 0, data[_JOINT_NAME_BYTES])
        if key not in self._newest and len(self._newest) >= _MAX_NAME_SETS:
            self._newest.clear()
            self._decoded.clear()
        self._newest[key] = monotonic(), data
        self._on_update()


class TopicSubscriptions:
    """
    Subscribe to what legs publish, as it appears, and no longer than it is there.

    Parameters
    ----------
    node : rclpy.node.Node
        Who subscribes.
    on_update : callable
        Is called when a message has come that is shown.

    Attributes
    ----------
    topics : dict of str to SubscribedTopic
        By full name. Other threads read it: it is replaced, not changed.

    """

    def __init__(self, node: Node, on_update: Callable[[], object]) -> None:
        self.topics: dict[str, SubscribedTopic] = {}
        self._node, self._on_update = node, on_update
        self._group = RawCallbackGroup()
        self._refused: set[tuple[str, str]] = set()

    def look(self, known: Sequence[tuple[str, Sequence[str]]]) -> None:
        """Subscribe to new topics of the given names and types, and drop the vanished ones."""
        there = {
            name: kind for name, kinds in known for kind in kinds if self._is_wanted(name, kind)
        }
        gone = [name for name, topic in self.topics.items() if there.get(name) != topic.kind]
        if gone:
            for name in gone:
                self._node.destroy_subscription(self.topics[name].subscription)
            self.topics = {n: topic for n, topic in self.topics.items() if n not in gone}
        for name in sorted(set(there) - set(self.topics)):
            if len(self.topics) < MAX_TOPICS:
                self._subscribe(name, there[name])

    def of_kind(self, kind: str) -> list[SubscribedTopic]:
        """Return the topics of a type."""
        return [topic for topic in self.topics.values() if topic.kind == kind]

    def _is_wanted(self, name: str, kind: str) -> bool:
        last = name.rpartition('/')[2]
        if (name, kind) in self._refused or '/_' in name:
            return False
        fits = any(last.endswith(ending) for ending in _ENDINGS.get(kind, ()))
        return fits and self._node.count_publishers(name) > 0

    def _subscribe(self, name: str, kind: str) -> None:
        if name_refusal(name):
            self._refused.add((name, kind))
            return
        try:
            topic = SubscribedTopic(self._node, self._group, name, kind, self._on_update)
        except (UnknownMessageTypeError, *ROS_ERRORS) as error:
            self._refused.add((name, kind))
            self._node.get_logger().warning(f'{printable(name)} is not shown: {printable(error)}')
            return
        self.topics = {**self.topics, name: topic}
