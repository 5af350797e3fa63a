"""What of a foot's position is asked: a number made of H, and its derivatives along the path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinate:
    """
    s = u H.x + v H.y + k |H - P|^2 / 2; arrays of shape (..., 2) in, (...) out.

    With k = 0 it is how far H is along a direction (u, v), with k = 1 alone half the square of its
    distance from a point P.
    """

    along: tuple[float, float] = (0.0, 0.0)
    point: tuple[float, float] = (0.0, 0.0)
    k: float = 0.0

    def value(self, h: Array) -> Array:
        """Return s(H)."""
        from_p = h - self.point
        return _dot(self.along, h) + self.k * _dot(from_p, from_p) / 2.0

    def slope(self, h: Array, h_1: Array) -> Array:
        """Return ds/dalpha for H and dH/dalpha."""
        return _dot(self.along, h_1) + self.k * _dot(h - self.point, h_1)

    def curvature(self, h: Array, h_1: Array, h_2: Array) -> Array:
        """Return d2s/dalpha2 for H and its first two derivatives."""
        round_p = _dot(h_1, h_1) + _dot(h - self.point, h_2)
        return _dot(self.along, h_2) + self.k * round_p


X, Y = Coordinate((1.0, 0.0)), Coordinate((0.0, 1.0))


def _dot(p: Array | tuple[float, float], q: Array) -> Array:
    (x, y) = (p[..., 0], p[..., 1]) if isinstance(p, np.ndarray) else p
    return np.asarray(x * q[..., 0] + y * q[..., 1], dtype=np.float64)
