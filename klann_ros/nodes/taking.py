"""Taking messages without an executor, with what the middleware knows about each."""

from collections.abc import Iterator
from typing import Any

from rclpy.subscription import Subscription

Info = dict[str, Any]


def waiting(subscription: Subscription) -> Iterator[tuple[Any, Info]]:
    """Take and yield the messages that wait, with what the middleware knows about each."""
    # No more than the queue holds, so that a flood cannot starve timers and services.
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return
        yield taken
