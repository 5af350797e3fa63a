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
from klann_ros.nodes.process import LOG_PERIOD, ros_error, ROS_ERRORS
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

# Warnings about topics at the start.
_MAX_WARNINGS = 20
# Depth of a queue, as a damaged log may hold any number.
MAX_DEPTH = 100_000
# Depth of a latched topic whose depth is not in the log; most keep 1 message.
LATCHED_DEPTH = 10


class UnplayableTopicError(Exception):
    """A topic that cannot be played; the text says why."""


class PlayedTopics:
    """A publisher for each topic, under its own or its new full name; refusals are logged."""

    def __init__(self, node: Node, topics: Iterable[Topic], renamed: Mapping[str, str]) -> None:
        self._node = node
        self._renamed = renamed
        self._publishers: dict[Topic, Publisher] = {}
        # The number of messages that each latched topic keeps for late subscribers.
        self.latched: dict[str, int] = {}
        self._qos = QosTexts()
        self._warnings: list[str] = []
        by_name: dict[str, list[Topic]] = {}
        for topic in topics:
            by_name.setdefault(topic.name, []).append(topic)
        for name, channels in by_name.items():
            self._try(name, channels)
        more = len(self._warnings) - _MAX_WARNINGS
        shown = self._warnings[:_MAX_WARNINGS]
        if more > 0:
            shown.append(f'and {more} more {verb(more, "complaint", "complaints")} about topics')
        for warning in shown:
            node.get_logger().warning(printable_line(warning))

    @property
    def names(self) -> frozenset[str]:
        """Return the played topics' names in the log."""
        return frozenset(topic.name for topic in self._publishers)

    @property
    def published_names(self) -> frozenset[str]:
        """Return the full names of the published topics."""
        return frozenset(publisher.topic_name for publisher in self._publishers.values())

    def publish(self, message: Message) -> None:
        """Publish a message's bytes."""
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            return
        try:
            publisher.publish(message.data)
        except RCLError as error:
            self._node.get_logger().error(
                f'a message of {printable(message.topic.name)} is left out: {ros_error(error)}',
                throttle_duration_sec=LOG_PERIOD,
            )

    def flush(self) -> None:
        """Wait until the last messages have arrived, up to a timeout."""
        flush(set(self._publishers.values()))

    def _try(self, name: str, channels: Sequence[Topic]) -> None:
        try:
            self._make(name, channels)
        except (UnplayableTopicError, UnknownMessageTypeError, *ROS_ERRORS) as error:
            self._warnings.append(f'{printable(name)} is not played: {ros_error(error)}')

    def _make(self, name: str, channels: Sequence[Topic]) -> None:
        """Make the publisher of a topic that may have several channels in the log."""
        first = channels[0]
        full = self._full_name(self._renamed.get(name, name))
        kind = _kind(first)
        alike = []
        for topic in channels:
            if (topic.type, topic.message_encoding) == (first.type, first.message_encoding):
                alike.append(topic)
            else:
                self._warnings.append(
                    f'{printable(name)} is not played as {printable(topic.type)} '
                    f'({printable(topic.message_encoding)}): in the same log it is '
                    f'{printable(first.type)}'
                )
        offered = [qos for topic in alike for qos in self._offered(topic)]
        publisher = self._node.create_publisher(kind, full, publishing_profile(offered))
        self._publishers.update(dict.fromkeys(alike, publisher))
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
            name = printable(topic.name)
            self._warnings.append(f'{name} is played reliable and volatile: {error}')
            return []


def _kind(topic: Topic) -> type:
    if topic.message_encoding != 'cdr':
        encoding = printable(topic.message_encoding) or 'of no encoding'
        raise UnplayableTopicError(f'its messages are {encoding}, not cdr')
    kind: type = message_class(topic.type)
    return kind


def publishing_profile(offered: Sequence[Qos]) -> QoSProfile:
    """
    Return the profile that matches every subscription to one of the recorded publishers.

    It is reliable or latched if one of them was; durations and liveliness are the first's.
    Discovery does not include history and depth, so most logs lack them.
    """
    if not offered:
        return OUTPUT
    first = offered[0]
    latched = latched_count(offered)
    known = any(profile.depth or profile.history == 'keep_all' for profile in offered)
    # A latched topic must not repeat more than was latched; other queues have at least the depth
    # of this package's own.
    least = (1 if known else LATCHED_DEPTH) if latched else DEPTH
    depth = min(max(latched or first.depth, least), MAX_DEPTH)
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
    """Return the policy of a recorded word; `otherwise` for one that no publisher can offer."""
    if word in ('unknown', 'system_default', 'best_available'):
        return otherwise
    return policies.__members__.get(word.upper(), otherwise)  # type: ignore[attr-defined]
