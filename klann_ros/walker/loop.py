"""The control loop of a walker: its pauses, the progress of its clock, and its events."""

from collections import deque
from math import inf

from .feedback import SteadyClock, Watchdog

# An event is the message of the diagnostics for this time [s].
EVENT_TIME = 3.0
# Advances of the clock in a row that are too long: a pause of the process is one.
SLOW_ADVANCES = 3


class EventLog(deque[str]):
    """Events to be logged, which the logger removes."""

    def __init__(self, steady: SteadyClock | None = None) -> None:
        super().__init__(maxlen=100)
        self._last, self._age = '', Watchdog(steady)

    def add(self, text: str, now: float) -> None:
        """Add an event at a time [s]."""
        self.append(text)
        self._last = text
        self._age.feed(now)

    def recent(self, now: float) -> str:
        """Return the last event, '' if it is too long ago to be the message."""
        return self._last if self._age.age(now) < EVENT_TIME else ''


class ControlLoop:
    """
    Steps of a control loop, and gaps between them, in which messages wait in queues.

    `pauses` counts the gaps. `gap` is the longest one since the set points were last current [s],
    `resumed` the time of its end [s], and `targets_before` the set points before it [rad].
    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self.pauses = 0
        self.gap, self.resumed = 0.0, -inf
        self.targets_before: list[float] = []
        # Time of the last step [s].
        self.time: float | None = None
        # Age of the last callback, and of the clock's last advance; the time between its last two
        # advances [s], and the number of those in a row that were too long.
        self._callback, self._advance = Watchdog(steady), Watchdog(steady)
        self.period, self._slow_advances = 0.0, 0

    def keep_alive(self, now: float) -> float:
        """Take note of a callback; return the time since the last one [s], infinite at first."""
        since = self._callback.age(now)
        # Before its first message a simulated clock is at 0.
        if now:
            self._callback.feed(now)
        return since

    def step(self, now: float, max_gap: float) -> float:
        """Take note of a step; return the time since the last one [s], 0 at first."""
        if now != self.time:
            self.period = self._advance.age(now)
            is_slow = max_gap < self.period < inf
            self._slow_advances = self._slow_advances + 1 if is_slow else 0
            self._advance.feed(now)
        since = now - self.time if self.time else 0.0
        self.time = now
        return since

    def pause(self, gap: float, now: float, targets: list[float]) -> None:
        """Take note of a gap [s] that ends now, and of the set points before it."""
        if not self.gap:
            self.targets_before = targets
            self.pauses += 1
        self.gap, self.resumed = max(self.gap, gap), now

    def reset_clock(self) -> None:
        """Forget the times of the clock, which went back."""
        self.time, self.resumed = None, -inf

    def standing_time(self, now: float) -> float:
        """Return how long the clock has stood still [s]."""
        return self._advance.age(now) if now == self.time else 0.0

    def clock_warning(self, max_gap: float) -> str:
        """Return that the clock advances too rarely to walk, '' if it does not."""
        if self._slow_advances < SLOW_ADVANCES:
            return ''
        text = f'/clock advances every {self.period:.2f} s only: too rarely to walk'
        return f'{text}, it needs {1.0 / max_gap:.0f} Hz'
