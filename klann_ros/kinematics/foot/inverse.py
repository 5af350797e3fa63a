"""The inverse question: which crank angles put the foot where it is wanted."""

from collections.abc import Iterable
from math import hypot
from sys import float_info
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN

from .extremes import pieces, root, turning_points
from .track import Coordinate, Track

# What a coordinate can lose to rounding, as a part of the leg's size.
ROUNDING = 16.0 * float_info.epsilon
# Feet as near as this part of the leg's size are equally near.
TIE = 1e-12
# Angles nearer than this are the same [rad].
SAME_ANGLE = 1e-12


class Nearest(NamedTuple):
    """
    The crank angle at which the foot is nearest to a point.

    Attributes
    ----------
    alpha : float
        Crank angle in [0, 2 pi), the first of `ties` [rad].
    distance : float
        How far the foot is from the point there [m].
    ties : tuple of float
        All crank angles at which it is as near, sorted [rad]: two where the path crosses itself.

    """

    alpha: float
    distance: float
    ties: tuple[float, ...]


def parameters_at(track: Track, s: Coordinate, value: float, rounding: float) -> list[float]:
    """
    Return the parameters t at which a coordinate has a value, in the track's order.

    On each monotone piece there is one at most. A value that an end of the piece has, but for
    rounding, is taken there: so an extreme gives one angle and not two beside it.
    """
    found = []
    for t_0, t_1, value_0, value_1 in pieces(track, s):
        at_0, at_1 = abs(value_0 - value) <= rounding, abs(value_1 - value) <= rounding
        found += [t for t, here in ((t_0, at_0), (t_1, at_1)) if here]
        if not at_0 and not at_1 and (value_0 < value) != (value_1 < value):
            ends = (t_0, value_0 - value), (t_1, value_1 - value)
            found.append(root(lambda t: track.value(s, t) - value, *ends))
    return found


def crank_angles_at(
    tracks: Iterable[Track], s: Coordinate, value: float, size: float
) -> list[float]:
    """Return all crank angles in [0, 2 pi) at which a coordinate has a value, sorted [rad]."""
    return distinct(
        track.crank_angle(t)
        for track in tracks
        for t in parameters_at(track, s, value, ROUNDING * size)
    )


def nearest(tracks: Iterable[Track], point: tuple[float, float], size: float) -> Nearest:
    """Return the crank angle at which the foot is nearest to a point (x, y) [m]."""
    x, y = point
    s = Coordinate(point=point, k=1.0)
    candidates = []
    for track in tracks:
        for t in (*turning_points(track, s), float(track.t[0]), float(track.t[-1])):
            h_x, h_y = track.h_at(t).tolist()
            candidates.append((hypot(h_x - x, h_y - y), track.crank_angle(t)))
    distance = min(candidates)[0]
    ties = distinct(alpha for d, alpha in candidates if d <= distance + TIE * size)
    return Nearest(ties[0], distance, tuple(ties))


def distinct(alphas: Iterable[float]) -> list[float]:
    """Return crank angles of [0, 2 pi) sorted and each once; 0 and 2 pi are the same."""
    kept: list[float] = []
    for alpha in sorted(alphas):
        if not kept or alpha - kept[-1] > SAME_ANGLE:
            kept.append(alpha)
    if len(kept) > 1 and kept[0] + TURN - kept[-1] <= SAME_ANGLE:
        kept.pop()
    return kept
