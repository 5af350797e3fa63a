"""
Leases: publishers of a crank angle or a velocity yield to a driver, and resume when it leaves.

A driver announces itself ten times a second on TOPIC/lease (diagnostic_msgs/msg/KeyValue: key is
the driver, value `held`, or `released` at the end). A publisher of TOPIC that yields sends nothing
meanwhile, and confirms each announcement on TOPIC/yielded (key: the publisher, value: the driver).
The first driver holds the lease; a second one gets no confirmation. Without an announcement for
LEASE_TIME on the steady clock the driver counts as dead, and the publishers resume. A release is
an announcement that expires after DELIVERY_TIME: the driver's last angle may arrive after it.
"""

from collections.abc import Callable
import secrets
from time import monotonic

from diagnostic_msgs.msg import KeyValue
from klann_ros.sanitize.text import printable
from rclpy.node import Node
from rclpy.qos import QoSProfile

from .endpoints import create_steady_timer

# Period of announcements, and the time after which a lease without one expires [s].
HEARTBEAT = 0.1
LEASE_TIME = 1.0
# Messages that were sent before another one on another topic have arrived after this time [s].
DELIVERY_TIME = 0.1
HELD = 'held'
RELEASED = 'released'
_QOS = QoSProfile(depth=20)
_MAX_NAME = 300
_MAX_PUBLISHERS = 64
# The leased topics, by the last part of their names; the two of a crank share a lease.
CRANK_ANGLE = 'crank_angle'
CRANK_STATE = 'crank_state'
CMD_VEL = 'cmd_vel'


def leased_topic(topic: str) -> str:
    """Return the topic whose lease covers a topic, '' for a topic without a lease."""
    parent, _, last = topic.rpartition('/')
    if last == CRANK_STATE:
        return f'{parent}/{CRANK_ANGLE}'
    return topic if last in {CRANK_ANGLE, CMD_VEL} else ''


class LeaseListener:
    """
    The publisher's side: the driver of a topic (full name), and confirmations of yielding.

    `on_change` receives the driver's name when it takes the topic, and '' when it leaves. A topic
    without a lease never has a driver.
    """

    def __init__(self, node: Node, topic: str, on_change: Callable[[str], object]) -> None:
        # The present driver's name, '' without one; and the name of the last driver.
        self.holder = self.last_holder = ''
        self._on_change = on_change
        self._node_name = node.get_fully_qualified_name()
        # The present driver's key, and the time of its last announcement [s].
        self._key = ''
        self._announced_at = 0.0
        # The topic whose lease counts, '' for none.
        self.topic = leased_topic(topic)
        if not self.topic:
            return
        self._confirmations = node.create_publisher(KeyValue, f'{self.topic}/yielded', _QOS)
        node.create_subscription(KeyValue, f'{self.topic}/lease', self._on_lease, _QOS)
        self._expiry = create_steady_timer(node, HEARTBEAT, self._check)
        self._expiry.cancel()

    def _on_lease(self, message: KeyValue) -> None:
        if not message.key or len(message.key) > _MAX_NAME:
            return
        if message.value == RELEASED and message.key == self._key:
            self._announced_at = monotonic() - LEASE_TIME + DELIVERY_TIME
        elif message.value == HELD and self._key in {'', message.key}:
            self._announced_at = monotonic()
            if not self._key:
                self._key = message.key
                self.holder = self.last_holder = printable(_node_of(message.key))
                self._expiry.reset()
                self._on_change(self.holder)
            self._confirmations.publish(KeyValue(key=self._node_name, value=self._key))

    def _check(self) -> None:
        if self._key and monotonic() - self._announced_at > LEASE_TIME:
            self._key = self.holder = ''
            self._expiry.cancel()
            self._on_change('')


class Lease:
    """
    The driver's side: announce the lease of a topic (full name), and collect yielding nodes.

    Its callbacks and `close` run in ROS's thread; all else is thread safe.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node = node
        # Two drivers may have one name.
        self._key = f'{node.get_fully_qualified_name()}#{secrets.token_hex(4)}'
        # The other driver that holds the lease, and the time of its last announcement [s].
        self._other = ('', 0.0)
        # Times of the last confirmations [s] by publisher, and of the last announcement [s].
        self._yielded: dict[str, float] = {}
        self._announced = 0.0
        self._held = False
        self._publisher = node.create_publisher(KeyValue, f'{topic}/lease', _QOS)
        self._subscriptions = [
            node.create_subscription(KeyValue, f'{topic}/lease', self._on_lease, _QOS),
            node.create_subscription(KeyValue, f'{topic}/yielded', self._on_yielded, _QOS),
        ]

    def announce(self) -> bool:
        """
        Hold the lease, at least every HEARTBEAT; return whether it was held without interruption.

        After an interruption publishers may have resumed: nothing may be sent before they have
        yielded again.
        """
        now = monotonic()
        is_uninterrupted = not self._held or now - self._announced < LEASE_TIME / 2.0
        if not self._held or now - self._announced >= HEARTBEAT / 2.0:
            self._held = True
            self._announced = now
            self._publisher.publish(KeyValue(key=self._key, value=HELD))
        return is_uninterrupted

    def release(self) -> None:
        """Let the publishers resume."""
        if self._held:
            self._held = False
            self._yielded = {}
            self._publisher.publish(KeyValue(key=self._key, value=RELEASED))

    @property
    def other(self) -> str:
        """Return the node that holds the lease instead of this one; '' for none."""
        name, received_at = self._other
        return name if name and monotonic() - received_at < LEASE_TIME else ''

    @property
    def yielded(self) -> list[str]:
        """Return the names of the publishers that yield now."""
        since = monotonic() - LEASE_TIME
        return sorted(name for name, time in list(self._yielded.items()) if time > since)

    def close(self) -> None:
        """Leave the topics."""
        self.release()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._node.destroy_publisher(self._publisher)

    def _on_lease(self, message: KeyValue) -> None:
        if message.key != self._key:
            name = printable(_node_of(message.key)) if message.value == HELD else ''
            self._other = name, monotonic()

    def _on_yielded(self, message: KeyValue) -> None:
        is_accepted = message.key in self._yielded or len(self._yielded) < _MAX_PUBLISHERS
        if self._held and message.value == self._key and is_accepted:
            self._yielded[message.key] = monotonic()


def _node_of(key: str) -> str:
    return key.partition('#')[0]
