"""Subscriptions to one recorded topic, and its drop counters."""

from collections import deque, OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TYPE_CHECKING

from klann_ros.log import definition, Message, Qos, qos_to_yaml, Recording, Topic
from klann_ros.nodes.endpoints import DEPTH, message_class
from klann_ros.nodes.raw_executor import Info
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# Messages that a latched publisher may repeat to a second subscription.
_LATCHED_HISTORY = 2000
# Maximum lag between two subscriptions to a publisher [messages].
_MAX_SUBSCRIPTION_LAG = 16_384


class RecordedTopic:
    """
    Subscribe to a topic with the QoS of its publishers, and pass on the raw messages.

    Each kind of publisher (reliable or not, latched or not) has its own subscription: a weaker
    one would miss latched messages, a stronger one would not match. A message that two of them
    receive is recorded once.

    `put` takes the messages that the recording counts, and does not skip in a pause. `on_change`
    receives the topic's name when publishers appear or leave. `is_own` recognizes
    messages of the recorder's own publisher, which is not among the publishers. An
    UnknownMessageTypeError or UnknownTypeError for a type that is not installed.
    """

    def __init__(
        self,
        node: Node,
        group: CallbackGroup,
        name: str,
        publishers: Sequence[TopicEndpointInfo],
        *,
        recording: Recording,
        put: Callable[[Message], None],
        on_change: Callable[[str], object],
        is_own: Callable[[bytes], bool] | None = None,
    ) -> None:
        self.name, self.type = name, publishers[0].topic_type
        self._class, self._definition = message_class(self.type), definition(self.type)
        self._node, self._group, self._put, self._pauses = node, group, put, recording.pauses
        self._counters, self._on_change = recording.counters[name], on_change
        self._is_own = is_own
        self._subscriptions: dict[tuple[Any, Any], Subscription] = {}
        self._publishers: dict[tuple[Any, Any], int] = {}
        self._departed: dict[tuple[Any, Any], int] = {}
        self._count = 0
        # Source timestamps and sequence numbers: the last ones of a single subscription, and those
        # that tell duplicates of two.
        self._recent = deque[tuple[int, int]](maxlen=_LATCHED_HISTORY)
        self._known: OrderedDict[tuple[int, int], None] | None = None
        self.adapt(publishers)

    def adapt(self, publishers: Iterable[TopicEndpointInfo]) -> list[str]:
        """Match all publishers of the topic's type; return other types, not recorded."""
        matching = [publisher for publisher in publishers if publisher.topic_type == self.type]
        if matching and not self._counters.received:
            self._topic = self._describe(matching)
        for publisher in matching:
            self._subscribe(_matching_profile(publisher.qos_profile))
        gid = tuple(matching[0].endpoint_gid) if len(matching) == 1 else None
        self._counters.loss.identify(gid)
        return sorted({publisher.topic_type for publisher in publishers} - {self.type})

    @property
    def has_publisher(self) -> bool:
        """Return whether another node publishes on it now."""
        return self._count > 0

    def take_queued(self) -> None:
        """Read the queued messages, as at the end, when no loop reads them."""
        for subscription in self._subscriptions.values():
            for data, info in _queued(subscription):
                self._on_message(data, info)

    def _describe(self, publishers: Sequence[TopicEndpointInfo]) -> Topic:
        profiles = (_recorded(publisher.qos_profile) for publisher in publishers)
        type_hash = str(publishers[0].topic_type_hash)
        return Topic(self.name, self.type, self._definition, qos_to_yaml(profiles), type_hash)

    def _subscribe(self, profile: QoSProfile) -> None:
        kind = (profile.reliability, profile.durability)
        if kind in self._subscriptions:
            return
        if self._subscriptions and self._known is None:
            self._known = OrderedDict.fromkeys(self._recent)
        self._publishers[kind] = 0
        latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self._counters.loss.latched = self._counters.loss.latched or latched
        self._subscriptions[kind] = self._node.create_subscription(
            self._class,
            self.name,
            self._on_message,
            profile,
            raw=True,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(
                matched=partial(self._on_matched, kind),
                # A publisher with a weaker QoS needs another subscription.
                incompatible_qos=lambda _: self._on_change(self.name),
                use_default_callbacks=False,
            ),
        )

    def _on_matched(self, kind: tuple[Any, Any], status: Any) -> None:
        self._counters.loss.publishers_changed()
        self._publishers[kind] = status.current_count
        self._departed[kind] = status.total_count - status.current_count
        self._counters.loss.departed = max(self._departed.values())
        self._count = max(self._publishers.values()) - (self._is_own is not None)
        self._on_change(self.name)

    def _on_message(self, data: bytes, info: Info) -> None:
        if self._is_own is not None and self._is_own(data):
            return
        counters, sequence = self._counters, info['publication_sequence_number']
        publish_time, log_time = info['source_timestamp'], info['received_timestamp']
        identity = (publish_time, sequence or 0)
        if self._known is None:
            if counters.loss.count(sequence, self._count):
                self._on_change(self.name)
            self._recent.append(identity)
        elif identity in self._known:
            return
        else:
            self._known[identity] = None
            if len(self._known) > _MAX_SUBSCRIPTION_LAG:
                self._known.popitem(last=False)
            # The order of messages of two subscriptions is undefined.
            counters.loss.count(None, 2)
        counters.received += 1
        if not self._pauses.skips(counters, log_time):
            self._put(Message(self._topic, data, log_time, publish_time, sequence or 0))


def _recorded(profile: QoSProfile) -> Qos:
    return Qos(
        history=profile.history.name.lower(),
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        deadline=profile.deadline.nanoseconds,
        lifespan=profile.lifespan.nanoseconds,
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_duration=profile.liveliness_lease_duration.nanoseconds,
        avoid_ros_namespace_conventions=profile.avoid_ros_namespace_conventions,
    )


def _matching_profile(offered: QoSProfile) -> QoSProfile:
    """Return the strongest subscription profile that matches a publisher."""
    reliable = offered.reliability == ReliabilityPolicy.RELIABLE
    latched = offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _queued(subscription: Any) -> Iterator[tuple[bytes, Info]]:
    # At most the queue depth, so that a flood cannot starve timers and services.
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            message = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if message is None:
            return
        yield message
