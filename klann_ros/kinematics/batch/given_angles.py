"""Angles that were measured or recorded, many poses at once: do they close, where is the foot."""

from klann_ros.kinematics.klann.geometry import KlannGeometry
from klann_ros.kinematics.leg_types import Leg
from klann_ros.kinematics.linkage.leg import LinkageLeg
import numpy as np
from numpy.typing import NDArray

from .constants import Array

Complex = NDArray[np.complex128]


def loop_errors(leg: Leg, angles: Array) -> Array:
    """
    Return by how much the loops of each pose do not close.

    Parameters
    ----------
    leg : KlannLeg or LinkageLeg
        The leg.
    angles : numpy.ndarray, shape (n, number of angles)
        All angles of each pose, the crank's first [rad].

    Returns
    -------
    numpy.ndarray, shape (n,)
        The Euclidean norm of f [m]; NaN where an angle is not finite.

    """
    with np.errstate(invalid='ignore', over='ignore'):
        if isinstance(leg, LinkageLeg):
            equations = leg.linkage.equations
            gaps = _turned(leg, angles) @ equations.w.T + equations.c
        else:
            gaps = _klann_gaps(leg.geometry, angles)
        errors: Array = np.sqrt((gaps.real**2 + gaps.imag**2).sum(axis=1))
    return errors


def feet(leg: Leg, angles: Array) -> Array:
    """
    Return the foot H of each pose.

    Parameters
    ----------
    leg, angles
        As in `loop_errors`.

    Returns
    -------
    numpy.ndarray, shape (n, 2)
        H (x, y) [m]; NaN where an angle is not finite.

    """
    with np.errstate(invalid='ignore', over='ignore'):
        if isinstance(leg, LinkageLeg):
            linkage = leg.linkage
            h = np.full(len(angles), linkage.foot_constant)
            for j, w in linkage.foot_terms:
                h += w * np.exp(linkage.i_s[j] * angles[:, j])
        else:
            h = _klann_foot(leg.geometry, angles)
    return np.column_stack([h.real, h.imag])


def _turned(leg: LinkageLeg, angles: Array) -> Complex:
    u: Complex = np.exp(leg.linkage.i_s * angles)
    return u


def _klann_gaps(g: KlannGeometry, angles: Array) -> Complex:
    """Return f1 + i f2 and f3 + i f4 of `klann.equations.f`; gamma and theta are clockwise."""
    alpha, gamma, beta, delta, theta = np.exp(1j * angles * _SENSES).T
    dc = g.l_dc * beta
    gap_1 = g.l_ab * alpha + g.l_bc * gamma - dc - g.x_d + 1j * g.y_a
    gap_2 = g.l_ef * delta + g.l_fg * theta - g.l_cg * gamma * np.exp(1j * g.angle_bcg) - dc
    return np.column_stack([gap_1, gap_2 - g.x_d + g.x_e + 1j * g.y_e])


def _klann_foot(g: KlannGeometry, angles: Array) -> Complex:
    """Return H = D + DC + CG + GH, as `klann.equations.points` has it."""
    _, gamma, beta, _, theta = np.exp(1j * angles * _SENSES).T
    foot: Complex = (
        g.x_d
        + g.l_dc * beta
        + g.l_cg * gamma * np.exp(1j * g.angle_bcg)
        + g.l_gh * theta * np.exp(-1j * g.angle_fgh)
    )
    return foot


_SENSES = np.array([1.0, -1.0, 1.0, 1.0, -1.0])
