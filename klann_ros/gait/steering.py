"""
Crank rates for a motion of the body, and the motion at crank rates.

Cranks on the left get one rate, those on the right another, and cranks with legs on both sides
their mean. Speed and yaw rate are means over all phases of both, linear in the rates; straight on,
where all cranks keep the phases of the gait, the speed is that of the gait. Where the robot is its
own mirror image, mirrored rates give mirrored motions, to the last digit.
"""

from operator import mul
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
import numpy as np

from .feet import CUBIC_SAMPLES, Feet
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
    """
    Crank rates and motions of a walker on its `feet`.

    `speed` is that straight on at 1 rad/s, with all cranks in phase [m/rad]. It `can_turn` if it
    has cranks on the left and on the right; `turn_plan` holds the rates for turning, by phase.
    """

    def __init__(self, feet: Feet) -> None:
        self.feet = feet
        # The rotation of each crank when the left, or the right side turns by 1 rad.
        left_shares = (1.0 + feet.sides) / 2.0 * feet.senses
        right_shares = (1.0 - feet.sides) / 2.0 * feet.senses
        side_shares = np.array([left_shares, right_shares])
        self._shares: list[tuple[float, float]] = side_shares.T.tolist()
        in_phase = np.linspace(0.0, TURN, CUBIC_SAMPLES, endpoint=False)[:, None] * (1.0, 1.0)
        (twists,) = phase_twists(feet, side_shares, in_phase, (1.0, 1.0))
        self.speed = float(twists[:, 0].mean())
        is_left = feet.sides == 1.0
        is_right = feet.sides == -1.0
        self.can_turn = bool(is_left.any() and is_right.any())
        if not self.can_turn:
            return
        # The share of each crank in the mean phase of the left, and of the right side.
        self._left_weights = (is_left * feet.senses / is_left.sum()).tolist()
        self._right_weights = (is_right * feet.senses / is_right.sum()).tolist()
        walking, turning = phase_map(feet, side_shares)
        self.turn_plan = TurnPlan(walking[..., 0], turning[..., 1], walking[..., 1])
        # Speed and yaw rate at 1 rad/s of both sides, and of the right against the left.
        walking_speed, walking_yaw = walking.mean(axis=(0, 1)).tolist()
        turning_speed, turning_yaw = turning.mean(axis=(0, 1)).tolist()
        # Cross gains within the error of the map (`MAP_POINTS`) are those of a mirrored walker.
        is_straight = abs(walking_yaw) * feet.reach < 0.005 * abs(walking_speed)
        if is_straight and abs(turning_speed) < 0.005 * abs(turning_yaw) * feet.reach:
            walking_yaw = turning_speed = 0.0
        self._gains = walking_speed, walking_yaw, turning_speed, turning_yaw

    def crank_rates(self, rates: Rates) -> list[float]:
        """Return the rates of its cranks, in the order of `Feet.joints` [rad/s]."""
        return [left * rates.left + right * rates.right for left, right in self._shares]

    def motion(self, rates: Rates) -> Twist2D:
        """Return how the body moves at rates of the sides."""
        walking = (rates.left + rates.right) / 2.0
        turning = (rates.right - rates.left) / 2.0
        if turning == 0.0 or not self.can_turn:
            return Twist2D(self.speed * walking, 0.0)
        v, w, x, y = self._gains
        return Twist2D(v * walking + x * turning, w * walking + y * turning)

    @property
    def unit_motion(self) -> Twist2D:
        """Return the speed at 1 rad/s straight on, and the yaw rate at 1 rad/s on the spot."""
        return Twist2D(self.speed, self.motion(Rates(-1.0, 1.0)).angular)

    def rates(self, twist: Twist2D) -> Rates:
        """Return the rates of the sides for a motion; a walker that cannot turn does not."""
        walking, turning = self._mean_rates(twist)
        return Rates(walking - turning, walking + turning)

    def _mean_rates(self, twist: Twist2D) -> tuple[float, float]:
        """Return the mean rate of the sides, and half of their difference [rad/s]."""
        linear, angular = twist
        if abs(angular) < 1e-9 or not self.can_turn:
            return linear / self.speed, 0.0
        v, w, x, y = self._gains
        determinant = v * y - x * w
        walking = (linear * y - angular * x) / determinant
        turning = (angular * v - linear * w) / determinant
        return walking, turning

    def planned_rates(
        self, twist: Twist2D, cranks: list[float], *, on_spot: bool = False
    ) -> Rates:
        """
        Return the rates of the sides for a motion, at crank angles [rad].

        The motion is their mean over a cycle of phases, see `TurnPlan`.
        With `on_spot` the mean phase stays where turning is the most effective.
        """
        walking, turning = self._mean_rates(twist)
        if turning and self.turn_plan.is_possible:
            left = sum(map(mul, self._left_weights, cranks))
            right = sum(map(mul, self._right_weights, cranks))
            walking, turning = self.turn_plan.rates(
                (left + right) / 2.0, (right - left) / 2.0, walking, turning, on_spot=on_spot
            )
        return Rates(walking - turning, walking + turning)
