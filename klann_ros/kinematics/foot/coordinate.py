"""What of a foot's position is asked: a number made of H, and its derivatives along the path."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Coordinate(Protocol):
    """A smooth function s of the foot's position; arrays of shape (..., 2) in, (...) out."""

    def value(self, h: Array) -> Array:
        """Return s(H)."""
        ...

    def slope(self, h: Array, h_1: Array) -> Array:
        """Return ds/dalpha for H and dH/dalpha."""
        ...

    def curvature(self, h: Array, h_1: Array, h_2: Array) -> Array:
        """Return d2s/dalpha2 for H and its first two derivatives."""
        ...


@dataclass(frozen=True)
class Along:
    """s = u H.x + v H.y: how far H is along a direction [m]."""

    u: float
    v: float

    def value(self, h: Array) -> Array:
        """Return s [m]."""
        s: Array = self.u * h[..., 0] + self.v * h[..., 1]
        return s

    def slope(self, h: Array, h_1: Array) -> Array:  # noqa: ARG002 - s is linear in H
        """Return ds/dalpha [m/rad]."""
        return self.value(h_1)

    def curvature(self, h: Array, h_1: Array, h_2: Array) -> Array:  # noqa: ARG002 - as above
        """Return d2s/dalpha2 [m/rad^2]."""
        return self.value(h_2)


@dataclass(frozen=True)
class SquareDistance:
    """s = |H - P|^2 / 2 from a point P = (x, y) [m^2]."""

    x: float
    y: float

    def value(self, h: Array) -> Array:
        """Return s [m^2]."""
        return _dot(h - (self.x, self.y), h - (self.x, self.y)) / 2.0

    def slope(self, h: Array, h_1: Array) -> Array:
        """Return ds/dalpha [m^2/rad]."""
        return _dot(h - (self.x, self.y), h_1)

    def curvature(self, h: Array, h_1: Array, h_2: Array) -> Array:
        """Return d2s/dalpha2 [m^2/rad^2]."""
        return _dot(h_1, h_1) + _dot(h - (self.x, self.y), h_2)


X, Y = Along(1.0, 0.0), Along(0.0, 1.0)


def _dot(p: Array, q: Array) -> Array:
    return np.asarray(p[..., 0] * q[..., 0] + p[..., 1] * q[..., 1], dtype=np.float64)
