"""The topics of a log, published as they were recorded."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from klann_ros.log.errors import MalformedQosError
from klann_ros.log.qos import latched_count, Qos, QosTexts
from klann_ros.log.records import Message, Topic
from klann_ros.nodes.endpoints import (
    DEPTH,
    flush,
    message_class,
    name_refusal,
    OUTPUT,
    UnknownMessageTypeError,
)
from klann_ros.nodes.process import ros_error, ROS_ERRORS
from klann_ros.sanitize.text import printable, printable_line, verb
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

# How often a complaint about messages is logged at most [s].
THROTTLE = 2.0
# A log may have any number of topics that cannot be played; so many are named.
MOST_NAMED = 20
# A log may be damaged; nobody keeps more.
MOST_DEPTH = 100_000
# Where a log does not tell how many messages a latched topic kept; most keep 1.
LATCHED_DEPTH = 10


class UnplayableTopicError(Exception):
    """A topic that cannot be played; the text says why."""


class PlayedTopics:
    """
    A publisher for each topic; why one cannot be played is logged.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose publishers they are. In a namespace a replay does not meet the live topics.
    topics : iterable of Topic
        What is played.
    renamed : mapping of str to str
        Full names under which topics are published instead of their own.

    Attributes
    ----------
    latched : dict of str to int
        How many of its last messages each latched topic keeps for those who come late.

    """

    def __init__(self, node: Node, topics: Iterable[Topic], renamed: Mapping[str, str]) -> None:
        self._node = node
        self._renamed = renamed
        self._made: dict[Topic, Publisher] = {}
        self.latched: dict[str, int] = {}
        self._qos = QosTexts()
        self._complaints: list[str] = []
        by_name: dict[str, list[Topic]] = {}
        for topic in topics:
            by_name.setdefault(topic.name, []).append(topic)
        for name, channels in by_name.items():
            self._try(name, channels)
        self._complain()

    @property
    def names(self) -> frozenset[str]:
        """Return the names in the log of what is played."""
        return frozenset(topic.name for topic in self._made)

    @property
    def published_names(self) -> frozenset[str]:
        """Return the full names of the topics that are published."""
        return frozenset(publisher.topic_name for publisher in self._made.values())

    def publish(self, message: Message) -> None:
        """Publish a message's bytes."""
        publisher = self._made.get(message.topic)
        if publisher is None:
            return
        try:
            publisher.publish(message.data)
        except RCLError as error:
            self._node.get_logger().error(
                f'a message of {printable(message.topic.name)} is left out: {ros_error(error)}',
                throttle_duration_sec=THROTTLE,
            )

    def flush(self) -> None:
        """Wait until what is under way has arrived, but not for ever."""
        flush(set(self._made.values()))

    def _try(self, name: str, channels: Sequence[Topic]) -> None:
        try:
            self._make(name, channels)
        except (UnplayableTopicError, UnknownMessageTypeError, *ROS_ERRORS) as error:
            self._complaints.append(f'{printable(name)} is not played: {ros_error(error)}')

    def _make(self, name: str, channels: Sequence[Topic]) -> None:
        """Make the one publisher of a topic that may have been recorded in several channels."""
        first = channels[0]
        full = self._full_name(self._renamed.get(name, name))
        kind = _kind(first)
        alike = [topic for topic in channels if _is_alike(topic, first)]
        for topic in channels:
            if not _is_alike(topic, first):
                self._complaints.append(
                    f'{printable(name)} is not played as {printable(topic.type)} '
                    f'({printable(topic.message_encoding)}): in the same log it is '
                    f'{printable(first.type)}'
                )
        offered = [qos for topic in alike for qos in self._offered(topic)]
        publisher = self._node.create_publisher(kind, full, publishing_profile(offered))
        self._made.update(dict.fromkeys(alike, publisher))
        if offered and latched_count(offered):
            self.latched[name] = latched_count(offered)

    def _full_name(self, name: str) -> str:
        full = f'{self._node.get_namespace().rstrip("/")}/{name.removeprefix("/")}'
        reason = name_refusal(full)
        if reason:
            raise UnplayableTopicError(reason)
        return full

    def _offered(self, topic: Topic) -> list[Qos]:
        try:
            return self._qos.profiles(topic.qos)
        except MalformedQosError as error:
            self._complaints.append(
                f'{printable(topic.name)} is played reliable and volatile: {error}'
            )
            return []

    def _complain(self) -> None:
        more = len(self._complaints) - MOST_NAMED
        said = self._complaints[:MOST_NAMED]
        if more > 0:
            said.append(f'and {more} more {verb(more, "complaint", "complaints")} about topics')
        for complaint in said:
            self._node.get_logger().warning(printable_line(complaint))


def _kind(topic: Topic) -> type:
    if topic.message_encoding != 'cdr':
        encoding = printable(topic.message_encoding) or 'of no encoding'
        raise UnplayableTopicError(f'its messages are {encoding}, not cdr')
    kind: type = message_class(topic.type)
    return kind


def _is_alike(topic: Topic, other: Topic) -> bool:
    return (topic.type, topic.message_encoding) == (other.type, other.message_encoding)


def publishing_profile(offered: Sequence[Qos]) -> QoSProfile:
    """
    Return the profile that everybody hears who heard one of the recorded publishers.

    It is reliable or latched where one of them was; durations and liveliness are the first's.
    Discovery does not tell a publisher's history and depth, so most logs do not know them.
    """
    if not offered:
        return OUTPUT
    first = offered[0]
    latched = latched_count(offered)
    known = any(profile.depth or profile.history == 'keep_all' for profile in offered)
    # Who comes late to a latched topic shall not hear more than there was; the others' queues
    # are as deep as this package's own at least.
    least = (1 if known else LATCHED_DEPTH) if latched else DEPTH
    depth = min(max(latched or first.depth, least), MOST_DEPTH)
    words = {
        _policy(ReliabilityPolicy, p.reliability, ReliabilityPolicy.RELIABLE) for p in offered
    }
    reliable = ReliabilityPolicy.RELIABLE in words
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        deadline=Duration(nanoseconds=first.deadline),
        lifespan=Duration(nanoseconds=first.lifespan),
        liveliness=_policy(LivelinessPolicy, first.liveliness, LivelinessPolicy.AUTOMATIC),
        liveliness_lease_duration=Duration(nanoseconds=first.liveliness_lease_duration),
        avoid_ros_namespace_conventions=first.avoid_ros_namespace_conventions,
    )


def _policy(policies: type, word: str, otherwise: object) -> object:
    """Return the policy of a recorded word; what a publisher cannot offer becomes `otherwise`."""
    if word in ('unknown', 'system_default', 'best_available'):
        return otherwise
    return policies.__members__.get(word.upper(), otherwise)  # type: ignore[attr-defined]
