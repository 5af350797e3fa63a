"""When a recording pauses, and what it leaves out meanwhile."""

from collections import Counter

from klann_ros.log.run_parameters import Pause


class Pauses:
    """
    Tells the messages that a pause leaves out, by when they were received.

    They are taken later than they were received, so a pause that is over still counts. Times are
    in [ns since the epoch].

    Attributes
    ----------
    paused : bool
        Whether nothing is recorded now.
    left_out : Counter
        How many messages of each topic were left out so far, in all pauses.

    """

    def __init__(self) -> None:
        self.paused = False
        self.left_out: Counter[str] = Counter()
        self._begin = self._end = 0
        self._before: Counter[str] = Counter()

    def begin(self, now: int) -> None:
        """Begin a pause."""
        self.paused = True
        self._begin = now
        self._before = self.left_out.copy()

    def end(self, now: int) -> None:
        """End it."""
        self.paused = False
        self._end = now

    def leaves_out(self, topic: str, received: int) -> bool:
        """Return whether a message belongs to the last pause, and count it if so."""
        if received < self._begin or not (self.paused or received < self._end):
            return False
        self.left_out[topic] += 1
        return True

    def last(self) -> Pause:
        """Return the last pause, when all that was received in it was taken."""
        left_out = self.left_out - self._before
        return Pause(self._begin, self._end, dict(left_out))
