"""
The inverse problem: the crank angles that put the foot at a given place.

Between the turning points of a coordinate of the foot, where ds/dt = 0, it is monotone and has a
value at most once.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import hypot, inf, isnan, pi
from sys import float_info
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.searches import root, Sample

from .track import Coordinate, Track

# Where slopes are taken at the end of an arc, relative to the first step between samples.
END_OFFSET = 1e-3
# Round-off of a coordinate, relative to the size of the leg.
ROUNDING = 16.0 * float_info.epsilon
# Distances that count as equal, relative to the size of the leg.
TIE = 1e-12
# Tolerance for equal angles [rad].
ANGLE_TOLERANCE = 1e-12


class Nearest(NamedTuple):
    """
    The crank angle of the foot's nearest position to a point.

    `alpha` is in [0, 2 pi), the first of `ties`, all sorted crank angles with this distance: two
    where the path crosses itself [rad]. `distance` is that of the foot from the point [m].
    """

    alpha: float
    distance: float
    ties: tuple[float, ...]


class MonotoneInterval(NamedTuple):
    """An interval of a track on which a coordinate is monotone: both t, and their values."""

    t_0: float
    t_1: float
    value_0: float
    value_1: float


def turning_points(track: Track, s: Coordinate) -> list[float]:
    """
    Return the zero crossings of ds/dt, as sorted parameters t; of a turn, in [0, pi).

    Sign changes between samples are refined to rounding; an extreme of ds/dt between samples of
    one sign may separate two crossings.
    """
    found = list(_crossings(track, s, _neighbours(track, s)))
    if track.span.is_turn:
        found = [t % pi for t in found]
        # A tiny negative number has its remainder rounded to pi.
        found = [t if t < pi else 0.0 for t in found]
    return sorted(found)


def monotone_intervals(track: Track, s: Coordinate) -> list[MonotoneInterval]:
    """Return the monotone intervals of a track, in order; the last one of a turn closes it."""
    turns = turning_points(track, s)
    if not track.span.is_turn:
        ends = [float(track.t[0]), *turns, float(track.t[-1])]
    elif turns:
        ends = [*turns, turns[0] + pi]
    else:
        ends = [0.0, pi]
    values = [track.value(s, t) for t in ends]
    if track.span.is_turn:
        # The same point.
        values[-1] = values[0]
    pairs = zip(pairwise(ends), pairwise(values), strict=True)
    return [MonotoneInterval(*t, *v) for t, v in pairs]


def slope_range(track: Track, s: Coordinate, t_0: float, t_1: float) -> tuple[float, float]:
    """Return the least and the greatest |ds/dalpha| from t_0 to t_1; inf at the end of an arc."""
    candidates = [t_0, t_1, *(t for t in _steepest(track, s, t_0, t_1) if t_0 < t < t_1)]
    # At the end of an arc a dyad is singular, and the slope is rounding.
    ends = () if track.span.is_turn else (track.t[0], track.t[-1])
    steepness = [inf if t in ends else abs(track.value(s, t, 1)) for t in candidates]
    return min(steepness), max(steepness)


def _steepest(track: Track, s: Coordinate, t_0: float, t_1: float) -> Iterator[float]:
    """Yield the extremes t of ds/dalpha near t_0 .. t_1."""
    rows = list(zip(track.t.tolist(), track.slopes(s).tolist(), strict=True))
    if track.span.is_turn:
        # The interval may reach into the next turn.
        rows = [(rows[-1][0] - pi, rows[-1][1]), *rows, *((t + pi, slope) for t, slope in rows)]
    for (left, before), (t, slope), (right, after) in zip(rows, rows[1:], rows[2:], strict=False):
        if (slope - before) * (after - slope) <= 0.0 and left < t_1 and right > t_0:
            bends = (left, track.value(s, left, 2)), (right, track.value(s, right, 2))
            hidden = bends[0][1] * bends[1][1] < 0.0
            yield root(lambda t: track.value(s, t, 2), *bends) if hidden else t


def _neighbours(track: Track, s: Coordinate) -> list[Sample]:
    """Return t and ds/dt where not 0; a turn is extended periodically at both ends."""
    ts = track.t.tolist()
    speeds = [track.span.alpha_1(t) for t in ts]
    rows = list(zip(ts, (track.slopes(s) * speeds).tolist(), strict=True))
    if not track.span.is_turn:
        # At the ends dalpha/dt is 0 and ds/dalpha, mostly, infinite.
        for end, beside in ((0, 1), (-1, -2)):
            t = ts[end] + END_OFFSET * (ts[beside] - ts[end])
            rows[end] = t, track.value_t(s, t, 1)
    rows = [(t, slope) for t, slope in rows if not isnan(slope) and slope != 0.0]
    if track.span.is_turn and rows:
        (t_0, slope_0), (t_1, slope_1) = rows[0], rows[-1]
        rows = [(t_1 - pi, slope_1), *rows, (t_0 + pi, slope_0)]
    return rows


def _crossings(track: Track, s: Coordinate, rows: list[Sample]) -> Iterator[float]:
    # Of a turn the last pair repeats the first.
    for left, right in pairwise(rows[:-1] if track.span.is_turn else rows):
        if left[1] * right[1] < 0.0:
            yield root(lambda t: track.value_t(s, t, 1), left, right)
    for before, middle, after in zip(rows, rows[1:], rows[2:], strict=False):
        same = before[1] * middle[1] > 0.0 and middle[1] * after[1] > 0.0
        if same and abs(before[1]) >= abs(middle[1]) <= abs(after[1]):
            yield from _hidden(track, s, before, after)


def _hidden(track: Track, s: Coordinate, before: Sample, after: Sample) -> Iterator[float]:
    """Yield the two crossings of ds/dt, if any, between two samples of the same sign."""
    bends = [(t, track.value_t(s, t, 2)) for t, _ in (before, after)]
    if not bends[0][1] * bends[1][1] < 0.0:
        return
    t = root(lambda t: track.value_t(s, t, 2), *bends)
    dip = t, track.value_t(s, t, 1)
    if dip[1] * before[1] < 0.0:
        for left, right in ((before, dip), (dip, after)):
            yield root(lambda t: track.value_t(s, t, 1), left, right)


def parameters_at(track: Track, s: Coordinate, value: float, rounding: float) -> list[float]:
    """
    Return the parameters t with a value of a coordinate, in the track's order.

    A value within rounding of a monotone interval's end is at that end: an extreme has one angle.
    """
    found = []
    for t_0, t_1, value_0, value_1 in monotone_intervals(track, s):
        at_0, at_1 = abs(value_0 - value) <= rounding, abs(value_1 - value) <= rounding
        found += [t for t, here in ((t_0, at_0), (t_1, at_1)) if here]
        if not at_0 and not at_1 and (value_0 < value) != (value_1 < value):
            ends = (t_0, value_0 - value), (t_1, value_1 - value)
            found.append(root(lambda t: track.value(s, t) - value, *ends))
    return found


def crank_angles_at(
    tracks: Iterable[Track], s: Coordinate, value: float, size: float
) -> list[float]:
    """Return all crank angles in [0, 2 pi) with a value of a coordinate, sorted [rad]."""
    return distinct(
        track.crank_angle(t)
        for track in tracks
        for t in parameters_at(track, s, value, ROUNDING * size)
    )


def nearest(tracks: Iterable[Track], point: tuple[float, float], size: float) -> Nearest:
    """Return the crank angle of the foot's nearest position to a point (x, y) [m]."""
    x, y = point
    s = Coordinate(point=point, k=1.0)
    candidates = []
    for track in tracks:
        for t in (*turning_points(track, s), float(track.t[0]), float(track.t[-1])):
            h_x, h_y = track.foot_t(t)[0].tolist()
            candidates.append((hypot(h_x - x, h_y - y), track.crank_angle(t)))
    distance = min(candidates)[0]
    ties = distinct(alpha for d, alpha in candidates if d <= distance + TIE * size)
    return Nearest(ties[0], distance, tuple(ties))


def distinct(alphas: Iterable[float]) -> list[float]:
    """Return crank angles of [0, 2 pi) sorted, without duplicates; 0 and 2 pi are equal."""
    unique: list[float] = []
    for alpha in sorted(alphas):
        if not unique or alpha - unique[-1] > ANGLE_TOLERANCE:
            unique.append(alpha)
    if len(unique) > 1 and unique[0] + TURN - unique[-1] <= ANGLE_TOLERANCE:
        unique.pop()
    return unique
