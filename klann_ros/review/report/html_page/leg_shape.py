"""What a leg is drawn from: points that its angles place, and the bodies that join them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from klann_ros.kinematics import foot_path, KinematicsError, KlannLeg
from klann_ros.kinematics.klann.geometry import KlannGeometry
from klann_ros.kinematics.leg_types import Leg
from klann_ros.review.drawing import BODIES, LETTERS, PIVOTS
import numpy as np
from numpy.typing import NDArray

from . import packed

Complex = NDArray[np.complex128]
# Those of the Klann leg that are measured clockwise are -1: alpha, gamma, beta, delta, theta.
_KLANN_SENSES = (1, -1, 1, 1, -1)


def leg_shape(leg: Leg) -> dict[str, Any]:
    """
    Return a leg's shape.

    The point p is at the sum of w_j exp(i s_j phi_j) over the bodies, plus a constant: `terms` has
    its j, Re w_j and Im w_j, `senses` has the s_j.
    """
    if isinstance(leg, KlannLeg):
        names: Sequence[str] = LETTERS
        shape = {'senses': _KLANN_SENSES, 'pivots': _indices(PIVOTS, names), 'foot': 'H'}
        q_u, q = _klann(leg.geometry)
        bodies = [(name, list(pairwise(letters))) for letters, name, _ in BODIES]
    else:
        linkage, description = leg.linkage, leg.linkage.description
        names = description.points
        pivots = _indices(list(description.pivots), names)
        shape = {'senses': linkage.senses, 'pivots': pivots, 'foot': description.foot}
        q_u, q = linkage.equations.q_u, linkage.equations.q
        bodies = [
            (body.angle, [(bar.start, bar.end) for bar in body.bars])
            for body in description.bodies
        ]
    return {
        **shape,
        'points': [
            {'name': name, 'at': [at.real, at.imag], 'terms': _terms(row)}
            for name, row, at in zip(names, q_u, q.tolist(), strict=True)
        ],
        'bodies': [
            {'name': name, 'bars': [_indices(bar, names) for bar in bars]} for name, bars in bodies
        ],
        **_path(leg),
    }


def _path(leg: Leg) -> dict[str, Any]:
    """Return the path that the foot has by the geometry, and whether it ends where it began."""
    try:
        path = foot_path(leg)  # type: ignore[misc] # its own pose
    except KinematicsError:
        return {'path': None}
    return {'path': [packed.floats(s) for s in path.h.T], 'closed': path.full_turn}


def _terms(row: Complex) -> list[tuple[int, float, float]]:
    return [(j, w.real, w.imag) for j, w in enumerate(row.tolist()) if w]


def _indices(some: Sequence[str], names: Sequence[str]) -> list[int]:
    return [names.index(name) for name in some]


def _klann(g: KlannGeometry) -> tuple[Complex, Complex]:
    """Return Q and q of `klann.equations.points`: p = Q u + q; gamma and theta are clockwise."""
    alpha, gamma, beta, delta, theta = np.eye(5)
    a, d, e = 1j * g.y_a, g.x_d, g.x_e + 1j * g.y_e
    c = g.l_dc * beta
    c_g = c + g.l_cg * np.exp(1j * g.angle_bcg) * gamma
    h = c_g + g.l_gh * np.exp(-1j * g.angle_fgh) * theta
    nothing = np.zeros(5)
    q_u = [nothing, g.l_ab * alpha, c, nothing, nothing, g.l_ef * delta, c_g, h]
    return np.array(q_u, dtype=complex), np.array([a, a, d, d, e, e, d, d], dtype=complex)
