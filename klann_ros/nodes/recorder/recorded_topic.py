"""Subscriptions to one recorded topic, and its drop counters."""

from collections import deque, OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from klann_ros.log import definition, Message, Qos, qos_to_yaml, Recording, Topic
from klann_ros.nodes.endpoints import DEPTH, message_class
from klann_ros.nodes.raw_executor import Info
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

# Messages that a latched publisher may repeat to a second subscription.
_LATCHED_HISTORY = 2000
# Maximum lag between two subscriptions to a publisher [messages].
_MAX_SUBSCRIPTION_LAG = 16_384
# Reliability and durability of a subscription.
_Policies = tuple[Any, Any]
# Source timestamp and sequence number of a message.
_Identity = tuple[int, int]


@dataclass
class _Subscription:
    """rclpy's subscription, and the numbers of publishers that match it and that have left."""

    rclpy_subscription: Any = None
    publisher_count: int = 0
    departed_count: int = 0


class _DuplicateFilter:
    """Find the messages that two subscriptions have received."""

    def __init__(self, recent: Iterable[_Identity]) -> None:
        self._received = OrderedDict.fromkeys(recent)

    def is_duplicate(self, identity: _Identity) -> bool:
        """Note a message; return whether it was received before."""
        if identity in self._received:
            return True
        self._received[identity] = None
        if len(self._received) > _MAX_SUBSCRIPTION_LAG:
            self._received.popitem(last=False)
        return False


class RecordedTopic:
    """
    Subscribe to a topic with the QoS of its publishers, and pass on the raw messages.

    Each kind of publisher (reliable or not, latched or not) has its own subscription: a weaker
    one would miss latched messages, a stronger one would not match. A message that two of them
    receive is recorded once.

    `put` takes the messages that a pause does not skip, `on_change` the topic's name when
    publishers appear or leave. `is_own` recognizes the recorder's own messages.
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
        self.name = name
        self.type = publishers[0].topic_type
        # Takes a profile and event callbacks.
        self._create_subscription = partial(
            node.create_subscription,
            message_class(self.type),
            name,
            self._on_message,
            raw=True,
            callback_group=group,
        )
        self._definition = definition(self.type)
        self._put = put
        self._pauses = recording.pauses
        self._counters = recording.counters[name]
        self._on_change = on_change
        self._is_own = is_own
        self._subscriptions: dict[_Policies, _Subscription] = {}
        # The number of present publishers, without the recorder's own.
        self.publisher_count = 0
        # The last messages of a single subscription; the filter of two.
        self._recent = deque[_Identity](maxlen=_LATCHED_HISTORY)
        self._duplicates: _DuplicateFilter | None = None
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

    def take_queued(self) -> None:
        """Read the queued messages, as at the end, when no loop reads them."""
        for subscription in self._subscriptions.values():
            for data, info in _take_messages(subscription.rclpy_subscription):
                self._on_message(data, info)

    def _describe(self, publishers: Sequence[TopicEndpointInfo]) -> Topic:
        profiles = (_recorded_qos(publisher.qos_profile) for publisher in publishers)
        type_hash = str(publishers[0].topic_type_hash)
        return Topic(self.name, self.type, self._definition, qos_to_yaml(profiles), type_hash)

    def _subscribe(self, profile: QoSProfile) -> None:
        """Subscribe with a profile, unless a subscription has its policies already."""
        policies = (profile.reliability, profile.durability)
        if policies in self._subscriptions:
            return
        if self._subscriptions and self._duplicates is None:
            # A publisher may match both.
            self._duplicates = _DuplicateFilter(self._recent)
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self._counters.loss.latched = True
        subscription = _Subscription()
        subscription.rclpy_subscription = self._create_subscription(
            profile,
            event_callbacks=SubscriptionEventCallbacks(
                matched=partial(self._on_matched, subscription),
                # `adapt` adds a subscription for a publisher with a weaker QoS.
                incompatible_qos=lambda _: self._on_change(self.name),
                # rclpy's would log a warning.
                use_default_callbacks=False,
            ),
        )
        self._subscriptions[policies] = subscription

    def _on_matched(self, subscription: _Subscription, status: Any) -> None:
        subscription.publisher_count = status.current_count
        subscription.departed_count = status.total_count - status.current_count
        subscriptions = self._subscriptions.values()
        self._counters.loss.publishers_changed()
        self._counters.loss.departed = max(s.departed_count for s in subscriptions)
        publisher_count = max(s.publisher_count for s in subscriptions)
        self.publisher_count = publisher_count - (self._is_own is not None)
        self._on_change(self.name)

    def _on_message(self, data: bytes, info: Info) -> None:
        """Count a message; pass it on, unless it is a duplicate, or comes in a pause."""
        if self._is_own is not None and self._is_own(data):
            return
        counters = self._counters
        sequence = info['publication_sequence_number']
        publish_time = info['source_timestamp']
        log_time = info['received_timestamp']
        identity = (publish_time, sequence or 0)
        if self._duplicates is None:
            if counters.loss.count(sequence, self.publisher_count, publish_time):
                self._on_change(self.name)
            self._recent.append(identity)
        elif self._duplicates.is_duplicate(identity):
            return
        else:
            # The order of messages of two subscriptions is undefined.
            counters.loss.count(None, 2)
        counters.received += 1
        if not self._pauses.skips(counters, log_time):
            self._put(Message(self._topic, data, log_time, publish_time, sequence or 0))


def _recorded_qos(profile: QoSProfile) -> Qos:
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


def _take_messages(subscription: Any) -> Iterator[tuple[bytes, Info]]:
    # At most the queue depth, so that a flood cannot starve timers and services.
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            message = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if message is None:
            return
        yield message
