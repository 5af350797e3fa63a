"""
Limits of a walker's motion, and feedback of the measured motion.

The speed of a walker at given crank rates depends on the floor, and on the phases of its cranks.
So the rates are those of command + K e, e being the integral of commanded minus measured motion.
"""

from dataclasses import dataclass
from math import copysign, inf, pi

from .steering import Rates, Twist2D

# The largest correction, as a part of the command, and that of the yaw rate in curves, whose plan
# may be off by more; and the largest lag, of which K times makes this part of the command.
MAX_SHARE, MAX_CURVE_SHARE, MAX_WINDUP = 0.5, 1.0, 3.0
# K of the yaw rate, as a multiple of that of the speed: in curves, whose yaw comes in bursts, and
# on the spot, where it comes evenly. Chosen in MuJoCo, as those of `phase_map`.
CURVE_GAIN, SPOT_GAIN = 1.0, 2.0
# A measurement over a longer time is not used [s].
MAX_INTERVAL = 0.1


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


class MotionFeedback:
    """
    Correct a commanded motion by the measured one.

    Parameters
    ----------
    gain : float
        K of the speed [1/s]; 0 for no correction.
    speed : float
        Of the walker, by its crank rate [m/rad].

    Attributes
    ----------
    lag : Twist2D
        The integral of commanded minus measured motion [m, rad].

    """

    def __init__(self, gain: float, speed: float) -> None:
        self.gain, self._step = gain, abs(speed) * pi
        self.reset()

    def reset(self) -> None:
        """Forget the lag."""
        self.lag = Twist2D(0.0, 0.0)

    def measure(self, commanded: Twist2D, measured: Twist2D, seconds: float) -> None:
        """Add the motion of a time [s]."""
        if not (self.gain and 0.0 < seconds <= MAX_INTERVAL):
            return
        limits = [MAX_WINDUP / self.gain * abs(each) for each in commanded]
        if _is_on_spot(commanded):
            limits[0] = self._step
        self.lag = Twist2D(
            *(
                max(-limit, min(limit, lag + (wanted - found) * seconds))
                for lag, wanted, found, limit in zip(
                    self.lag, commanded, measured, limits, strict=True
                )
            )
        )

    def corrected(self, commanded: Twist2D) -> Twist2D:
        """Return the motion to drive for; straight on the yaw is not corrected."""
        (linear, angular), lag = commanded, self.lag
        if _is_on_spot(commanded):
            gain = SPOT_GAIN * self.gain
            return Twist2D(self.gain * lag.linear, _corrected(angular, gain * lag.angular))
        gain = CURVE_GAIN * self.gain
        return Twist2D(
            _corrected(linear, self.gain * lag.linear),
            _corrected(angular, gain * lag.angular, MAX_CURVE_SHARE),
        )


def _is_on_spot(commanded: Twist2D) -> bool:
    return commanded.linear == 0.0 and commanded.angular != 0.0


def _corrected(wanted: float, correction: float, most: float = MAX_SHARE) -> float:
    return wanted + copysign(min(abs(correction), most * abs(wanted)), correction)
