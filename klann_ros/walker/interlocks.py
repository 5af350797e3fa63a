"""What permits a walker to move: the managed node's state, enabling, the emergency stop."""

from math import inf

from .faults import Fault, FaultKind, FaultLatch
from .feedback import SteadyClock, Watchdog


class Interlocks:
    """
    The permission to move, which is withdrawn by users and by an emergency stop.

    `is_active` is the state of a managed node, and `is_enabled` that of a servo drive: while it is
    disabled the cranks are commanded to stand. An emergency stop trips the `latch`.

    Parameters
    ----------
    steady : callable, optional
        Returns the time of a clock that always runs [s]; see `WalkController`.

    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self.is_active = True
        self.is_enabled = True
        self.latch = FaultLatch()
        self._is_pressed = False
        # Age of the last message about the emergency stop, infinite before the first.
        self._e_stop_age = Watchdog(steady)

    def enable(self) -> str:
        """Permit motion; return the reason of a refusal, '' if it is permitted."""
        if not self.latch.fault:
            self.is_enabled = True
        return self.latch.reason

    def hear_e_stop(self, *, is_pressed: bool, now: float) -> None:
        """Take the state of the emergency stop."""
        self._is_pressed = is_pressed
        self._e_stop_age.feed(now)

    def pause(self, now: float) -> None:
        """Excuse the silence of the emergency stop up to now: this process was paused."""
        if self._e_stop_age.age(now) < inf:
            self._e_stop_age.feed(now)

    def check(self, now: float, e_stop_timeout: float) -> None:
        """Trip the latch while the emergency stop is pressed, or silent for too long [s]."""
        silence = self._e_stop_age.age(now)
        if self._is_pressed:
            self._trip('e_stop is pressed')
        elif 0.0 < e_stop_timeout < silence < inf:
            self._trip(f'e_stop has been silent for {silence:.1f} s')

    def _trip(self, text: str) -> None:
        self.latch.trip(Fault(FaultKind.E_STOP, '', text))

    @property
    def hold_reason(self) -> str:
        """Return why users make the cranks stand, '' if they do not."""
        if not self.is_active:
            return 'inactive: it commands nothing'
        return '' if self.is_enabled else 'disabled: ~/enable permits motion'
