"""
Crank rates from a wanted motion of the body, and back.

Speed and yaw rate are those over many turns. They are homogeneous in the rates: what counts is
their ratio, so that a fan of ratios is computed once, and what is between two of them is taken as
their sum with positive factors. So the way back is exact.

Cranks on the left get one rate, those on the right another, and cranks with legs on both sides
what is between. In a curve left and right pass each other, so that a ratio's motion is the mean
over all phase differences; straight on they keep the phases of the gait.
"""

from functools import cached_property
from itertools import pairwise
from math import cos, hypot, pi, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
import numpy as np

from .feet import Feet
from .slip import moved, standing
from .support import supports

# Ratios of left to right over half a turn, with both equal among them; for the mean of each, from
# how many phases it starts, turns from there, and steps of a turn.
RATIOS, STARTS, TURNS, STEPS = 8, 6, 2, 48


class Motion(NamedTuple):
    """
    How a body moves.

    Attributes
    ----------
    linear : float
        Forwards [m/s].
    angular : float
        Counter-clockwise, seen from above [rad/s].

    """

    linear: float
    angular: float


class Rates(NamedTuple):
    """
    How fast the sides drive, forwards being positive.

    Attributes
    ----------
    left, right : float
        [rad/s].

    """

    left: float
    right: float


class _Ray(NamedTuple):
    """The motion at one ratio of rates."""

    rates: Rates
    motion: Motion


class Steering:
    """
    What rates of its cranks make of a walker.

    Parameters
    ----------
    feet : Feet
        The walker's.

    Attributes
    ----------
    feet : Feet
        The same.

    """

    def __init__(self, feet: Feet) -> None:
        self.feet = feet

    @cached_property
    def can_turn(self) -> bool:
        """Return whether it has cranks on the left and on the right."""
        sides = self.feet.sides
        return bool((sides > 0.0).any() and (sides < 0.0).any())

    def crank_rates(self, rates: Rates) -> list[float]:
        """Return the rates of its cranks, in the order of `Feet.joints` [rad/s]."""
        left, right = rates
        return [p * left + q * right for p, q in self._shares]

    @cached_property
    def _shares(self) -> list[tuple[float, float]]:
        """Return what each crank has of the left's rate, and of the right's."""
        feet = self.feet
        both = zip(feet.senses.tolist(), feet.sides.tolist(), strict=True)
        return [(sense * (1.0 + side) / 2.0, sense * (1.0 - side) / 2.0) for sense, side in both]

    @property
    def speed(self) -> float:
        """Return the speed straight on at 1 rad/s, all cranks in phase [m/rad]."""
        return self._rays[0].motion.linear

    def motion(self, rates: Rates) -> Motion:
        """Return how the body moves at rates of the sides."""
        for a, b in self._cones:
            shares = _shares(rates, a.rates, b.rates)
            if shares is not None:
                p, q = shares
                linear = p * a.motion.linear + q * b.motion.linear
                return Motion(linear, p * a.motion.angular + q * b.motion.angular)
        return Motion(0.0, 0.0)

    def rates(self, wanted: Motion) -> Rates:
        """Return the rates of the sides for a motion; a walker that cannot turn does not."""
        if not self.can_turn:
            rate = wanted.linear / self.speed
            return Rates(rate, rate)
        for a, b in self._cones:
            shares = _shares(wanted, a.motion, b.motion)
            if shares is not None:
                p, q = shares
                left = p * a.rates.left + q * b.rates.left
                return Rates(left, p * a.rates.right + q * b.rates.right)
        return Rates(0.0, 0.0)

    @cached_property
    def _cones(self) -> list[tuple[_Ray, _Ray]]:
        """Return neighbouring ratios, all around."""
        rays = self._rays
        back = [_Ray(Rates(-r.left, -r.right), Motion(-m.linear, -m.angular)) for r, m in rays]
        return list(pairwise([*rays, *back, rays[0]]))

    @cached_property
    def _rays(self) -> list[_Ray]:
        """Return the motion at ratios over half a turn; the other half is the way back."""
        straight = _Ray(Rates(1.0, 1.0), Motion(self._mean(Rates(1.0, 1.0), 1).linear, 0.0))
        if not self.can_turn:
            # Rates that differ are nothing that its one crank could have.
            return [straight, _Ray(Rates(-1.0, 1.0), Motion(0.0, 0.0))]
        rays = [straight]
        for k in range(1, RATIOS):
            turned = pi / 4.0 + pi * k / RATIOS
            rates = Rates(cos(turned), sin(turned))
            rays.append(_Ray(rates, self._mean(rates, STARTS)))
        return rays

    def _mean(self, rates: Rates, starts: int) -> Motion:
        """Return the mean motion over turns of the cranks that start at phases of the right."""
        feet = self.feet
        way = TURNS * TURN / max(map(abs, rates))
        times = np.linspace(0.0, way, TURNS * STEPS + 1)[:, None]
        right = np.array(self.crank_rates(Rates(0.0, 1.0)))
        turned = times * np.array(self.crank_rates(rates))
        linear = angular = 0.0
        for k in range(starts):
            placed = feet.at(turned + right * (TURN * k / starts))
            last = None
            columns = placed.feet.tolist(), placed.rolled.tolist(), supports(placed)
            for points, rolled, rest in zip(*columns, strict=True):
                pose = standing(points, rolled, rest) if rest else None
                if last and pose:
                    step = moved(last, pose)
                    linear, angular = linear + step.x, angular + step.yaw
                last = pose
        return Motion(linear / (starts * way), angular / (starts * way))


def _shares(
    wanted: tuple[float, float], a: tuple[float, float], b: tuple[float, float]
) -> tuple[float, float] | None:
    """Return p, q >= 0 with wanted = p a + q b; None where there are none."""
    whole = a[0] * b[1] - a[1] * b[0]
    if abs(whole) < 1e-12:
        return None
    p = (wanted[0] * b[1] - wanted[1] * b[0]) / whole
    q = (a[0] * wanted[1] - a[1] * wanted[0]) / whole
    size = hypot(*wanted) + 1e-12
    return (max(p, 0.0), max(q, 0.0)) if min(p, q) >= -1e-9 * size else None
