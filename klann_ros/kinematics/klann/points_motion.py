"""How the points A to H move: each link's end about its start, added up as the points are."""

from math import cos, sin
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .pose import KlannPose

Vector = tuple[float, float]


def turning_velocity(length: float, angle: float, rate: float) -> Vector:
    """Return the velocity of a link's end about its start, counter-clockwise angles [m/s]."""
    return -length * rate * sin(angle), length * rate * cos(angle)


def turning_acceleration(length: float, angle: float, rate: float, change: float) -> Vector:
    """
    Return the acceleration of a link's end about its start, counter-clockwise angles [m/s^2].

    L (phi'' (-sin phi, cos phi) - phi'^2 (cos phi, sin phi)): along its path and to its centre.
    """
    c, s = length * cos(angle), length * sin(angle)
    return -change * s - rate * rate * c, change * c - rate * rate * s


def velocities(pose: 'KlannPose', rates: 'Sequence[float]') -> NDArray[np.float64]:
    """
    Return the velocities of A to H, shape (8, 2) [m/s].

    Parameters
    ----------
    pose : KlannPose
        A solved pose.
    rates : sequence of float, shape (5,)
        Rates of alpha, gamma, beta, delta, theta [rad/s].

    """
    moved = zip(_links(pose), _counter_clockwise(rates), strict=True)
    return _added([turning_velocity(*link, rate) for link, rate in moved])


def accelerations(
    pose: 'KlannPose', rates: 'Sequence[float]', changes: 'Sequence[float]'
) -> NDArray[np.float64]:
    """
    Return the accelerations of A to H, shape (8, 2) [m/s^2].

    Parameters
    ----------
    pose : KlannPose
        A solved pose.
    rates, changes : sequence of float, shape (5,)
        First and second derivatives of alpha, gamma, beta, delta, theta [rad/s, rad/s^2].

    """
    moved = zip(_links(pose), _counter_clockwise(rates), _counter_clockwise(changes), strict=True)
    return _added([turning_acceleration(*link, rate, change) for link, rate, change in moved])


def _links(pose: 'KlannPose') -> list[tuple[float, float]]:
    """Return length and counter-clockwise direction of AB, DC, CG, EF, GH."""
    g = pose.geometry
    return [
        (g.l_ab, pose.alpha),
        (g.l_dc, pose.beta),
        (g.l_cg, g.angle_bcg - pose.gamma),
        (g.l_ef, pose.delta),
        (g.l_gh, -pose.theta - g.angle_fgh),
    ]


def _counter_clockwise(rates: 'Sequence[float]') -> 'Sequence[float]':
    """Return the rates of AB, DC, CG, EF, GH: gamma and theta are clockwise."""
    alpha, gamma, beta, delta, theta = rates
    return alpha, beta, -gamma, delta, -theta


def _added(vectors: list[Vector]) -> NDArray[np.float64]:
    """Return the rows A to H: B on A, C on D, F on E, G on C, H on G."""
    ab, dc, cg, ef, gh = (np.array(vector) for vector in vectors)
    fixed = np.zeros(2)
    return np.array([fixed, ab, dc, fixed, fixed, ef, dc + cg, dc + cg + gh])
