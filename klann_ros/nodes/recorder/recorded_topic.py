"""One topic of a recording: its subscriptions, its place in the run, and what was lost of it."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TYPE_CHECKING

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.ledger import Ledger
from klann_ros.log.write.recording import Pauses
from klann_ros.nodes.endpoints import DEPTH, message_class
from klann_ros.nodes.raw_executor import Info
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# A latched publisher sends at most so many of those again that were heard from it already.
LATCHED_HISTORY = 2000
# Two subscriptions to a publisher hear a message at most so many messages apart.
MEMORY = 16_384


class RecordedTopic:
    """
    Subscribe to a topic as its publishers offer it, and hand on what it receives as raw bytes.

    There is a subscription for each kind of publisher (reliable or not, latched or not): one that
    asks for less would miss what a latched publisher sent before, one that asks for more hears
    nothing. What two of them hear is recorded once.

    Parameters
    ----------
    node : rclpy.node.Node
        Who subscribes.
    group : CallbackGroup
        Of the subscriptions.
    publishers : sequence of TopicEndpointInfo
        The topic's publishers, at least one.
    put : callable
        Takes every message.
    ledger : Ledger
        Where every message is counted.
    pauses : Pauses
        What is left out.
    changed : callable
        Is called with the topic's name when publishers come or go.
    is_own : callable, optional
        Tells the messages of the recorder's own publisher, where it has one on this topic. It is
        not among the publishers.

    Raises
    ------
    UnknownMessageTypeError, UnknownTypeError
        The message type is not installed.

    """

    def __init__(
        self,
        node: Node,
        group: CallbackGroup,
        name: str,
        publishers: Sequence[TopicEndpointInfo],
        *,
        put: Callable[[Message], None],
        ledger: Ledger,
        pauses: Pauses,
        changed: Callable[[str], object],
        is_own: Callable[[bytes], bool] | None = None,
    ) -> None:
        self.name, self.type = name, publishers[0].topic_type
        self._class, self._definition = message_class(self.type), definition(self.type)
        self._node, self._group, self._put, self._pauses = node, group, put, pauses
        self._account, self._changed, self._is_own = ledger[name], changed, is_own
        self._subscriptions: dict[tuple[Any, Any], Subscription] = {}
        self._publishers: dict[tuple[Any, Any], int] = {}
        self._left: dict[tuple[Any, Any], int] = {}
        self._count = 0
        self._recent: deque[tuple[int, int]] = deque(maxlen=LATCHED_HISTORY)
        self._repeats: _Repeats | None = None
        self.adapt(publishers)

    def adapt(self, publishers: Iterable[TopicEndpointInfo]) -> list[str]:
        """
        Listen so that all of the topic's publishers are heard.

        Returns
        -------
        list of str
            Message types that publishers have and that cannot be heard, as the topic's is another.

        """
        heard = [publisher for publisher in publishers if publisher.topic_type == self.type]
        if heard and not self._account.received:
            self._topic = self._describe(heard)
        for publisher in heard:
            self._hear(_to_receive(publisher.qos_profile))
        self._account.loss.identify(tuple(heard[0].endpoint_gid) if len(heard) == 1 else None)
        return sorted({publisher.topic_type for publisher in publishers} - {self.type})

    @property
    def has_publisher(self) -> bool:
        """Return whether anybody else publishes on it now."""
        return self._count > 0

    def take_queued(self) -> None:
        """Take what waits, as before the end, when no loop will take it any more."""
        for subscription in self._subscriptions.values():
            for data, info in _queued(subscription):
                self._on_message(data, info)

    def _describe(self, publishers: Sequence[TopicEndpointInfo]) -> Topic:
        profiles = (_recorded(publisher.qos_profile) for publisher in publishers)
        type_hash = str(publishers[0].topic_type_hash)
        return Topic(self.name, self.type, self._definition, qos_to_yaml(profiles), type_hash)

    def _hear(self, profile: QoSProfile) -> None:
        kind = (profile.reliability, profile.durability)
        if kind in self._subscriptions:
            return
        if self._subscriptions and self._repeats is None:
            self._repeats = _Repeats(self._recent)
        self._publishers[kind] = 0
        latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self._account.loss.latched = self._account.loss.latched or latched
        self._subscriptions[kind] = self._node.create_subscription(
            self._class,
            self.name,
            self._on_message,
            profile,
            raw=True,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(
                matched=partial(self._on_matched, kind),
                # A publisher that offers less than the others: it needs a subscription of its own.
                incompatible_qos=lambda _: self._changed(self.name),
                use_default_callbacks=False,
            ),
        )

    def _on_matched(self, kind: tuple[Any, Any], status: Any) -> None:
        # Whoever comes or goes: the next message may be of another publisher.
        self._account.loss.forget()
        self._publishers[kind] = status.current_count
        self._left[kind] = status.total_count - status.current_count
        self._account.loss.left = max(self._left.values())
        self._count = max(self._publishers.values()) - (self._is_own is not None)
        self._changed(self.name)

    def _on_message(self, data: bytes, info: Info) -> None:
        if self._is_own is not None and self._is_own(data):
            return
        account, sequence = self._account, info['publication_sequence_number']
        publish_time, log_time = info['source_timestamp'], info['received_timestamp']
        if self._repeats is None:
            if account.loss.count(sequence, self._count):
                self._changed(self.name)
            self._recent.append((publish_time, sequence or 0))
        elif self._repeats.has(publish_time, sequence or 0):
            return
        else:
            # The order in which two subscriptions hear something tells nothing.
            account.loss.count(None, 2)
        account.received += 1
        if not self._pauses.leaves_out(account, log_time):
            self._put(Message(self._topic, data, log_time, publish_time, sequence or 0))


class _Repeats:
    """
    Tells a message that another subscription heard before, by its source's time and number.

    Parameters
    ----------
    before
        The last ones that came so far.

    """

    def __init__(self, before: Iterable[tuple[int, int]]) -> None:
        self._order = deque(before)
        self._known = set(self._order)

    def has(self, source_time: int, sequence: int) -> bool:
        """Return whether a message came before, and remember it."""
        identity = (source_time, sequence)
        if identity in self._known:
            return True
        self._known.add(identity)
        self._order.append(identity)
        if len(self._order) > MEMORY:
            self._known.discard(self._order.popleft())
        return False


def _recorded(profile: QoSProfile) -> Qos:
    """Return a profile as a log holds it."""
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


def _to_receive(offered: QoSProfile) -> QoSProfile:
    """
    Return the profile that receives the most from publishers with this profile.

    A reliable or latched subscription gets nothing from a publisher that is not, so it asks for
    either only where the publisher offers it.
    """
    reliable = offered.reliability == ReliabilityPolicy.RELIABLE
    latched = offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _queued(subscription: Any) -> Iterator[tuple[bytes, Info]]:
    """Take and yield the messages that wait, with what the middleware knows about each."""
    # No more than the queue holds, so that a flood cannot starve timers and services.
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            message = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if message is None:
            return
        yield message
