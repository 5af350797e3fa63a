"""
Cranks that keep their phases: a PI lock of each on its target angle.

With open-loop speed commands the motors drift out of phase, and a walker whose legs lose their
phases falls. Each crank has a target that moves at its commanded rate r, and gets the rate

    u = r (1 + i) + P e,   |P e| <= |r|,   e = target - position,   di/dt = I e / r,

cut so that it never has the opposite sign of r. So i is the relative speed error of the motor,
learned once for all speeds; a phase error is made up at no more than the commanded rate, by a
crank that is ahead by waiting, and at standstill not at all. If a crank lags for all that, all
targets slow down, until they wait for it.

In a curve left and right pass each other: that is how it turns. Straight on all are brought back
to the phases of the gait, so slowly that this turns the body little; cranks of one side always.
"""

from collections.abc import Sequence
from math import atan2, copysign, cos, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN

PROPORTIONAL, INTEGRAL = 4.0, 4.0  # [1/s, 1/s^2]
# Greatest relative speed error of a motor that is learned.
INTEGRAL_LIMIT = 0.4
# All cranks slow down for one that lags by the first, and stop for one by the second [rad].
ERROR_SLOWDOWN, ERROR_STOP = 0.1, 0.3
# At rates below this little is learned of a motor [rad/s].
LEARNING_RATE = 0.2
# Sides whose rates differ by less than this part go straight on.
STRAIGHT = 1e-3
# Time constant of small phase corrections [s].
REPHASE_TIME = 1.0


class CrankCommand(NamedTuple):
    """
    What the cranks are to do.

    Attributes
    ----------
    position : tuple of float
        Where each is to be [rad].
    velocity : tuple of float
        The rate that its motor is to have [rad/s].

    """

    position: tuple[float, ...]
    velocity: tuple[float, ...]


class PhaseLock:
    """
    The lock of a walker's cranks.

    Parameters
    ----------
    senses, sides : sequence of float
        Which way each drives forwards, and on which side: see `Feet`.
    max_rate : float
        Of a crank [rad/s].
    proportional, integral : float
        P [1/s] and I [1/s^2]; at 0 both there is no lock.
    rephase : float
        The part of its rate by which a crank goes faster or slower to get back into phase.

    Attributes
    ----------
    targets : list of float
        The set points of the cranks [rad].
    errors : list of float
        Target - position, at the last step [rad].
    rate_scale : float
        Ratio of the targets' rates to the commanded ones: below 1 while they wait for a crank.

    """

    def __init__(
        self,
        senses: Sequence[float],
        sides: Sequence[float],
        *,
        max_rate: float,
        proportional: float = PROPORTIONAL,
        integral: float = INTEGRAL,
        rephase: float = 0.1,
    ) -> None:
        self._senses, self._sides = list(senses), list(sides)
        self._speed_errors = [0.0] * len(self._senses)
        self.targets: list[float] = []
        self.errors = [0.0] * len(self._senses)
        self.rate_scale = 1.0
        self.tune(max_rate=max_rate, proportional=proportional, integral=integral, rephase=rephase)

    def tune(
        self, *, max_rate: float, proportional: float, integral: float, rephase: float
    ) -> None:
        """Change the limit and the gains; set points and learned speed errors stay."""
        self._max_rate = max_rate
        self._proportional, self._integral = proportional, integral
        self._rephase = rephase

    def reset(self, positions: Sequence[float]) -> None:
        """Restart the set points at measured angles [rad]; learned speed errors stay."""
        self.targets = list(positions)
        self.errors = [0.0] * len(self._senses)

    def phases(self) -> list[float]:
        """Return by how much each target is off the gait's phase, seen from their mean [rad]."""
        return self._off(range(len(self._senses)))

    def step(self, dt: float, rates: Sequence[float], positions: Sequence[float]) -> CrankCommand:
        """
        Move the targets on, and return the command.

        Parameters
        ----------
        dt : float
            The time since the last step [s].
        rates : sequence of float
            The commanded crank rates [rad/s].
        positions : sequence of float
            Where they are [rad].

        """
        if not self.targets:
            self.reset(positions)
        self.rate_scale = self._scale(rates, positions)
        moving = self._rephased([rate * self.rate_scale for rate in rates])
        self.targets = [t + r * dt for t, r in zip(self.targets, moving, strict=True)]
        self.errors = [t - p for t, p in zip(self.targets, positions, strict=True)]
        velocities = [
            self._velocity(k, dt, rate, wanted)
            for k, (rate, wanted) in enumerate(zip(moving, rates, strict=True))
        ]
        return CrankCommand(tuple(self.targets), tuple(velocities))

    def _velocity(self, k: int, dt: float, rate: float, commanded: float) -> float:
        """Return the rate of a crank [rad/s] whose target moves at `rate`."""
        error, limit = self.errors[k], abs(commanded)
        forward = rate * (1.0 + self._speed_errors[k])
        wanted = forward + self._proportional * error
        low, high = (0.0, self._max_rate) if commanded >= 0.0 else (-self._max_rate, 0.0)
        velocity = max(low, min(high, max(forward - limit, min(forward + limit, wanted))))
        # No wind-up: a saturated rate teaches nothing.
        if rate and (velocity == wanted or wanted * error < 0.0):
            learned = self._speed_errors[k]
            learned += self._integral * error * rate / (rate**2 + LEARNING_RATE**2) * dt
            self._speed_errors[k] = max(-INTEGRAL_LIMIT, min(INTEGRAL_LIMIT, learned))
        return velocity

    def _scale(self, rates: Sequence[float], positions: Sequence[float]) -> float:
        """Return 1, or less where a crank lags."""
        if not self._proportional:
            return 1.0
        lags = (
            copysign(1.0, rate) * (target - position)
            for rate, target, position in zip(rates, self.targets, positions, strict=True)
            if rate
        )
        lag = max(lags, default=0.0)
        return min(1.0, max(0.0, (ERROR_STOP - lag) / (ERROR_STOP - ERROR_SLOWDOWN)))

    def _rephased(self, rates: Sequence[float]) -> list[float]:
        """Return the rates with what brings the cranks back into phase."""
        if not self._rephase:
            return list(rates)
        forwards = [sense * rate for sense, rate in zip(self._senses, rates, strict=True)]
        fastest = max(map(abs, forwards))
        every = list(range(len(rates)))
        if max(forwards) - min(forwards) > STRAIGHT * fastest:
            groups = [[k for k in every if self._sides[k] == side] for side in (-1.0, 0.0, 1.0)]
        else:
            groups = [every]
        changed = list(rates)
        for group in groups:
            for k, off in zip(group, self._off(group), strict=True):
                most = self._rephase * abs(rates[k])
                change = max(-most, min(most, off / REPHASE_TIME))
                changed[k] -= self._senses[k] * change
        return changed

    def _off(self, group: Sequence[int]) -> list[float]:
        """Return by how much targets are off their mean phase, within +-pi [rad]."""
        if not self.targets:
            return [0.0] * len(group)
        phases = [self._senses[k] * self.targets[k] for k in group]
        mean = atan2(sum(map(sin, phases)), sum(map(cos, phases))) if len(group) > 1 else 0.0
        if len(group) < 2:
            return [0.0] * len(group)
        return [(phase - mean + pi) % TURN - pi for phase in phases]
