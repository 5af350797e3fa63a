"""Angles that were measured or recorded, many poses at once: do they close, where is the foot."""

from typing import Any

from klann_ros.kinematics.linkage.linkage import as_linkage
import numpy as np

from .program import Array


def loop_errors(leg: Any, angles: Array) -> Array:
    """
    Return by how much the loops of each pose do not close.

    Parameters
    ----------
    leg : Linkage, KlannGeometry, FourBarGeometry or leg
        What moves.
    angles : numpy.ndarray, shape (n, number of angles)
        All angles of each pose, the crank's first [rad].

    Returns
    -------
    numpy.ndarray, shape (n,)
        The Euclidean norm of f [m]; NaN where an angle is not finite.

    """
    linkage = as_linkage(leg)
    w, c = linkage.equations
    with np.errstate(invalid='ignore', over='ignore'):
        gaps = np.exp(linkage.i_s * angles) @ w.T + c
        errors: Array = np.sqrt((gaps.real**2 + gaps.imag**2).sum(axis=1))
    return errors


def feet(leg: Any, angles: Array) -> Array:
    """Return the foot H of each pose, shape (n, 2) [m], NaN likewise; see `loop_errors`."""
    linkage = as_linkage(leg)
    terms, constant = linkage.point_rows[linkage.foot]
    with np.errstate(invalid='ignore', over='ignore'):
        h = np.full(len(angles), constant)
        for j, w in terms.items():
            h += w * np.exp(linkage.i_s[j] * angles[:, j])
    return np.column_stack([h.real, h.imag])


def transmission_angles(leg: Any, angles: Array) -> Array:
    """Return the transmission angles of each pose, one a block [rad]; see `loop_errors`."""
    linkage = as_linkage(leg)
    with np.errstate(invalid='ignore', over='ignore'):
        u = np.exp(linkage.i_s * angles).T
        return np.column_stack([block.transmission_angle(u) for block in linkage.blocks])
