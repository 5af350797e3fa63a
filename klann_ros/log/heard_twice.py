"""Messages that come more than once, because several subscriptions hear their publisher."""

from collections import deque

# More than what can be between the two times that a message comes.
MEMORY = 16_384


class HeardTwice:
    """Tells a message that came before, by its source's time and number."""

    def __init__(self) -> None:
        self._known: set[tuple[int, int]] = set()
        self._order: deque[tuple[int, int]] = deque()

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
