"""What the page hears: the topics of legs, each with its newest messages and its figures."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

from klann_ros.live.rates import TopicFigures
from klann_ros.nodes.endpoints import message_class, name_refusal, UnknownMessageTypeError
from klann_ros.nodes.lean_loop import Info, LeanCallbackGroup
from klann_ros.nodes.process import ROS_ERRORS
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
# What is heard of: its type, and what its name ends in, for types that others use as well.
_ENDINGS = {
    JOINT_STATE: ('',),
    DIAGNOSTICS: ('diagnostics',),
    ODOMETRY: ('odom',),
    CRANK_ANGLE: ('crank_angle',),
    TWIST: ('velocity_h', 'cmd_vel'),
    'geometry_msgs/msg/PointStamped': ('point_h',),
}
# Whose messages are kept; the others are counted only.
_KEPT = {JOINT_STATE, DIAGNOSTICS, ODOMETRY}
# Who asks for nothing again slows nobody down; what the page misses it tells.
_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# A page has room for so many.
MOST_TOPICS = 60
# A walker's legs may answer in messages of their own; they differ in their names [bytes].
_NAMES = slice(12, 96)
_MOST_KINDS = 32
# What is larger is no leg's [bytes].
_LARGEST = 300_000


class HeardTopic:
    """
    A topic that is heard.

    Parameters
    ----------
    node : rclpy.node.Node
        Who hears it.
    group : LeanCallbackGroup
        Of its subscription.
    name, kind : str
        The topic and its type.
    on_news : callable
        Is called when something was kept.

    Attributes
    ----------
    figures : TopicFigures
        Its rate and losses.

    """

    def __init__(
        self,
        node: Node,
        group: LeanCallbackGroup,
        name: str,
        kind: str,
        on_news: Callable[[], object],
    ) -> None:
        self.name, self.kind = name, kind
        self.figures = TopicFigures()
        self._class = message_class(kind)
        self._newest: dict[object, tuple[float, bytes]] = {}
        self._decoded: dict[object, tuple[bytes, Any]] = {}
        self._on_news = on_news if kind in _KEPT else None
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
        self.figures.loss.forget()
        self.figures.publishers = status.current_count

    def _on_message(self, data: bytes, info: Info) -> None:
        self.figures.add(info['publication_sequence_number'])
        if self._on_news is None or len(data) > _LARGEST:
            return
        key = (len(data) if self.kind == JOINT_STATE else 0, data[_NAMES])
        if key not in self._newest and len(self._newest) >= _MOST_KINDS:
            self._newest.clear()
            self._decoded.clear()
        self._newest[key] = monotonic(), data
        self._on_news()


class Ears:
    """
    Subscribe to what legs publish, as it appears, and no longer than it is there.

    Parameters
    ----------
    node : rclpy.node.Node
        Who subscribes.
    on_news : callable
        Is called when a message has come that is shown.

    Attributes
    ----------
    topics : dict of str to HeardTopic
        By full name. Other threads read it: it is replaced, not changed.

    """

    def __init__(self, node: Node, on_news: Callable[[], object]) -> None:
        self.topics: dict[str, HeardTopic] = {}
        self._node, self._on_news = node, on_news
        self._group = LeanCallbackGroup()
        self._refused: set[tuple[str, str]] = set()

    def look(self, known: Sequence[tuple[str, Sequence[str]]]) -> None:
        """Subscribe to what is new of some topics with their types, and forget what is gone."""
        there = {
            name: kind for name, kinds in known for kind in kinds if self._is_wanted(name, kind)
        }
        gone = [name for name, topic in self.topics.items() if there.get(name) != topic.kind]
        if gone:
            for name in gone:
                self._node.destroy_subscription(self.topics[name].subscription)
            self.topics = {n: topic for n, topic in self.topics.items() if n not in gone}
        for name in sorted(set(there) - set(self.topics)):
            if len(self.topics) < MOST_TOPICS:
                self._hear(name, there[name])

    def of_kind(self, kind: str) -> list[HeardTopic]:
        """Return the topics of a type."""
        return [topic for topic in self.topics.values() if topic.kind == kind]

    def _is_wanted(self, name: str, kind: str) -> bool:
        last = name.rpartition('/')[2]
        if (name, kind) in self._refused or '/_' in name:
            return False
        fits = any(last.endswith(ending) for ending in _ENDINGS.get(kind, ()))
        return fits and self._node.count_publishers(name) > 0

    def _hear(self, name: str, kind: str) -> None:
        if name_refusal(name):
            self._refused.add((name, kind))
            return
        try:
            topic = HeardTopic(self._node, self._group, name, kind, self._on_news)
        except (UnknownMessageTypeError, *ROS_ERRORS) as error:
            self._refused.add((name, kind))
            self._node.get_logger().warning(f'{printable(name)} is not shown: {printable(error)}')
            return
        self.topics = {**self.topics, name: topic}
