"""
Crank rates for a motion of the body, and the motion at crank rates.

Cranks on the left get one rate, those on the right another, and cranks with legs on both sides
their mean. Speed and yaw rate are means over all phases of both, linear in the rates; straight on,
where all cranks keep the phases of the gait, the speed is that of the gait. Where the robot is its
own mirror image, mirrored rates give mirrored motions, to the last digit.
"""

from functools import cached_property
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
import numpy as np

from .feet import Array, CUBIC_SAMPLES, Feet
from .phase_map import phase_map, phase_twists, TurnPlan


class Twist2D(NamedTuple):
    """How a body moves: forwards [m/s], and counter-clockwise seen from above [rad/s]."""

    linear: float
    angular: float


class Rates(NamedTuple):
    """How fast the sides drive, forwards being positive [rad/s]."""

    left: float
    right: float


class Steering:
    """Crank rates and motions of a walker on its `feet`."""

    def __init__(self, feet: Feet) -> None:
        self.feet = feet
        both = list(zip(feet.senses.tolist(), feet.sides.tolist(), strict=True))
        self._shares = [
            (sense * (1.0 + side) / 2.0, sense * (1.0 - side) / 2.0) for sense, side in both
        ]
        # Crank and sense of each crank on one side only.
        self._of_side = [
            [(k, sense) for k, (sense, at) in enumerate(both) if at == side] for side in (1, -1)
        ]

    @cached_property
    def can_turn(self) -> bool:
        """Return whether it has cranks on the left and on the right."""
        sides = self.feet.sides
        return bool((sides > 0.0).any() and (sides < 0.0).any())

    def crank_rates(self, rates: Rates) -> list[float]:
        """Return the rates of its cranks, in the order of `Feet.joints` [rad/s]."""
        left, right = rates
        return [p * left + q * right for p, q in self._shares]

    def phases(self, cranks: list[float]) -> tuple[float, float]:
        """Return the mean phases of the left and the right cranks at crank angles [rad]."""
        left, right = (
            sum(sense * cranks[k] for k, sense in side) / len(side) for side in self._of_side
        )
        return left, right

    @cached_property
    def speed(self) -> float:
        """Return the speed straight on at 1 rad/s, all cranks in phase [m/rad]."""
        phases = np.linspace(0.0, TURN, CUBIC_SAMPLES, endpoint=False)
        both = np.stack([phases, phases], axis=-1)
        (twists,) = phase_twists(self.feet, *self._sides, both, (1.0, 1.0))
        return float(twists[:, 0].mean())

    @property
    def _sides(self) -> tuple[Array, Array]:
        """Return the rotation of each crank when the left, or the right side turns by 1 rad."""
        left, right = np.array(self._shares).T
        return left, right

    @cached_property
    def _maps(self) -> tuple[Array, Array]:
        return phase_map(self.feet, *self._sides)

    @cached_property
    def _gains(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return speed and yaw at 1 rad/s of both sides, and of the right against the left."""
        (v, w), (x, y) = (each.mean(axis=(0, 1)).tolist() for each in self._maps)
        # Cross gains within the error of the map (`MAP_POINTS`) are those of a mirrored walker.
        reach, least = self.feet.reach, 0.005
        if abs(w) * reach < least * abs(v) and abs(x) < least * abs(y) * reach:
            w = x = 0.0
        return (v, w), (x, y)

    @cached_property
    def turn_plan(self) -> TurnPlan:
        """Return the rates for turning, by phase."""
        return TurnPlan(self._maps[0][..., 0], self._maps[1][..., 1])

    def prepare(self) -> None:
        """Compute the rates that later calls reuse."""
        self.rates(Twist2D(self.speed, 1.0))
        self.turn_plan.rates(0.0, 0.0, 0.0, 0.0)

    def motion(self, rates: Rates) -> Twist2D:
        """Return how the body moves at rates of the sides."""
        walking, turning = (rates.left + rates.right) / 2.0, (rates.right - rates.left) / 2.0
        if turning == 0.0 or not self.can_turn:
            return Twist2D(self.speed * walking, 0.0)
        (v, w), (x, y) = self._gains
        return Twist2D(v * walking + x * turning, w * walking + y * turning)

    def rates(self, wanted: Twist2D) -> Rates:
        """Return the rates of the sides for a motion; a walker that cannot turn does not."""
        if abs(wanted.angular) < 1e-9 or not self.can_turn:
            rate = wanted.linear / self.speed
            return Rates(rate, rate)
        (v, w), (x, y) = self._gains
        whole = v * y - x * w
        walking = (wanted.linear * y - wanted.angular * x) / whole
        turning = (wanted.angular * v - wanted.linear * w) / whole
        return Rates(walking - turning, walking + turning)

    def planned_rates(
        self, wanted: Twist2D, cranks: list[float], *, on_spot: bool = False
    ) -> Rates:
        """
        Return the rates of the sides for a motion, at crank angles [rad].

        The motion is their mean over a cycle of phases, see `TurnPlan`.
        With `on_spot` the mean phase stays where turning is the most effective.
        """
        mean = self.rates(wanted)
        if mean.left == mean.right or not self.turn_plan.is_possible:
            return mean
        left, right = self.phases(cranks)
        p, q = self.turn_plan.rates(
            (left + right) / 2.0,
            (right - left) / 2.0,
            (mean.left + mean.right) / 2.0,
            (mean.right - mean.left) / 2.0,
            on_spot=on_spot,
        )
        return Rates(p - q, p + q)
