"""Other nodes, as the live page needs them: the ROS graph and subscriptions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

from klann_ros.live import TopicRate
from klann_ros.log import DESCRIPTION_TOPIC, STRING_TYPE
from klann_ros.nodes import endpoints
from klann_ros.nodes.process import ROS_ERRORS
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.sanitize.text import printable
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

JOINT_STATE_TYPE = 'sensor_msgs/msg/JointState'
DIAGNOSTICS_TYPE = 'diagnostic_msgs/msg/DiagnosticArray'
ODOMETRY_TYPE = 'nav_msgs/msg/Odometry'
# The topic of a simulated robot's true pose.
TRUTH = 'ground_truth'
_CRANK_ANGLE_TYPE = 'std_msgs/msg/Float64'
_TWIST_TYPE = 'geometry_msgs/msg/TwistStamped'
_TRIGGER_TYPE = 'std_srvs/srv/Trigger'
# Subscribed types, and the endings of names for types that other nodes use as well.
_ENDINGS = {
    JOINT_STATE_TYPE: ('',),
    DIAGNOSTICS_TYPE: ('diagnostics',),
    ODOMETRY_TYPE: ('odom', TRUTH),
    STRING_TYPE: (DESCRIPTION_TOPIC,),
    _CRANK_ANGLE_TYPE: ('crank_angle',),
    _TWIST_TYPE: ('velocity_h', 'cmd_vel'),
    'geometry_msgs/msg/PointStamped': ('point_h',),
}
# Types whose messages are stored; the others are counted only.
_STORED_TYPES = {JOINT_STATE_TYPE, DIAGNOSTICS_TYPE, ODOMETRY_TYPE, STRING_TYPE, _CRANK_ANGLE_TYPE}
# Best effort requests no retransmission, so it delays no publisher; losses are shown.
_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# Maximum numbers of topics and machines of a page.
_MAX_TOPICS = 60
_MAX_MACHINES = 12
# A walker's legs may answer in messages of their own; they differ in their names [bytes].
_JOINT_NAME_BYTES = slice(12, 96)
_MAX_NAME_SETS = 32
# A larger message is no leg's [bytes].
_MAX_MESSAGE_SIZE = 300_000
# A shorter silence is not shown [s].
_SHOWN_SILENCE = 2.0
# Services that identify recorders and players, and those that pages may call.
_RECORDER_SERVICES = {'pause', 'resume', 'split'}
_PLAYER_SERVICES = {'pause', 'resume', 'step'}
_BUTTONS = {
    'recorder': ('pause', 'resume', 'split', 'trigger'),
    'player': tuple(sorted(_PLAYER_SERVICES)),
}

# Names of topics, each with its types.
Names = Sequence[tuple[str, Sequence[str]]]


@dataclass(frozen=True)
class Machine:
    """A recorder or a player: its kind, the node's full name, and its services for pages."""

    kind: str
    node: str
    services: tuple[str, ...]


class RosGraph:
    """Query the ROS graph, without this node and without names that ROS refuses."""

    def __init__(self, node: Node) -> None:
        self._node = node
        # Names that are none of another node's.
        self._excluded = {'', node.get_fully_qualified_name()}

    def topics(self) -> list[tuple[str, list[str]]]:
        """Return the topics with their types; none if a name is no text."""
        return _query(self._node.get_topic_names_and_types)

    def publishers(self, topic: str) -> list[Any]:
        """Return the publishers of a topic."""
        infos = _query(lambda: self._node.get_publishers_info_by_topic(topic))
        return [info for info in infos if endpoints.node_of(info) not in self._excluded]

    def names_of_publishers(self, topic: str) -> list[str]:
        """Return the names of the nodes that publish on a topic, each once."""
        return list(dict.fromkeys(map(endpoints.node_of, self.publishers(topic))))

    def names_of_subscribers(self, topic: str) -> list[str]:
        """Return the names of the nodes that subscribe to a topic."""
        infos = _query(lambda: self._node.get_subscriptions_info_by_topic(topic))
        return [name for name in map(endpoints.node_of, infos) if name not in self._excluded]

    def crank_topics(self, node: str) -> list[str]:
        """Return the topics of crank angles that a node subscribes to."""
        namespace, _, name = node.rpartition('/')
        subscribed = _query(
            lambda: self._node.get_subscriber_names_and_types_by_node(name, namespace or '/')
        )
        topics = [topic for topic, kinds in subscribed if _CRANK_ANGLE_TYPE in kinds]
        return sorted(topic for topic in topics if not endpoints.name_refusal(topic))

    def walker_topics(self, topics: Names) -> list[str]:
        """Return the topics of velocities that have a subscriber."""
        names = []
        for name, kinds in topics:
            is_velocity = _TWIST_TYPE in kinds and name.rpartition('/')[2] == 'cmd_vel'
            if is_velocity and not endpoints.name_refusal(name):
                names.append(name)
        return sorted(name for name in names if self._node.count_subscribers(name) > 0)

    def machines(self) -> list[Machine]:
        """Return the recorders and players."""
        services_of_nodes: dict[str, set[str]] = {}
        for service, kinds in _query(self._node.get_service_names_and_types):
            if _TRIGGER_TYPE in kinds and not endpoints.name_refusal(service):
                node, _, name = service.rpartition('/')
                services_of_nodes.setdefault(node, set()).add(name)
        machines = []
        for node, names in sorted(services_of_nodes.items()):
            kind = ''
            if names >= _RECORDER_SERVICES:
                kind = 'recorder'
            elif names >= _PLAYER_SERVICES:
                kind = 'player'
            # A service is listed as long as it has a client, such as this node.
            if kind and node and self._node.count_services(f'{node}/pause') > 0:
                services = tuple(name for name in _BUTTONS[kind] if name in names)
                machines.append(Machine(kind, node, services))
        return machines[:_MAX_MACHINES]


