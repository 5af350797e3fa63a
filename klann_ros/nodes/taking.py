"""Taking messages: all that wait, in order, with what the middleware knows about each."""

from collections.abc import Iterator
from typing import Any

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


class LossCounter:
    """
    Count lost messages by the gaps in their publication sequence numbers.

    The numbers are each publisher's own, so the count is exact for a topic with one publisher. A
    number that is not above the last is a publisher that has started anew.

    Attributes
    ----------
    lost : int
        Messages lost so far.

    """

    def __init__(self) -> None:
        """Start before the first message."""
        self.lost = 0
        self._last: int | None = None

    def count(self, sequence: int | None, publishers: int = 1) -> None:
        """
        Count what is missing before a message.

        Parameters
        ----------
        sequence : int or None
            Its publication sequence number; None where the middleware has none.
        publishers : int
            How many publishers the topic has: the numbers of several cannot be told apart.

        """
        if sequence is not None and publishers == 1:
            if self._last is not None and sequence > self._last:
                self.lost += sequence - self._last - 1
            self._last = sequence
        else:
            self._last = None
