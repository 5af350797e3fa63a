"""Angles modulo a turn."""

from math import pi, remainder

from .errors import CrankAngleError

TURN = 2.0 * pi
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


def check_crank_angle(alpha: float) -> None:
    """
    Refuse a crank angle that is not finite, or beyond +-1e6 rad.

    Raises
    ------
    CrankAngleError
        It carries the angle.

    """
    # NaN fails every comparison.
    if not -MAX_CRANK_ANGLE <= alpha <= MAX_CRANK_ANGLE:
        raise CrankAngleError(alpha, MAX_CRANK_ANGLE)
