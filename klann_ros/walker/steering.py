"""
Crank rates from a wanted motion of the body, and back.

Speed and yaw rate are those over many turns. They are homogeneous in the rates: what counts is
their ratio, so that a fan of ratios is computed once, and a motion between two of them is taken as
their sum with positive factors. So the way back is exact.

Cranks on the left get one rate, those on the right another, and cranks with legs on both sides
the motion between. In a curve left and right pass each other, so that a ratio's motion is the mean
over all phases of both; straight on they keep the phases of the gait. Where the robot is its own
mirror image, ratios that mirror each other have motions that do, to the last digit.
"""

from functools import cached_property
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np

from .feet import Array, Feet
from .mean_motion import are_mirrored, lattice, PhasePoses

# Rates of left and right over half a turn of ratios; the other half is the way back. Those after
# the middle one mirror those before it.
RATIOS = ((1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1), (-1, 0), (-2, -1))
# Slower turns are none [rad/s].
MIN_YAW_RATE = 1e-9
# Phases of the gait, straight on.
STRAIGHT_POINTS = 720
# How far feet may be from each other's mirror image, as a part of the robot's size.
MIRRORED = 1e-5


class Twist2D(NamedTuple):
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
    motion: Twist2D


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

    @cached_property
    def speed(self) -> float:
        """Return the speed straight on at 1 rad/s, all cranks in phase [m/rad]."""
        phases = np.repeat(lattice(1, STRAIGHT_POINTS)[:, :1], 2, axis=1)
        return PhasePoses(self.feet, *self._sides, phases).mean(1.0, 1.0)[0]

    @property
    def _sides(self) -> tuple[Array, Array]:
        """Return what each crank turns when the left, or the right, turns by 1 rad."""
        left, right = np.array(self._shares).T
        return left, right

    @cached_property
    def is_mirrored(self) -> bool:
        """Return whether its right side is its left one in a mirror, but for the phase."""
        feet = self.feet
        of_leg = feet.sides[feet.crank_of]
        left, right = self._sides
        sides = [(left, of_leg > 0.0), (right, of_leg < 0.0)]
        return are_mirrored(feet, sides, MIRRORED * feet.reach)

    def motion(self, rates: Rates) -> Twist2D:
        """Return how the body moves at rates of the sides."""
        if rates.left == rates.right or not self.can_turn:
            return Twist2D(self.speed * (rates.left + rates.right) / 2.0, 0.0)
        for a, b in self._cones:
            shares = _shares(rates, a.rates, b.rates)
            if shares is not None:
                p, q = shares
                linear = p * a.motion.linear + q * b.motion.linear
                return Twist2D(linear, p * a.motion.angular + q * b.motion.angular)
        return Twist2D(0.0, 0.0)

    def rates(self, wanted: Twist2D) -> Rates:
        """Return the rates of the sides for a motion; a walker that cannot turn does not."""
        if abs(wanted.angular) < MIN_YAW_RATE or not self.can_turn:
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
        back = [_Ray(Rates(-r.left, -r.right), Twist2D(-m.linear, -m.angular)) for r, m in rays]
        return list(pairwise([*rays, *back, rays[0]]))

    @cached_property
    def _rays(self) -> list[_Ray]:
        """Return the motion at ratios over half a turn; the other half is the way back."""
        # A crank with legs on both sides turns once while the sides turn twice.
        turns = 1 if self.feet.sides.all() else 2
        poses = PhasePoses(self.feet, *self._sides, lattice(turns))
        middle = len(RATIOS) // 2
        rays: list[_Ray] = []
        for k, (left, right) in enumerate(RATIOS):
            if self.is_mirrored and k > middle:
                linear, angular = rays[2 * middle - k].motion
                motion = Twist2D(-linear, angular)
            else:
                motion = Twist2D(*poses.mean(left, right))
                if self.is_mirrored and k == 0:
                    motion = motion._replace(angular=0.0)
                if self.is_mirrored and k == middle:
                    motion = motion._replace(linear=0.0)
            rays.append(_Ray(Rates(left, right), motion))
        return rays


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
