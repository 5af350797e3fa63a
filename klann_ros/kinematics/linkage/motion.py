"""Velocity and acceleration of a linkage's angles and points, from the same Jacobian."""

from math import isnan
from typing import NamedTuple

from klann_ros.kinematics import validation
from klann_ros.kinematics.errors import SingularPoseError
import numpy as np
from numpy.typing import NDArray

from .pose import LinkagePose

Array = NDArray[np.float64]


class LinkageMotion(NamedTuple):
    """
    The velocity, or the acceleration, of a pose.

    Attributes
    ----------
    joints : tuple of float
        Of every angle, the crank's first [rad/s] or [rad/s^2].
    points : numpy.ndarray, shape (p, 2)
        Of every point, in the order of the description's [m/s] or [m/s^2].
    h : tuple of float
        Of the foot (x, y) [m/s] or [m/s^2].

    """

    joints: tuple[float, ...]
    points: Array
    h: tuple[float, float]


def velocity(pose: LinkagePose, alpha_rate: float) -> LinkageMotion:
    """
    Return the velocity of a pose for a crank rate.

    With du_j/dt = i s_j phi_j' u_j the points move by Q du/dt.

    Parameters
    ----------
    pose : LinkagePose
        A solved pose.
    alpha_rate : float
        Rate of the crank [rad/s].

    Raises
    ------
    SingularPoseError
        The pose has no velocity.
    ValueError
        The rate is not finite.

    """
    _check(pose, alpha_rate=alpha_rate)
    rates = alpha_rate * np.array([1.0, *pose.coefficients])
    return _motion(pose, rates, pose.linkage.i_s * rates * np.array(pose.unit_vectors))


def acceleration(pose: LinkagePose, alpha_rate: float, alpha_acceleration: float) -> LinkageMotion:
    """
    Return the acceleration of a pose for a rate and an acceleration of the crank.

    The loops stay closed, W d2u/dt2 = 0 with d2u_j/dt2 = (i s_j phi_j'' - phi_j'^2) u_j: the same
    linear step as for the velocity, block by block.

    Parameters
    ----------
    pose : LinkagePose
        A solved pose.
    alpha_rate : float
        Rate of the crank [rad/s].
    alpha_acceleration : float
        Acceleration of the crank [rad/s^2].

    Raises
    ------
    SingularPoseError
        The pose has no acceleration.
    ValueError
        A rate is not finite.

    """
    _check(pose, alpha_rate=alpha_rate, alpha_acceleration=alpha_acceleration)
    linkage, u = pose.linkage, pose.unit_vectors
    i_s = linkage.i_s
    rates = alpha_rate * np.array([1.0, *pose.coefficients])
    accelerations = np.zeros(len(u))
    accelerations[0] = alpha_acceleration
    for block in linkage.blocks:
        moved = (i_s * accelerations - rates**2) * u
        turns = block.turn(u, block.total(moved.tolist()))
        if turns is None:
            raise SingularPoseError(pose.alpha)
        accelerations[list(block.unknowns)] = turns
    return _motion(pose, accelerations, (i_s * accelerations - rates**2) * u)


def _motion(pose: LinkagePose, joints: Array, vectors: NDArray[np.complex128]) -> LinkageMotion:
    points = pose.linkage.points_moved(vectors)
    x, y = points[pose.linkage.foot].tolist()
    return LinkageMotion(tuple(joints.tolist()), points, (x, y))


def _check(pose: LinkagePose, **rates: float) -> None:
    for name, rate in rates.items():
        validation.rate(name, rate)
    if isnan(pose.coefficients[0]):
        raise SingularPoseError(pose.alpha)
