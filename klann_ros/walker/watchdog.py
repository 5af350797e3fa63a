"""Ages of inputs: of the last message, and of messages queued while the process was paused."""

from collections.abc import Callable
from math import inf

# Returns the time of a clock that never stands still [s].
SteadyClock = Callable[[], float]
# Time after a pause during which messages are compared with those before it [s].
DRAIN_TIME = 1.0
# A message that waited for less is current [s].
FRESH_DELAY = 0.05
# The usual age of messages grows by no more than this from one to the next [s].
AGE_STEP = 0.05


class Watchdog:
    """
    The time since the last message of an input.

    Parameters
    ----------
    steady : callable, optional
        Returns the time of a clock that always runs [s]; needed where the control clock may stand
        still, as simulated time does.

    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self._steady = steady
        self.clear()

    def feed(self, now: float, age: float = 0.0) -> None:
        """Take a message of a given age [s] at the control clock's time `now` [s]."""
        self._at = now - age
        self._steady_at = self._steady() - age if self._steady else self._at

    def age(self, now: float) -> float:
        """Return the time since the last message, by the clock that measured more of it [s]."""
        age = now - self._at
        return max(age, self._steady() - self._steady_at) if self._steady else age

    def clear(self) -> None:
        """Forget the last message: the age is infinite."""
        self._at = self._steady_at = -inf

    def rewind(self, now: float) -> None:
        """Follow the control clock back to an earlier time."""
        self._at = min(self._at, now)


class Backlog:
    """
    The delay of messages that waited in a queue while the process was paused.

    Clocks of publishers differ from the receiver's by any offset, so a message's age counts only
    relative to that of the last message before the pause, and for `DRAIN_TIME` after it.
    """

    def __init__(self) -> None:
        self._usual_age = inf
        self._end = -inf

    def pause(self, now: float) -> None:
        """Expect delayed messages: the process was paused until now [s]."""
        self._end = now + DRAIN_TIME

    def delay(self, age: float | None, now: float) -> float:
        """Return the delay of a message of a given age (None: unknown), 0 if it is current [s]."""
        if age is None:
            return 0.0
        # Before the first message clocks are taken to be the same.
        delay = age - (self._usual_age if self._usual_age < inf else 0.0)
        if now < self._end and delay >= FRESH_DELAY:
            return delay
        self._usual_age, self._end = min(age, self._usual_age + AGE_STEP), -inf
        return 0.0
