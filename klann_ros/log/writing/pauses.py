"""When a recording pauses, and what it leaves out meanwhile."""

from collections import Counter

from klann_ros.log.run_parameters import Pause

from .ledger import Account, Ledger


class Pauses:
    """
    Tells the messages that a pause leaves out, by when they were received.

    They are taken later than they were received, so a pause that is over still counts. Times are
    in [ns since the epoch].

    Parameters
    ----------
    ledger : Ledger
        Where what is left out is counted.

    Attributes
    ----------
    paused : bool
        Whether nothing is recorded now.

    """

    def __init__(self, ledger: Ledger) -> None:
        self.paused = False
        self._ledger = ledger
        self._begin = self._end = 0
        self._before: Counter[str] = Counter()

    def begin(self, now: int) -> None:
        """Begin a pause."""
        self.paused = True
        self._begin = now
        self._before = self._ledger.left_out()

    def end(self, now: int) -> None:
        """End it."""
        self.paused = False
        self._end = now

    def leaves_out(self, account: Account, received: int) -> bool:
        """Return whether a message belongs to the last pause, and count it if so."""
        if received < self._begin or not (self.paused or received < self._end):
            return False
        account.left_out += 1
        return True

    def last(self) -> Pause:
        """
        Return the last pause, when all that was received in it was taken.

        Nothing more belongs to it then, not even when the clock is set back into it.
        """
        left_out = self._ledger.left_out() - self._before
        pause = Pause(self._begin, self._end, dict(left_out))
        self._begin = self._end = 0
        return pause
