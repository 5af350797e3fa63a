"""Integrals along the foot's path."""

from functools import cache
from math import pi
from typing import NamedTuple, TYPE_CHECKING

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .track import Track

if TYPE_CHECKING:
    from collections.abc import Callable

ORDER = 8


class Nodes(NamedTuple):
    """Points of a stretch of a track: H, dH/dt and the weights of an integral over t."""

    h: FloatArray
    h_t: FloatArray
    weights: FloatArray


def nodes(track: Track, t_0: float, t_1: float, panels: int) -> Nodes:
    """Return the nodes of Gauss and Legendre, 8 on each of so many equal panels of t."""
    x, w = _legendre()
    edges = np.linspace(t_0, t_1, panels + 1)
    half = (t_1 - t_0) / (2 * panels)
    ts = (edges[:-1, None] + half * (1.0 + x)).ravel().tolist()
    h = np.array([track.h_at(t) for t in ts])
    h_t = np.array([track.h_t_at(t) for t in ts])
    return Nodes(h, h_t, np.tile(half * w, panels))


def path_length(track: Track) -> float:
    """
    Return the length of the foot's path over a track [m].

    Over a turn the mean of |dH/dalpha| at the samples, the trapezoid rule, which converges
    geometrically for a periodic function; over another arc the rule of Gauss.
    """
    if track.span.is_turn:
        return TURN * float(np.hypot(*track.h_1.T).mean())
    _, h_t, weights = nodes(track, 0.0, pi, -(-len(track.t) // ORDER))
    return float(np.hypot(*h_t.T) @ weights)


def enclosed_area(track: Track) -> float:
    """
    Return the area that a turn's path encloses [m^2], 1/2 int (x dy - y dx).

    It is positive where the foot goes round counter-clockwise; loops of opposite sense of a path
    that crosses itself take from each other.
    """
    # About the middle of the path, which costs no digit of a path far from the origin.
    x, y = (track.h - track.h.mean(axis=0)).T
    x_1, y_1 = track.h_1.T
    return TURN * float((x * y_1 - y * x_1).mean()) / 2.0


@cache
def _legendre() -> tuple[FloatArray, FloatArray]:
    # Typed since NumPy 2 only.
    leggauss: Callable[[int], tuple[FloatArray, FloatArray]] = np.polynomial.legendre.leggauss
    x, w = leggauss(ORDER)
    return x, w
