"""Where playback is in a log, as a function of a monotonic time, and how late messages were."""

from dataclasses import dataclass, replace
from math import inf

RATES = (1e-6, 1e6)
"""The least and the greatest rate."""

LATE = 0.01
"""A message later than this counts as late [s]."""


@dataclass(frozen=True)
class Timeline:
    """
    A position in a log that runs, or stands still.

    Every change is a new timeline, so that no error can add up: while nothing changes, a message
    of position p is due at ``since + (p - position) / rate``, also after hours.

    Raises
    ------
    ValueError
        The rate is not within ``RATES``.

    """

    # Where it is at ``since``, counted from the start of the log [s].
    position: float = 0.0
    # How fast it runs: 2 is twice as fast as it was recorded.
    rate: float = 1.0
    # The time from which it runs [s]; None while it stands still.
    since: float | None = None
    # What was told already [s]: a position never runs backwards, it waits there.
    floor: float = -inf

    def __post_init__(self) -> None:
        least, most = RATES
        if not least <= self.rate <= most:
            raise ValueError(
                f'rate = {self.rate} is refused: it must be within {least:g} .. {most:g}'
            )

    def at(self, now: float) -> float:
        """Return the position at a time [s]."""
        return max(self.floor, self._exact(now))

    def due(self, position: float) -> float:
        """Return when a position is due [s]; infinite while the timeline stands still."""
        if self.since is None:
            return inf
        return self.since + (position - self.position) / self.rate

    def started(self, now: float) -> 'Timeline':
        """Return it running from where it is."""
        return replace(self, position=self._exact(now), since=now)

    def stopped(self, now: float) -> 'Timeline':
        """Return it standing where it is."""
        return replace(self, position=self._exact(now), since=None)

    def at_rate(self, rate: float, now: float) -> 'Timeline':
        """Return it with another rate from here on."""
        since = None if self.since is None else now
        return replace(self, position=self._exact(now), rate=rate, since=since)

    def moved(self, position: float, now: float) -> 'Timeline':
        """Return it at another position, which may lie behind; it runs if it did."""
        since = None if self.since is None else now
        return replace(self, position=position, since=since, floor=-inf)

    def held_up(self, position: float, now: float) -> 'Timeline':
        """Return it as if it had come no further than a position, without running backwards."""
        return replace(self.moved(position, now), floor=self.at(now))

    def _exact(self, now: float) -> float:
        if self.since is None:
            return self.position
        return self.position + max(0.0, now - self.since) * self.rate


@dataclass
class Lateness:
    """What was late so far."""

    # How many messages were due, and how many of them came later than ``LATE``.
    played: int = 0
    late: int = 0
    # The latest of them [s].
    worst: float = 0.0
    # By how much the rest of the log was put off in all, instead of a burst [s].
    held_up: float = 0.0

    def note(self, late: float) -> None:
        """Count a message that comes so late [s]."""
        self.played += 1
        if late > LATE:
            self.late += 1
            self.worst = max(self.worst, late)

    def __str__(self) -> str:
        """Return it in one line; '' if nothing was late."""
        said = []
        if self.late:
            said.append(
                f'{self.late} of {self.played} messages came more than {LATE * 1e3:g} ms late, '
                f'{self.worst * 1e3:.0f} ms at worst'
            )
        if self.held_up:
            said.append(f'playback was held up for {self.held_up:.2f} s, and went on from there')
        return '; '.join(said)
