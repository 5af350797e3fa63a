"""Transport of a playback: its timeline, its delays, and its controls."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from threading import Condition
from time import monotonic

from .errors import LogError

# Minimum duration of a loop [s].
_MIN_LOOP_DURATION = 0.1
# A larger delay shifts the rest of the log: a stopped or overloaded process continues
# without a burst [s].
_MAX_CATCH_UP = 0.5
# Messages due within this time are published now: a wait costs more than publishing [s].
_MIN_WAIT = 1e-4
# Timeout for reading the message of a step [s].
_STEP_TIMEOUT = 5.0
# Maximum wait, as tiny rates mean thousands of years [s].
_MAX_WAIT = 3600.0


RATES = (1e-6, 1e6)
"""Minimum and maximum rate."""

LATE_THRESHOLD = 0.01
"""A message later than this counts as late [s]."""


@dataclass(frozen=True)
class Timeline:
    """
    Position in a log as a function of monotonic time, running or stopped.

    Every change is a new timeline, so that no error accumulates: until then a message at position
    p is due at ``since + (p - position) / rate``. A ValueError refuses a rate outside of `RATES`.
    """

    # Position at ``since``, from the start of the log [s].
    position: float = 0.0
    # Playback speed: 2 is twice as fast as recorded.
    rate: float = 1.0
    # Start of the motion [s]; None while stopped.
    since: float | None = None
    # Positions already reported [s]: it never runs backwards.
    floor: float = -inf

    def __post_init__(self) -> None:
        min_rate, max_rate = RATES
        if not min_rate <= self.rate <= max_rate:
            raise ValueError(
                f'rate = {self.rate} is refused: it must be within {min_rate:g} .. {max_rate:g}'
            )

    def at(self, now: float) -> float:
        """Return the position at a time [s]."""
        return max(self.floor, self._exact(now))

    def due(self, position: float) -> float:
        """Return the due time of a position [s]; infinite while stopped."""
        if self.since is None:
            return inf
        return self.since + (position - self.position) / self.rate

    def started(self, now: float) -> 'Timeline':
        """Return the timeline running from its position."""
        return replace(self, position=self._exact(now), since=now)

    def stopped(self, now: float) -> 'Timeline':
        """Return the timeline stopped at its position."""
        return replace(self, position=self._exact(now), since=None)

    def at_rate(self, rate: float, now: float) -> 'Timeline':
        """Return the timeline with another rate from now on."""
        since = None if self.since is None else now
        return replace(self, position=self._exact(now), rate=rate, since=since)

    def moved(self, position: float, now: float) -> 'Timeline':
        """Return the timeline at another position, also backwards, running if it did."""
        since = None if self.since is None else now
        return replace(self, position=position, since=since, floor=-inf)

    def delayed(self, position: float, now: float) -> 'Timeline':
        """Return the timeline delayed to a position, without running backwards."""
        return replace(self.moved(position, now), floor=self.at(now))

    def _exact(self, now: float) -> float:
        if self.since is None:
            return self.position
        return self.position + max(0.0, now - self.since) * self.rate


@dataclass
class Lateness:
    """Late messages so far."""

    # All messages, and those later than ``LATE_THRESHOLD``.
    played: int = 0
    late: int = 0
    # Maximum delay [s].
    worst: float = 0.0
    # Total delay of the rest of the log, instead of a burst [s].
    delay: float = 0.0

    def add(self, late: float) -> None:
        """Count a message and its delay [s]."""
        self.played += 1
        if late > LATE_THRESHOLD:
            self.late += 1
            self.worst = max(self.worst, late)

    def __str__(self) -> str:
        """Return the delays in one line; '' if nothing was late."""
        clauses = []
        if self.late:
            clauses.append(
                f'{self.late} of {self.played} messages came more than '
                f'{LATE_THRESHOLD * 1e3:g} ms late, {self.worst * 1e3:.0f} ms at worst'
            )
        if self.delay:
            clauses.append(f'playback stalled for {self.delay:.2f} s, and continued from there')
        return '; '.join(clauses)


class PlaybackError(LogError):
    """A control that is not possible now."""


class Transport:
    """
    Waits for one position after the other in one thread, while others control it.

    Positions are counted from the start of the log [s], up to its length. `lateness` counts the
    late messages since the last start or jump.
    """

    def __init__(
        self, begin: float, length: float, *, rate: float = 1.0, paused: bool = False
    ) -> None:
        self.length = length
        self.lateness = Lateness()
        self._changed = Condition()
        self._timeline = Timeline(begin, rate)
        self._interrupt: Callable[[], None] = lambda: None
        # Start of the next pass; None to continue.
        self._target: float | None = begin
        # The awaited position, and whether nothing follows it.
        self._next_position = begin
        self._at_end = False
        self._loaded = False
        self._paused = paused
        self._stepping = False
        self._stopped = False

    def take_target(self) -> float | None:
        """Return the start of the next pass; None without any."""
        with self._changed:
            target = self._target
            self._target = None
            if self._stopped or target is None:
                return None
            self.lateness = Lateness()
            self._move(target)
            return target

    def on_interrupt(self, interrupt: Callable[[], None]) -> None:
        """Set a function that a jump or the end calls, at once if there was one."""
        with self._changed:
            self._interrupt = interrupt
            if self._interrupted:
                self._interrupt()

    def reach(self, position: float) -> bool:
        """Wait for a message's time; return whether to play it."""
        with self._changed:
            self._load(position)
            while not self._interrupted:
                if self._stepping:
                    self._stepping = False
                    self._timeline = self._timeline.moved(position, monotonic())
                    self._changed.notify_all()
                    return True
                late = self._settled() - self._timeline.due(position)
                if late >= -_MIN_WAIT:
                    self.lateness.add(late)
                    return True
                self._changed.wait(min(-late, _MAX_WAIT))
            return False

    def reach_end(self, begin: float, end: float, loop_to: float | None, *, empty: bool) -> None:
        """
        Wait at the end of a pass, and continue from ``loop_to`` [s] unless that is None.

        An empty pass has no message that a step could find.
        """
        with self._changed:
            if self._interrupted:
                return
            if loop_to is not None:
                end = max(end, begin + _MIN_LOOP_DURATION * self._timeline.rate)
            self._load(end)
            self._at_end = empty or loop_to is None
            self._changed.notify_all()
            while not self._interrupted:
                time_left = self._timeline.due(end) - self._settled()
                if time_left <= 0.0 or (self._stepping and not self._at_end):
                    self._target = loop_to
                    return
                self._changed.wait(min(time_left, _MAX_WAIT))

    def _load(self, position: float) -> None:
        """Start the time, as the first message is in memory."""
        self._next_position = position
        if not self._loaded:
            self._loaded = True
            if not self._paused:
                self._timeline = self._timeline.started(monotonic())

    @property
    def position(self) -> float:
        """Return the position [s]."""
        with self._changed:
            return max(0.0, min(self._timeline.at(self._settled()), self.length))

    @property
    def paused(self) -> bool:
        """Return whether it is paused."""
        return self._paused

    def pause(self) -> None:
        """Pause."""
        with self._changed:
            self._paused = True
            self._timeline = self._timeline.stopped(self._settled())
            self._changed.notify_all()

    def resume(self) -> None:
        """Resume."""
        with self._changed:
            self._paused = False
            if self._loaded:
                self._timeline = self._timeline.started(self._settled())
            self._changed.notify_all()

    def step(self) -> None:
        """Play exactly the next message; a PlaybackError if it is not paused, or there is none."""
        with self._changed:
            if not self._paused:
                raise PlaybackError('it is playing; pause it first')
            self._stepping = True
            self._changed.notify_all()
            self._changed.wait_for(
                lambda: not self._stepping or self._at_end or self._stopped, _STEP_TIMEOUT
            )
            if self._stepping:
                self._stepping = False
                reason = 'no message is left' if self._at_end else 'it is still being read'
                raise PlaybackError(reason)

    def seek(self, position: float) -> None:
        """Continue from a position [s], paused or not; a PlaybackError if it is outside."""
        if not 0.0 <= position <= self.length:
            raise PlaybackError(f'position = {position} is not within 0 .. {self.length:g} s')
        with self._changed:
            self._target = position
            self._move(position)
            self._interrupt()
            self._changed.notify_all()

    def set_rate(self, rate: float) -> None:
        """Continue at another rate; a ValueError if it is not within RATES."""
        with self._changed:
            self._timeline = self._timeline.at_rate(rate, self._settled())
            self._changed.notify_all()

    def stop(self) -> None:
        """End it."""
        with self._changed:
            self._stopped = True
            self._interrupt()
            self._changed.notify_all()

    @property
    def _interrupted(self) -> bool:
        return self._stopped or self._target is not None

    def _move(self, position: float) -> None:
        """Wait at a position until its first message is in memory."""
        now = monotonic()
        self._timeline = self._timeline.moved(position, now).stopped(now)
        self._next_position = position
        self._loaded = self._at_end = False

    def _settled(self) -> float:
        """Return the time, after a delay beyond `_MAX_CATCH_UP` has shifted the timeline."""
        now = monotonic()
        late = now - self._timeline.due(self._next_position)
        if late > _MAX_CATCH_UP:
            self.lateness.delay += late
            self._timeline = self._timeline.delayed(self._next_position, now)
        return now
