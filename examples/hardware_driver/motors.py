"""The motors of a driver: the interface, and simulated ones."""

from collections.abc import Sequence
from math import exp
from time import monotonic
from typing import NamedTuple, Protocol

# Time constant of a simulated motor [s]; without a younger rate it stands after its timeout [s].
LAG = 0.05
WATCHDOG_TIMEOUT = 0.5


class MotorReading(NamedTuple):
    """Angles of the shafts [rad], and when they were measured [s], on the clock `monotonic`."""

    time: float
    angles: Sequence[float]


class Motors(Protocol):
    """Motors that stand while no rate is written, whoever has died."""

    def connect(self) -> None:
        """Connect; the motors stand."""

    def write_rates(self, rates: Sequence[float]) -> None:
        """Command the rates of the shafts [rad/s]."""

    def read_angles(self) -> MotorReading | None:
        """Return the last measurement; None if there is no new one."""


class SimulatedMotors:
    """Motors that follow their rates with a lag, in the driver's own process."""

    def __init__(self, count: int) -> None:
        self._targets = [0.0] * count
        self._rates = [0.0] * count
        self._angles = [0.0] * count
        self._time = self._written = monotonic()

    def connect(self) -> None:
        """Begin to turn."""
        self._time = monotonic()

    def write_rates(self, rates: Sequence[float]) -> None:
        """Follow these rates [rad/s]."""
        self._targets, self._written = list(rates), monotonic()

    def read_angles(self) -> MotorReading:
        """Return the angles of this moment."""
        now = monotonic()
        if now - self._written > WATCHDOG_TIMEOUT:
            self._targets = [0.0] * len(self._targets)
        dt, self._time = now - self._time, now
        for index, target in enumerate(self._targets):
            self._rates[index] += (target - self._rates[index]) * (1.0 - exp(-dt / LAG))
            self._angles[index] += self._rates[index] * dt
        return MotorReading(now, tuple(self._angles))