class SubscribedTopic:
    """A topic with its rate and newest messages; `on_update` is called when one is to be shown."""

    def __init__(
        self,
        node: Node,
        group: RawCallbackGroup,
        name: str,
        kind: str,
        on_update: Callable[[], object],
    ) -> None:
        self.name = name
        self.kind = kind
        self.rate = TopicRate()
        self._class = endpoints.message_class(kind)
        # The newest messages with their times of reception [s], and decoded, by length and names.
        self._newest: dict[object, tuple[float, bytes]] = {}
        self._decoded: dict[object, tuple[bytes, Any]] = {}
        self._on_update = on_update
        self.subscription = node.create_subscription(
            self._class,
            name,
            self._on_message,
            endpoints.LATCHED if kind == STRING_TYPE else _QOS,
            raw=True,
            callback_group=group,
            event_callbacks=SubscriptionEventCallbacks(
                matched=self._on_matched, use_default_callbacks=False
            ),
        )

    def newest(self) -> list[tuple[float, Any]]:
        """Return the newest messages with their times of reception [s]; thread safe."""
        messages = []
        for key, (time, data) in list(self._newest.items()):
            decoded_data, message = self._decoded.get(key, (None, None))
            if decoded_data is not data:
                try:
                    message = deserialize_message(data, self._class)
                # Untrusted bytes.
                except Exception:  # noqa: S112
                    continue
                self._decoded[key] = (data, message)
            messages.append((time, message))
        return messages

    def as_data(self) -> dict[str, Any]:
        """Return its rate and losses for the page, ready for JSON."""
        silence = self.rate.silence()
        return {
            'name': printable(self.name),
            'type': self.kind,
            'rate': round(self.rate.rate(), 1),
            'lost': self.rate.lost,
            'publishers': self.rate.publishers,
            'latched': self.kind == STRING_TYPE,
            'silence': None if silence is None or silence < _SHOWN_SILENCE else round(silence),
        }

    def _on_matched(self, status: Any) -> None:
        self.rate.loss.publishers_changed()
        self.rate.publishers = status.current_count

    def _on_message(self, data: bytes, info: Info) -> None:
        self.rate.add(info['publication_sequence_number'])
        if self.kind not in _STORED_TYPES or len(data) > _MAX_MESSAGE_SIZE:
            return
        # Those bytes of an odometry are its numbers.
        names = b'' if self.kind == ODOMETRY_TYPE else data[_JOINT_NAME_BYTES]
        key = (len(data) if self.kind == JOINT_STATE_TYPE else 0, names)
        if key not in self._newest and len(self._newest) >= _MAX_NAME_SETS:
            self._newest.clear()
            self._decoded.clear()
        self._newest[key] = monotonic(), data
        # The page shows the pose that answers a crank angle.
        if self.kind != _CRANK_ANGLE_TYPE:
            self._on_update()


class TopicSubscriptions:
    """Subscribe to the topics of legs while they have publishers."""

    def __init__(self, node: Node, on_update: Callable[[], object]) -> None:
        # Topics by their full names. Other threads read this: it is replaced, not changed.
        self.topics: dict[str, SubscribedTopic] = {}
        self._node = node
        self._on_update = on_update
        self._group = RawCallbackGroup()
        self._refused: set[tuple[str, str]] = set()

    def update(self, published: Names) -> None:
        """Subscribe to new topics of the published ones, and drop the vanished ones."""
        kinds_by_name = {}
        for name, kinds in published:
            for kind in kinds:
                if self._is_wanted(name, kind):
                    kinds_by_name[name] = kind
        for name, topic in list(self.topics.items()):
            if kinds_by_name.get(name) != topic.kind:
                self._node.destroy_subscription(topic.subscription)
                self.topics = {n: self.topics[n] for n in self.topics if n != name}
        for name in sorted(set(kinds_by_name) - set(self.topics)):
            if len(self.topics) < _MAX_TOPICS:
                self._subscribe(name, kinds_by_name[name])

    def messages(self, name: str) -> list[tuple[float, Any]]:
        """Return the newest messages of a topic; none without a subscription."""
        topic = self.topics.get(name)
        return [] if topic is None else topic.newest()

    def rate_of(self, name: str) -> TopicRate | None:
        """Return the rate of a topic; None without a subscription."""
        topic = self.topics.get(name)
        return None if topic is None else topic.rate

    def of_kind(self, kind: str) -> list[SubscribedTopic]:
        """Return the topics of a type."""
        return [topic for topic in self.topics.values() if topic.kind == kind]

    def _is_wanted(self, name: str, kind: str) -> bool:
        last = name.rpartition('/')[2]
        if (name, kind) in self._refused or '/_' in name:
            return False
        is_of_leg = last.endswith(_ENDINGS.get(kind, ()))
        return is_of_leg and self._node.count_publishers(name) > 0

    def _subscribe(self, name: str, kind: str) -> None:
        if endpoints.name_refusal(name):
            self._refused.add((name, kind))
            return
        try:
            topic = SubscribedTopic(self._node, self._group, name, kind, self._on_update)
        except (endpoints.UnknownMessageTypeError, *ROS_ERRORS) as error:
            self._refused.add((name, kind))
            self._node.get_logger().warning(f'{printable(name)} is not shown: {printable(error)}')
            return
        self.topics = {**self.topics, name: topic}


def _query(query: Callable[[], Any]) -> list[Any]:
    """Return the middleware's answer; an empty one if it fails."""
    try:
        return list(query())
    # A foreign name that is no text, or a node that has just gone.
    except (UnicodeDecodeError, NodeNameNonExistentError, *ROS_ERRORS):
        return []
