"""The real-time factor of a simulation, and the time that is given up if it falls behind."""

from typing import NamedTuple

# A larger delay is given up: time continues from there, without a burst [s].
MAX_CATCH_UP = 0.2


class Pace:
    """
    The ticks of a simulation in real time.

    Parameters
    ----------
    period : float
        Of simulated time between ticks [s].
    factor : float
        Simulated time over wall time.
    now : float
        Wall time at the start [s].

    Attributes
    ----------
    slipped : float
        Wall time given up so far [s].

    """

    def __init__(self, period: float, factor: float, now: float) -> None:
        self._period, self._between = period, period / factor
        self._begin, self._ticks = now, 0
        self.slipped = 0.0
        self._since, self._done = now, 0

    def due(self, now: float) -> int:
        """Return the number of ticks due at a wall time [s]; they count as done."""
        late = now - self._begin - (self._ticks + 1) * self._between
        if late > MAX_CATCH_UP:
            # One tick is due now, the others are dropped.
            self._begin += late
            self.slipped += late
        count = max(0, int((now - self._begin) / self._between + 1e-6) - self._ticks)
        self._ticks += count
        self._done += count
        return count

    def factor(self, now: float) -> 'RealTimeFactor':
        """Return the real-time factor since the last call."""
        elapsed = max(now - self._since, 1e-9)
        wanted = elapsed / self._between
        factor = RealTimeFactor(self._done * self._period / elapsed, self._done / wanted)
        self._since, self._done = now, 0
        return factor


class RealTimeFactor(NamedTuple):
    """
    The achieved real-time factor.

    Attributes
    ----------
    factor : float
        Simulated time over wall time.
    share : float
        Share of the requested steps that were done.

    """

    factor: float
    share: float
