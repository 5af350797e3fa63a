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

from .track import Coordinate, Track, wrap_positive

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
    where the path crosses itself [rad]. `distance` is from the foot to the point [m].
    """

    alpha: float
    distance: float
    ties: tuple[float, ...]


class MonotoneInterval(NamedTuple):
    """An interval of a track on which a coordinate s is monotone: t and s at both ends."""

    t_0: float
    t_1: float
    s_0: float
    s_1: float


def turning_points(track: Track, s: Coordinate) -> list[float]:
    """
    Return the zero crossings of ds/dt, as sorted parameters t; of a turn, in [0, pi).

    Sign changes between samples are refined to rounding; an extreme of ds/dt between samples of
    one sign may separate two crossings.
    """
    crossings = list(_crossings(track, s, _slope_samples(track, s)))
    if track.span.is_turn:
        crossings = [wrap_positive(t, pi) for t in crossings]
    return sorted(crossings)


def monotone_intervals(track: Track, s: Coordinate) -> list[MonotoneInterval]:
    """Return the monotone intervals of a track, in order; the last one of a turn closes it."""
    extremes = turning_points(track, s)
    if not track.span.is_turn:
        ends = [float(track.t[0]), *extremes, float(track.t[-1])]
    elif extremes:
        ends = [*extremes, extremes[0] + pi]
    else:
        ends = [0.0, pi]
    coordinates = [track.value(s, t) for t in ends]
    if track.span.is_turn:
        # The last end is the same point as the first.
        coordinates[-1] = coordinates[0]
    intervals = []
    for k in range(len(ends) - 1):
        interval = MonotoneInterval(ends[k], ends[k + 1], coordinates[k], coordinates[k + 1])
        intervals.append(interval)
    return intervals


def slope_range(track: Track, s: Coordinate, t_0: float, t_1: float) -> tuple[float, float]:
    """Return the minimum and maximum of |ds/dalpha| from t_0 to t_1; inf at the end of an arc."""
    candidates = [t_0, t_1]
    candidates += [t for t in _steepest(track, s, t_0, t_1) if t_0 < t < t_1]
    # At the end of an arc a dyad is singular, and the slope is rounding.
    ends = () if track.span.is_turn else (track.t[0], track.t[-1])
    steepness = [inf if t in ends else abs(track.value(s, t, 1)) for t in candidates]
    return min(steepness), max(steepness)


def _steepest(track: Track, s: Coordinate, t_0: float, t_1: float) -> Iterator[float]:
    """Yield the extremes t of ds/dalpha near t_0 .. t_1."""
    ts = track.t.tolist()
    slopes = track.slopes(s).tolist()
    if track.span.is_turn:
        # The interval may reach into the next turn.
        ts = [ts[-1] - pi, *ts, *(t + pi for t in ts)]
        slopes = [slopes[-1], *slopes, *slopes]
    for k in range(1, len(ts) - 1):
        is_extreme = (slopes[k] - slopes[k - 1]) * (slopes[k + 1] - slopes[k]) <= 0.0
        left = ts[k - 1]
        right = ts[k + 1]
        if is_extreme and left < t_1 and right > t_0:
            bend_left = track.value(s, left, 2)
            bend_right = track.value(s, right, 2)
            if bend_left * bend_right < 0.0:
                yield root(lambda t: track.value(s, t, 2), (left, bend_left), (right, bend_right))
            else:
                yield ts[k]


def _slope_samples(track: Track, s: Coordinate) -> list[Sample]:
    """Return t and ds/dt where not 0; a turn is extended periodically at both ends."""
    ts = track.t.tolist()
    alpha_1 = [track.span.alpha_1(t) for t in ts]
    samples = list(zip(ts, (track.slopes(s) * alpha_1).tolist(), strict=True))
    if not track.span.is_turn:
        # At the ends dalpha/dt is 0 and ds/dalpha, mostly, infinite.
        for end, neighbour in ((0, 1), (-1, -2)):
            t = ts[end] + END_OFFSET * (ts[neighbour] - ts[end])
            samples[end] = t, track.value_t(s, t, 1)
    samples = [(t, slope) for t, slope in samples if not isnan(slope) and slope != 0.0]
    if track.span.is_turn and samples:
        first_t, first_slope = samples[0]
        last_t, last_slope = samples[-1]
        samples = [(last_t - pi, last_slope), *samples, (first_t + pi, first_slope)]
    return samples


def _crossings(track: Track, s: Coordinate, samples: list[Sample]) -> Iterator[float]:
    """Yield the zero crossings of ds/dt between its samples."""
    # The last two samples of a turn repeat the first two.
    for left, right in pairwise(samples[:-1] if track.span.is_turn else samples):
        if left[1] * right[1] < 0.0:
            yield root(lambda t: track.value_t(s, t, 1), left, right)
    for left, middle, right in zip(samples, samples[1:], samples[2:], strict=False):
        has_one_sign = left[1] * middle[1] > 0.0 and middle[1] * right[1] > 0.0
        if has_one_sign and abs(left[1]) >= abs(middle[1]) <= abs(right[1]):
            yield from _hidden_crossings(track, s, left, right)


def _hidden_crossings(track: Track, s: Coordinate, left: Sample, right: Sample) -> Iterator[float]:
    """Yield the two crossings of ds/dt, if any, between two samples of the same sign."""
    bend_left = left[0], track.value_t(s, left[0], 2)
    bend_right = right[0], track.value_t(s, right[0], 2)
    if not bend_left[1] * bend_right[1] < 0.0:
        return
    t = root(lambda t: track.value_t(s, t, 2), bend_left, bend_right)
    dip = t, track.value_t(s, t, 1)
    if dip[1] * left[1] < 0.0:
        yield root(lambda t: track.value_t(s, t, 1), left, dip)
        yield root(lambda t: track.value_t(s, t, 1), dip, right)


def parameters_at(track: Track, s: Coordinate, level: float, rounding: float) -> list[float]:
    """
    Return the parameters t where a coordinate has a level, in the track's order.

    A level within rounding of a monotone interval's end is at that end: an extreme has one angle.
    """
    parameters = []
    for t_0, t_1, s_0, s_1 in monotone_intervals(track, s):
        is_at_start = abs(s_0 - level) <= rounding
        is_at_end = abs(s_1 - level) <= rounding
        if is_at_start:
            parameters.append(t_0)
        if is_at_end:
            parameters.append(t_1)
        if not is_at_start and not is_at_end and (s_0 < level) != (s_1 < level):
            start = (t_0, s_0 - level)
            end = (t_1, s_1 - level)
            parameters.append(root(lambda t: track.value(s, t) - level, start, end))
    return parameters


def crank_angles_at(
    tracks: Iterable[Track], s: Coordinate, level: float, size: float
) -> list[float]:
    """Return all crank angles in [0, 2 pi) where a coordinate has a level, sorted [rad]."""
    alphas = []
    for track in tracks:
        alphas += [track.crank_angle(t) for t in parameters_at(track, s, level, ROUNDING * size)]
    return distinct(alphas)


def nearest(tracks: Iterable[Track], point: tuple[float, float], size: float) -> Nearest:
    """Return the crank angle of the foot's nearest position to a point (x, y) [m]."""
    x, y = point
    squared_distance = Coordinate(point=point, k=1.0)
    candidates = []
    for track in tracks:
        extremes = turning_points(track, squared_distance)
        for t in (*extremes, float(track.t[0]), float(track.t[-1])):
            h_x, h_y = track.foot_t(t)[0].tolist()
            candidates.append((hypot(h_x - x, h_y - y), track.crank_angle(t)))
    min_distance, _ = min(candidates)
    limit = min_distance + TIE * size
    ties = distinct(alpha for distance, alpha in candidates if distance <= limit)
    return Nearest(ties[0], min_distance, tuple(ties))


def distinct(alphas: Iterable[float]) -> list[float]:
    """Return crank angles of [0, 2 pi) sorted, without duplicates; 0 and 2 pi are equal."""
    unique: list[float] = []
    for alpha in sorted(alphas):
        if not unique or alpha - unique[-1] > ANGLE_TOLERANCE:
            unique.append(alpha)
    if len(unique) > 1 and unique[0] + TURN - unique[-1] <= ANGLE_TOLERANCE:
        unique.pop()
    return unique
