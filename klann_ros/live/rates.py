"""The rate of a topic's messages, and their loss on the way to the page."""

from collections import deque
from collections.abc import Callable
from time import monotonic

from klann_ros.log import LossCounter

# Averaging time of a rate [s].
WINDOW = 2.0


class TopicRate:
    """The rate and the losses of a topic; `clock` returns the time [s]."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        # The numbers of received messages and of publishers.
        self.count = 0
        self.publishers = 0
        self.loss = LossCounter()
        self._clock = clock
        self._last_time: float | None = None
        # Times of calls of `rate` [s], and the counts of messages until then.
        self._marks: deque[tuple[float, int]] = deque([(clock(), 0)])

    def add(self, sequence: int | None) -> None:
        """Count a message; `sequence` is its publication sequence number."""
        self.count += 1
        self.loss.count(sequence, self.publishers)
        self._last_time = self._clock()

    @property
    def lost(self) -> int | None:
        """Return the number of lost messages so far; None if it is unknown."""
        return self.loss.lost if self.loss.is_known else None

    def rate(self) -> float:
        """Return the rate [Hz], over the last WINDOW of calls."""
        now = self._clock()
        self._marks.append((now, self.count))
        while len(self._marks) > 2 and now - self._marks[1][0] >= WINDOW:
            self._marks.popleft()
        begin, first_count = self._marks[0]
        return (self.count - first_count) / (now - begin) if now > begin else 0.0

    def silence(self) -> float | None:
        """Return the time since the last message [s]; None without any."""
        return None if self._last_time is None else self._clock() - self._last_time
