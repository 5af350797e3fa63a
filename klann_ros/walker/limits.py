"""Limits of a walker's motion: speeds, accelerations, jerks, curvature and crank rates."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import copysign, inf, sqrt
from typing import NamedTuple

from klann_ros.gait import clip, Rates, Twist2D

# With a smaller deceleration a walker would never stop [m/s^2, rad/s^2].
MIN_DECELERATION = 1e-3


class AxisLimits(NamedTuple):
    """Limits of the speed or the yaw rate: both ways, of its rates of change, and of its jerk."""

    forwards: float
    backwards: float
    acceleration: float
    deceleration: float
    jerk: float

    def largest(self, commanded: float) -> float:
        """Return the largest magnitude in the direction of a commanded speed or yaw rate."""
        return self.forwards if commanded >= 0.0 else self.backwards

    def eased_acceleration(self, before: float, missing: float, dt: float) -> float:
        """
        Return the largest acceleration of the next step, by that of the last one.

        From then on it can decrease by jerk times dt a step, to 0 where nothing is missing:
        missing = a^2 / (2 jerk) + a dt / 2.
        """
        if self.jerk == inf:
            return self.acceleration
        half = self.jerk * dt / 2.0
        eased = sqrt(half * half + 2.0 * self.jerk * missing) - half
        return min(self.acceleration, before + self.jerk * dt, eased)


def _limit(default: float, text: str, minimum: float, maximum: float) -> float:
    """Return a field with the description and the range of its parameter of walker_node."""
    metadata = {'text': f'greatest {text}', 'range': (minimum, maximum)}
    limit: float = field(default=default, metadata=metadata)
    return limit


@dataclass(frozen=True)
class MotionLimits:
    """What a walker may do; the parameters of walker_node are declared by these fields."""

    max_linear: float = _limit(0.3, 'speed forwards [m/s]', 0.0, 100.0)
    max_angular: float = _limit(0.3, 'yaw rate to the left [rad/s]', 0.0, 100.0)
    max_linear_backward: float = _limit(
        -1.0, 'speed backwards; negative: as forwards [m/s]', -1.0, 100.0
    )
    max_angular_right: float = _limit(
        -1.0, 'yaw rate to the right; negative: as left', -1.0, 100.0
    )
    max_linear_acceleration: float = _limit(0.3, 'growth of the speed [m/s^2]', 1e-3, 1e3)
    max_angular_acceleration: float = _limit(0.6, 'growth of the yaw rate [rad/s^2]', 1e-3, 1e3)
    # A deceleration begins at once, without a limit of the jerk.
    max_linear_deceleration: float = _limit(0.0, 'decrease; 0: as growth [m/s^2]', 0.0, 1e3)
    max_angular_deceleration: float = _limit(0.0, 'decrease; 0: as growth [rad/s^2]', 0.0, 1e3)
    max_crank_rate: float = _limit(3.0, 'rate of a crank [rad/s]', 1e-3, 1e3)
    # Infinite where it may turn on the spot.
    max_curvature: float = _limit(inf, 'curvature of the path [1/m]', 0.0, 1e3)
    max_linear_jerk: float = _limit(inf, 'change of a growth of the speed [m/s^3]', 0.0, 1e3)
    max_angular_jerk: float = _limit(inf, 'change of a growth of the yaw rate [rad/s^3]', 0.0, 1e3)

    @cached_property
    def axes(self) -> tuple[AxisLimits, AxisLimits]:
        """Return the limits of the speed and of the yaw rate."""
        linear = AxisLimits(
            self.max_linear,
            _chosen(self.max_linear, self.max_linear_backward, 0.0),
            self.max_linear_acceleration,
            _chosen(self.max_linear_acceleration, self.max_linear_deceleration, MIN_DECELERATION),
            self.max_linear_jerk,
        )
        angular = AxisLimits(
            self.max_angular,
            _chosen(self.max_angular, self.max_angular_right, 0.0),
            self.max_angular_acceleration,
            _chosen(
                self.max_angular_acceleration, self.max_angular_deceleration, MIN_DECELERATION
            ),
            self.max_angular_jerk,
        )
        return linear, angular

    def motion(
        self, commanded: Twist2D, rates: Callable[[Twist2D], Rates]
    ) -> tuple[Twist2D, list[str]]:
        """
        Return the motion that is allowed, on the same path, and what limits it.

        `rates` returns those of the sides for a motion.
        """
        linear, angular = commanded
        largest_angular = self.max_curvature * abs(linear)
        hit = []
        if abs(angular) > largest_angular:
            hit.append('max_curvature')
            angular = copysign(largest_angular, angular)
        speed_limits, yaw_limits = self.axes
        fastest = max(map(abs, rates(Twist2D(linear, angular))))
        share = 1.0
        for name, magnitude, largest in (
            ('max_linear', abs(linear), speed_limits.largest(linear)),
            ('max_angular', abs(angular), yaw_limits.largest(angular)),
            ('max_crank_rate', fastest, self.max_crank_rate),
        ):
            if magnitude > largest:
                hit.append(name)
                share = min(share, largest / magnitude)
        return Twist2D(linear * share, angular * share), hit


def _chosen(default: float, limit: float, lowest: float) -> float:
    """Return a limit, or where it is below the lowest one a default."""
    return limit if limit >= lowest else default


class MotionLimiter:
    """
    The way from the present motion to the allowed one, within accelerations and jerks.

    Speed and yaw rate grow in proportion, and decrease in proportion, so the path from and to
    standstill stays the same. What decreases never waits for what grows.
    """

    def __init__(self, limits: MotionLimits) -> None:
        self.limits = limits
        # The last motion, and how fast speed and yaw rate grew [m/s^2, rad/s^2].
        self._motion = Twist2D(0.0, 0.0)
        self._accelerations = (0.0, 0.0)
        self.stop_rates()

    def stop_rates(self) -> None:
        """Take note that the cranks stand."""
        self._rates = Rates(0.0, 0.0)

    def limited_rates(self, rates: Rates, max_change: float) -> Rates:
        """Return possible rates of the sides, changed by at most `max_change` [rad/s]."""
        max_rate = self.limits.max_crank_rate
        share = max_rate / max(max_rate, *map(abs, rates))
        left, right = self._rates
        left += clip(share * rates.left - left, max_change)
        right += clip(share * rates.right - right, max_change)
        self._rates = Rates(left, right)
        return self._rates

    def approach(self, motion: Twist2D, commanded: Twist2D, dt: float) -> Twist2D:
        """Return the motion after a time [s]; one that is not the last begins unaccelerated."""
        if dt <= 0.0:
            return motion
        if motion != self._motion or motion == commanded:
            self._accelerations = (0.0, 0.0)
        if motion == commanded:
            return motion
        linear_limits, angular_limits = self.limits.axes
        linear_growth, angular_growth = self._accelerations
        linear = _AxisChange.plan(
            linear_limits, motion.linear, commanded.linear, linear_growth, dt
        )
        angular = _AxisChange.plan(
            angular_limits, motion.angular, commanded.angular, angular_growth, dt
        )
        if linear.grows == angular.grows:
            share = min(linear.share, angular.share)
            linear = linear._replace(share=share)
            angular = angular._replace(share=share)
        self._motion = Twist2D(linear.after, angular.after)
        self._accelerations = linear.growth(dt), angular.growth(dt)
        return self._motion


class _AxisChange(NamedTuple):
    """The change of a speed or yaw rate in a step: from, to, and the share that is done."""

    before: float
    target: float
    grows: bool
    share: float

    @classmethod
    def plan(
        cls, axis: AxisLimits, now: float, commanded: float, acceleration: float, dt: float
    ) -> '_AxisChange':
        """Plan the next step; on the way to the other direction the first target is 0."""
        target = commanded if now * commanded >= 0.0 else 0.0
        grows = abs(target) > abs(now)
        missing = abs(target - now)
        rate = axis.eased_acceleration(acceleration, missing, dt) if grows else axis.deceleration
        return cls(now, target, grows, rate * dt / missing if missing > rate * dt else 1.0)

    @property
    def after(self) -> float:
        """Return the speed or yaw rate after the share of the change."""
        if self.share == 1.0:
            return self.target
        return self.before + self.share * (self.target - self.before)

    def growth(self, dt: float) -> float:
        """Return how fast it grows [m/s^2, rad/s^2], 0 where it decreases."""
        return abs(self.after - self.before) / dt if self.grows else 0.0
