"""The load of cranks: the effort of each motor, and the overload that stops a walker."""

from math import isfinite, nan

from .faults import Fault, FaultKind

# An effort beyond its limit for this time is an overload; impacts are shorter [s].
OVERLOAD_TIME = 0.5
# Longer steps between readings count as this, as their efforts are unknown [s].
MAX_READING_STEP = 0.1


class LoadMonitor:
    """The effort of the crank of a joint, as its driver gives it [N m]."""

    def __init__(self, joint: str) -> None:
        self._joint = joint
        # The last effort, NaN before the first.
        self.effort = nan
        # Time of the last reading by the control clock, and that of the overload so far [s].
        self._last_time = nan
        self._overload_time = 0.0

    def read(self, effort: float, now: float, max_effort: float) -> Fault | None:
        """Take an effort; return a fault if it has exceeded a limit (0: none) for too long."""
        step = now - self._last_time
        self.effort = effort
        self._last_time = now
        # NaN compares with nothing.
        if not 0.0 < max_effort < abs(effort):
            self._overload_time = 0.0
            return None
        if isfinite(step):
            self._overload_time += min(max(0.0, step), MAX_READING_STEP)
        if self._overload_time < OVERLOAD_TIME:
            return None
        self._overload_time = 0.0
        text = f'{self._joint} has an effort of {effort:+.3g} N m, beyond max_effort'
        return Fault(FaultKind.OVERLOAD, self._joint, f'{text} ({max_effort:g} N m)')
