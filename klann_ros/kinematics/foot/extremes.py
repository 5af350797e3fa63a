"""Where a coordinate of the foot turns, and the pieces between: each only rises or falls."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import inf, isnan, pi
from sys import float_info
from typing import NamedTuple

from .track import Coordinate, Track

# Bisection alone needs about 60.
MOST_CALLS = 200

Sample = tuple[float, float]


def root(function: Callable[[float], float], left: Sample, right: Sample) -> float:
    """
    Return where a function crosses 0, to the last digits of the bracket's ends.

    Chandrupatla's method: inverse quadratic interpolation where the last three values promise
    that it converges, else bisection; the root stays bracketed at every step.

    Parameters
    ----------
    function : callable
        A continuous function; an argument at which it is NaN counts as its root.
    left, right : (float, float)
        Two arguments with their values: of opposite sign, or one of them 0.

    References
    ----------
    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm for finding the zero of a
    nonlinear function without using derivatives, Advances in Engineering Software 28 (1997) 145.

    """
    # b is the newest, a on the other side of the root.
    (b, f_b), (a, f_a) = right, left
    share = 0.5
    # Relative to the bracket, not to the root: a root at 0 has no last digit.
    resolution = 2.0 * float_info.epsilon * max(abs(a), abs(b))
    for _ in range(MOST_CALLS):
        best, f_best = (a, f_a) if abs(f_a) < abs(f_b) else (b, f_b)
        if f_best == 0.0 or abs(b - a) <= 2.0 * resolution:
            break
        nearest = resolution / abs(b - a)
        t = b + min(max(share, nearest), 1.0 - nearest) * (a - b)
        value = function(t)
        if isnan(value):
            return t
        if (value > 0.0) == (f_b > 0.0):
            c, f_c = b, f_b
        else:
            c, f_c = a, f_a
            a, f_a = b, f_b
        b, f_b = t, value
        share = _share((a, f_a), (b, f_b), (c, f_c))
    return best


def _share(side: Sample, newest: Sample, before: Sample) -> float:
    """Return where from b (0) to a (1) the root is expected; the middle where that is unsure."""
    (a, f_a), (b, f_b), (c, f_c) = side, newest, before
    xi, phi = (b - a) / (c - a), (f_b - f_a) / (f_c - f_a)
    if not (phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi):
        return 0.5
    of_c = f_b / (f_c - f_b) * f_a / (f_c - f_a)
    return f_b / (f_a - f_b) * f_c / (f_a - f_c) + (c - b) / (a - b) * of_c


# How near the end of an arc, as a part of the first step between samples, slopes are taken.
BESIDE = 1e-3

Rows = list[tuple[float, float]]


class Piece(NamedTuple):
    """A stretch of a track on which a coordinate is monotone: both t, and the values there."""

    t_0: float
    t_1: float
    value_0: float
    value_1: float


def turning_points(track: Track, s: Coordinate) -> list[float]:
    """
    Return the parameters t at which ds/dt crosses 0, sorted; of a turn, in [0, pi).

    Sign changes between samples are refined to rounding. Where ds/dt comes near 0 between samples
    without changing its sign at them, its own extreme is sought: two crossings may hide there.
    """
    found = list(_crossings(track, s, _neighbours(track, s)))
    if track.span.is_turn:
        found = [t % pi for t in found]
        # A tiny negative number has its remainder rounded to pi.
        found = [t if t < pi else 0.0 for t in found]
    return sorted(found)


def pieces(track: Track, s: Coordinate) -> list[Piece]:
    """Return the monotone pieces of a track, in its order; of a turn, the last one closes it."""
    turns = turning_points(track, s)
    if not track.span.is_turn:
        ends = [float(track.t[0]), *turns, float(track.t[-1])]
    elif turns:
        ends = [*turns, turns[0] + pi]
    else:
        ends = [0.0, pi]
    values = [track.value(s, t) for t in ends]
    if track.span.is_turn:
        # One and the same point.
        values[-1] = values[0]
    return [Piece(a, b, *v) for (a, b), v in zip(pairwise(ends), pairwise(values), strict=True)]


def slope_range(track: Track, s: Coordinate, t_0: float, t_1: float) -> tuple[float, float]:
    """Return the least and the greatest |ds/dalpha| from t_0 to t_1; inf at the end of an arc."""
    candidates = [t_0, t_1, *(t for t in _steepest(track, s, t_0, t_1) if t_0 < t < t_1)]
    # At the end of an arc a dyad is in line; how large a slope is found there is chance.
    ends = () if track.span.is_turn else (track.t[0], track.t[-1])
    steepness = [inf if t in ends else abs(track.slope(s, t)) for t in candidates]
    return min(steepness), max(steepness)


def _steepest(track: Track, s: Coordinate, t_0: float, t_1: float) -> Iterator[float]:
    """Yield the t near t_0 .. t_1 at which ds/dalpha itself turns."""
    rows = list(zip(track.t.tolist(), track.slopes(s).tolist(), strict=True))
    if track.span.is_turn:
        # t_1 may be in the next turn.
        rows = [(rows[-1][0] - pi, rows[-1][1]), *rows, *((t + pi, slope) for t, slope in rows)]
    for (left, before), (t, slope), (right, after) in zip(rows, rows[1:], rows[2:], strict=False):
        if (slope - before) * (after - slope) <= 0.0 and left < t_1 and right > t_0:
            bends = (left, track.curvature(s, left)), (right, track.curvature(s, right))
            hidden = bends[0][1] * bends[1][1] < 0.0
            yield root(lambda t: track.curvature(s, t), *bends) if hidden else t


def _neighbours(track: Track, s: Coordinate) -> Rows:
    """Return t and ds/dt where it is not 0; a turn goes on at both ends with its own samples."""
    ts = track.t.tolist()
    speeds = [track.span.alpha_1(t) for t in ts]
    rows = list(zip(ts, (track.slopes(s) * speeds).tolist(), strict=True))
    if not track.span.is_turn:
        # At the very ends dalpha/dt is 0 and ds/dalpha, mostly, infinite.
        for end, beside in ((0, 1), (-1, -2)):
            t = ts[end] + BESIDE * (ts[beside] - ts[end])
            rows[end] = t, track.slope_t(s, t)
    rows = [(t, slope) for t, slope in rows if not isnan(slope) and slope != 0.0]
    if track.span.is_turn and rows:
        (t_0, slope_0), (t_1, slope_1) = rows[0], rows[-1]
        rows = [(t_1 - pi, slope_1), *rows, (t_0 + pi, slope_0)]
    return rows


def _crossings(track: Track, s: Coordinate, rows: Rows) -> Iterator[float]:
    # Of a turn the last pair repeats the first.
    for left, right in pairwise(rows[:-1] if track.span.is_turn else rows):
        if left[1] * right[1] < 0.0:
            yield root(lambda t: track.slope_t(s, t), left, right)
    for before, middle, after in zip(rows, rows[1:], rows[2:], strict=False):
        same = before[1] * middle[1] > 0.0 and middle[1] * after[1] > 0.0
        if same and abs(before[1]) >= abs(middle[1]) <= abs(after[1]):
            yield from _hidden(track, s, before, after)


def _hidden(
    track: Track, s: Coordinate, before: tuple[float, float], after: tuple[float, float]
) -> Iterator[float]:
    """Yield the two crossings of ds/dt, if any, between two samples of the same sign."""
    bends = [(t, track.curvature_t(s, t)) for t, _ in (before, after)]
    if not bends[0][1] * bends[1][1] < 0.0:
        return
    t = root(lambda t: track.curvature_t(s, t), *bends)
    dip = t, track.slope_t(s, t)
    if dip[1] * before[1] < 0.0:
        for left, right in ((before, dip), (dip, after)):
            yield root(lambda t: track.slope_t(s, t), left, right)
