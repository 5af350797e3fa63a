"""The limits of a walker's motion; active limits are reported."""

from dataclasses import dataclass
from math import inf

from .steering import Rates, Twist2D


@dataclass(frozen=True)
class MotionLimits:
    """
    What a walker may do.

    Attributes
    ----------
    max_linear, max_angular : float
        Of its speed [m/s] and yaw rate [rad/s].
    max_linear_acceleration, max_angular_acceleration : float
        Of their changes [m/s^2, rad/s^2].
    max_curvature : float
        Of its path [1/m]; infinite where it may turn on the spot.
    max_crank_rate : float
        Of each crank [rad/s].

    """

    max_linear: float = 0.3
    max_angular: float = 0.3
    max_linear_acceleration: float = 0.3
    max_angular_acceleration: float = 0.6
    max_curvature: float = inf
    max_crank_rate: float = 3.0

    def motion(self, wanted: Twist2D) -> tuple[Twist2D, list[str]]:
        """Return the motion that is allowed, on the same path, and what limits it."""
        hit = []
        linear, angular = wanted
        if abs(angular) > self.max_curvature * abs(linear):
            hit.append('max_curvature')
            most = self.max_curvature * abs(linear)
            angular = max(-most, min(most, angular))
        share = 1.0
        for name, value, most in (
            ('max_linear', linear, self.max_linear),
            ('max_angular', angular, self.max_angular),
        ):
            if abs(value) > most:
                hit.append(name)
                share = min(share, most / abs(value))
        return Twist2D(linear * share, angular * share), hit

    def rates(self, wanted: Rates) -> tuple[float, list[str]]:
        """Return which part of these rates the cranks can have, and what limits them."""
        fastest = max(map(abs, wanted))
        if fastest <= self.max_crank_rate:
            return 1.0, []
        return self.max_crank_rate / fastest, ['max_crank_rate']

    def approach(self, now: Twist2D, wanted: Twist2D, dt: float) -> Twist2D:
        """Return the motion after a time; both parts approach the command in proportion."""
        linear, angular = wanted.linear - now.linear, wanted.angular - now.angular
        share = min(
            1.0,
            self.max_linear_acceleration * dt / abs(linear) if linear else 1.0,
            self.max_angular_acceleration * dt / abs(angular) if angular else 1.0,
        )
        return Twist2D(now.linear + share * linear, now.angular + share * angular)
