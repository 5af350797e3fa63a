"""Angles: modulo a turn, in other units, and the yaw of an orientation."""

from math import atan2, ceil, degrees, nan, pi, radians, remainder
from typing import Any, SupportsFloat

from klann_ros.sanitize.units import warn_of_degrees
import numpy as np

from .arrays import FloatArray
from .errors import CrankAngleError

# Start and end of an arc of crank angles [rad].
Arc = tuple[float, float]
TURN = 2.0 * pi
# A degree [rad]: `leg.solve(60 * deg)`, `pose.gamma / deg`.
deg = radians(1.0)
# A radian in degrees, and a rad/s in rpm.
DEGREES = degrees(1.0)
RPM = 60.0 / TURN
# The tangent of a nearly singular pose may lead many turns away, where angles lose digits.
MAX_UNWRAPPED = 2.0 * TURN
# Beyond this the last digit of a crank angle is worth more than 1e-10 rad.
MAX_CRANK_ANGLE = 1e6


def wrap(angle: float) -> float:
    """Return a finite angle in (-pi, pi] [rad]."""
    if -pi < angle <= pi:
        return angle
    wrapped = remainder(angle, TURN)
    return pi if wrapped == -pi else wrapped


def unwrapped(angles: FloatArray) -> FloatArray:
    """Return an encoder's angles, counted on over turns if all are within about one [rad]."""
    start = angles.min(initial=np.inf)
    is_wrapped = np.isfinite(start) and angles.max() <= start + 1.01 * TURN
    return np.unwrap(angles, axis=0) if is_wrapped else angles


def enclosing_turns(angles: FloatArray) -> int:
    """Return the number of whole turns over which ascending angles are sampled [rad]."""
    return max(1, ceil(float(angles[-1] - angles[0]) / TURN))


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw of a quaternion of any norm [rad]."""
    return atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)


def crank_angle(alpha: SupportsFloat) -> float:
    """Return a crank angle [rad] as a float; raises if not finite or |alpha| > 1e6."""
    # The fast path: nearly every crank angle is a float within a turn.
    number = alpha if type(alpha) is float else number_or_nan(alpha)
    # NaN fails every comparison.
    if not -TURN <= number <= TURN:
        if not abs(number) <= MAX_CRANK_ANGLE:
            raise CrankAngleError(alpha, MAX_CRANK_ANGLE)
        warn_of_degrees('a crank angle', [number])
    return number


def number_or_nan(argument: Any) -> float:
    """Return a float, NaN unless it is a number; float() would accept text such as '1_0'."""
    try:
        return nan if isinstance(argument, str | bytes | bytearray) else float(argument)
    except (TypeError, ValueError, OverflowError):
        return nan
