"""Angles modulo a turn."""

from math import pi, remainder
from typing import SupportsFloat

from .errors import CrankAngleError

TURN = 2.0 * pi
# Where the tangent of a nearly singular pose leads many turns away, angles lose digits.
FAR = 2.0 * TURN
# Beyond this the last digit of a crank angle is worth more than 1e-10 rad.
MAX_CRANK_ANGLE = 1e6


def wrap(angle: float) -> float:
    """
    Return the angle in (-pi, pi].

    Parameters
    ----------
    angle : float
        Any finite angle [rad].

    """
    if -pi < angle <= pi:
        return angle
    wrapped = remainder(angle, TURN)
    return pi if wrapped == -pi else wrapped


def crank_angle(alpha: SupportsFloat) -> float:
    """
    Return a crank angle as a float [rad], whatever kind of number it is.

    Raises
    ------
    CrankAngleError
        It is not finite, beyond +-1e6 rad, or no number at all.

    """
    try:
        number = float(alpha)
    except (TypeError, ValueError, OverflowError):
        raise CrankAngleError(alpha, MAX_CRANK_ANGLE) from None
    # NaN fails every comparison.
    if not -MAX_CRANK_ANGLE <= number <= MAX_CRANK_ANGLE:
        raise CrankAngleError(alpha, MAX_CRANK_ANGLE)
    return number
