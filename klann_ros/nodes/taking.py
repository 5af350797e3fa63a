"""Taking messages: all that wait, in order, with what the middleware knows about each."""

from collections.abc import Iterator
from typing import Any

from klann_ros.log.loss import LossCounter
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.subscription import Subscription

Info = dict[str, Any]


def drain(subscription: Subscription, message: Any, info: Info) -> Iterator[tuple[Any, Info]]:
    """
    Yield a message that an executor took, and then all that wait behind it.

    The executor takes one message at each wake-up, and a wake-up costs more than a message: a
    burst is served faster, and in order, when it is taken at once.
    """
    yield message, info
    yield from waiting(subscription)


def waiting(subscription: Subscription) -> Iterator[tuple[Any, Info]]:
    """Take and yield the messages that wait, with what the middleware knows about each."""
    # No more than the queue holds, so that a flood cannot starve timers and services.
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return
        yield taken


def forgetful(loss: LossCounter) -> SubscriptionEventCallbacks:
    """Let a counter begin anew whenever a publisher comes or goes: it may be another one."""
    return SubscriptionEventCallbacks(matched=lambda _: loss.forget())
