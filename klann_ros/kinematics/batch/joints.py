"""Angles and points of a block of poses, from what a kernel has kept."""

from math import pi

import numpy as np

from .block import Block, Rows
from .constants import Array, Constants, Dyad, legs_of

Vector = tuple[Array, Array]


class Joints:
    """
    Where the joints of a block are, relative to the dyads' ends.

    Parameters
    ----------
    constants : numpy.ndarray, shape (27, n)
        All legs; see `constants.pack`.
    block : Block
        One that a kernel has filled in, with `keep`.

    """

    def __init__(self, constants: Array, block: Block) -> None:
        """Take C from B and D, and F from E and G."""
        self._c: Constants = legs_of(constants, block)
        self._r = r = Rows(*block.rows)
        self._missing = block.reason != 0
        zm_x, zm_y = _placed(self._c.dyad_1, (r.m_x, r.m_y), r.w_1, r.r_1)
        self._ef = ef_x, ef_y = _placed(self._c.dyad_2, (r.u_x, r.u_y), r.w_2, r.r_2)
        # C - B = z_1 (D - B) = -z_1 m, and m = B - D.
        self._bc = -zm_x, -zm_y
        self._dc = r.m_x - zm_x, r.m_y - zm_y
        self._fg = r.u_x - ef_x, r.u_y - ef_y

    def angles(self, out: Array) -> None:
        """Fill in gamma, beta, delta, theta in (-pi, pi] [rad], shape (..., 4)."""
        vectors = (self._bc, self._dc, self._ef, self._fg)
        # gamma and theta are clockwise: the y component changes its sign.
        for k, ((x, y), clockwise) in enumerate(
            zip(vectors, (True, False, False, True), strict=True)
        ):
            angle = np.arctan2(-y if clockwise else y, x)
            angle[angle == -pi] = pi
            out[..., k] = angle
        out[self._missing] = np.nan

    def points(self, out: Array) -> None:
        """Fill in the points A to H [m], shape (..., 8, 2)."""
        c, r = self._c, self._r
        places: tuple[tuple[Array | float, Array | float], ...] = (
            (0.0, c.y_a),
            (c.x_d + r.m_x, r.m_y),
            (c.x_d + self._dc[0], self._dc[1]),
            (c.x_d, 0.0),
            (c.x_e, c.y_e),
            (c.x_e + self._ef[0], c.y_e + self._ef[1]),
            (c.x_e + r.u_x, c.y_e + r.u_y),
            (r.h_x, r.h_y),
        )
        for k, (x, y) in enumerate(places):
            out[..., k, 0] = x
            out[..., k, 1] = y
        out[self._missing] = np.nan


def _placed(dyad: Dyad, v: Vector, w: Array, r: Array) -> Vector:
    """Return z v, with z = 1/2 + w (K + i s r)."""
    (v_x, v_y), z_x, z_y = v, 0.5 + w * dyad.k, w * (dyad.s * r)
    return z_x * v_x - z_y * v_y, z_y * v_x + z_x * v_y
