"""Messages that come more than once, because several subscriptions hear their publisher."""

from collections import deque
from collections.abc import Iterable

# More than what can be between the two times that a message comes.
MEMORY = 16_384


class HeardTwice:
    """
    Tells a message that came before, by its source's time and number.

    Parameters
    ----------
    before
        The last ones that came so far.

    """

    def __init__(self, before: Iterable[tuple[int, int]]) -> None:
        self._order = deque(before)
        self._known = set(self._order)

    def is_repeat(self, source_time: int, sequence: int) -> bool:
        """Return whether a message came before, and remember it."""
        identity = (source_time, sequence)
        if identity in self._known:
            return True
        self._known.add(identity)
        self._order.append(identity)
        if len(self._order) > MEMORY:
            self._known.discard(self._order.popleft())
        return False
