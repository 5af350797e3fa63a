"""
Cranks that keep their phases: a PI lock of each on the angle that it is to have.

Motors that merely get the same speed drift apart, and a walker whose legs lose their phases falls.
Each crank has a target that moves at its rate r, and gets the rate

    u = r (1 + i) + P e,   e = target - position,   i. = I e / r,

so that i is learnt once as what its motor is too slow by, and holds at any speed. If a crank is
behind for all that, all targets slow down, until they wait for it.

In a curve left and right pass each other: that is how it turns. Straight on all are brought back
to the phases of the gait, so slowly that this turns the body little; cranks of one side always.
"""

from collections.abc import Sequence
from math import atan2, copysign, cos, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN

PROPORTIONAL, INTEGRAL = 4.0, 4.0  # [1/s, 1/s^2]
# What a motor's speed may be off by.
MOST_LEARNT = 0.4
# Where cranks are behind by so much the others begin to wait, and wait altogether [rad].
SLOW_AT, WAIT_AT = 0.1, 0.3
# At rates below this little is learnt of a motor [rad/s].
SLOW = 0.2
# A crank that stands is turned back if it is off by more than this [rad].
IDLE_ERROR = 0.01
# Sides whose rates differ by less than this part go straight on.
STRAIGHT = 1e-3
# How soon small differences of phase are gone [s].
SETTLE = 1.0


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
        Where the cranks are to be [rad].
    errors : list of float
        Target - position, at the last step [rad].
    pace : float
        What part of their rates the targets move at; less than 1 while they wait for a crank.

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
        self._max_rate = max_rate
        self._proportional, self._integral = proportional, integral
        self._rephase = rephase
        self._learnt = [0.0] * len(self._senses)
        self.targets: list[float] = []
        self.errors = [0.0] * len(self._senses)
        self.pace = 1.0

    def reset(self, positions: Sequence[float]) -> None:
        """Let every crank be where it is; what was learnt of the motors stays."""
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
            At which the cranks are to turn [rad/s].
        positions : sequence of float
            Where they are [rad].

        """
        if not self.targets:
            self.reset(positions)
        self.pace = self._pace(rates, positions)
        rates = [rate * self.pace for rate in rates]
        moving = self._rephased(rates)
        self.targets = [t + r * dt for t, r in zip(self.targets, moving, strict=True)]
        self.errors = [t - p for t, p in zip(self.targets, positions, strict=True)]
        velocities = [self._velocity(k, dt, rate) for k, rate in enumerate(moving)]
        return CrankCommand(tuple(self.targets), tuple(velocities))

    def _velocity(self, k: int, dt: float, rate: float) -> float:
        error, most = self.errors[k], self._max_rate
        if rate == 0.0:
            return self._cut(self._proportional * error) if abs(error) > IDLE_ERROR else 0.0
        wanted = rate * (1.0 + self._learnt[k]) + self._proportional * error
        # What is cut off already is not learnt.
        if abs(wanted) < most or wanted * error < 0.0:
            learnt = self._learnt[k] + self._integral * error * rate / (rate**2 + SLOW**2) * dt
            self._learnt[k] = max(-MOST_LEARNT, min(MOST_LEARNT, learnt))
        return self._cut(wanted)

    def _cut(self, velocity: float) -> float:
        return max(-self._max_rate, min(self._max_rate, velocity))

    def _pace(self, rates: Sequence[float], positions: Sequence[float]) -> float:
        """Return 1, or less where a crank is behind."""
        if not self._proportional:
            return 1.0
        behind = (
            copysign(1.0, rate) * (target - position)
            for rate, target, position in zip(rates, self.targets, positions, strict=True)
            if rate
        )
        most = max(behind, default=0.0)
        return min(1.0, max(0.0, (WAIT_AT - most) / (WAIT_AT - SLOW_AT)))

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
                change = max(-most, min(most, off / SETTLE))
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
