"""Measured or recorded angles, many poses at once: loop errors, feet and differences."""

from typing import Any, TypeAlias

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.linkage import as_linkage
import numpy as np

Vectors: TypeAlias = joints.Vectors


def vectors(leg: Any, angles: FloatArray) -> list[FloatArray]:
    """Return the bodies' vectors u of each pose, the common input of the other functions."""
    with np.errstate(invalid='ignore', over='ignore'):
        return joints.body_vectors(as_linkage(leg).structure, [*angles.T])


def loop_errors(leg: Any, angles: FloatArray, u: Vectors | None = None) -> FloatArray:
    """
    Return the closure error of each pose.

    Parameters
    ----------
    leg : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    angles : numpy.ndarray, shape (n, number of angles)
        All coordinates of each pose, the crank's first: angles [rad], and distances [m].
    u : list of numpy.ndarray, optional
        Their vectors if known; see `vectors`.

    Returns
    -------
    numpy.ndarray, shape (n,)
        The Euclidean norm of f [m]; NaN where an angle is not finite.

    """
    linkage = as_linkage(leg)
    w, c = linkage.equations
    u = vectors(leg, angles) if u is None else u
    with np.errstate(invalid='ignore', over='ignore'):
        gaps = np.stack(u, axis=-1) @ w.T + c
        errors: FloatArray = np.sqrt((gaps.real**2 + gaps.imag**2).sum(axis=1))
    return errors


def feet(leg: Any, angles: FloatArray, u: Vectors | None = None) -> FloatArray:
    """Return the foot H of each pose, shape (n, 2) [m], NaN likewise; see `loop_errors`."""
    linkage = as_linkage(leg)
    terms, constant = linkage.point_rows[linkage.foot]
    u = vectors(leg, angles) if u is None else u
    with np.errstate(invalid='ignore', over='ignore'):
        h = np.full(len(angles), constant, dtype=np.complex128)
        for j, w in terms.items():
            h += w * u[j]
    return np.column_stack([h.real, h.imag])


def differences(leg: Any, one: FloatArray, other: FloatArray) -> FloatArray:
    """
    Return the differences of poses' coordinates without the crank's, shape (n, k - 1).

    Angles modulo a turn, in [-pi, pi] [rad]; distances relative to the linkage's size.
    """
    linkage = as_linkage(leg)
    slides = np.array([body.slides for body in linkage.structure.bodies[1:]])
    with np.errstate(invalid='ignore', over='ignore'):
        apart = one - other
        return np.where(slides, apart / linkage.size, wrapped(apart))


def wrapped(angles: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi], unchanged if within already; NaN for infinite ones."""
    with np.errstate(over='ignore', invalid='ignore'):
        found: FloatArray = angles - TURN * np.round(angles / TURN)
    return found


def transmission_angles(leg: Any, angles: FloatArray) -> FloatArray:
    """Return the transmission angles of each pose, one a block [rad]; see `loop_errors`."""
    linkage = as_linkage(leg)
    u = vectors(leg, angles)
    with np.errstate(invalid='ignore', over='ignore'):
        return np.column_stack([block.transmission_angle(u) for block in linkage.blocks])
