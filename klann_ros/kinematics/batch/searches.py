"""Roots and minima of many functions of one variable at once."""

from collections.abc import Callable
from sys import float_info

from klann_ros.kinematics.arrays import FloatArray, IndexArray
import numpy as np

# Bisection alone needs about 50, zooming alone some 20.
MOST_CALLS = 100
# The points of a zoom, and how much narrower the next one is where a parabola fits.
AROUND: FloatArray = np.linspace(-1.0, 1.0, 9)
# ... and how much wider after one that has missed it. The last is a part of the first.
PARABOLA, WIDEN, NARROWEST = 64.0, 8.0, 1e-8


def last_kept(
    function: Callable[[IndexArray, FloatArray], FloatArray], keeps: FloatArray, loses: FloatArray
) -> FloatArray:
    """
    Return the last arguments at which functions are not negative, between two of each.

    Chandrupatla's method, as in `foot.extremes`: inverse quadratic interpolation where the last
    three values promise that it converges, else bisection; where a value is infinite or NaN as
    well.

    Parameters
    ----------
    function : callable
        The values of the functions with these numbers, shape (k,), each at one argument.
    keeps, loses : numpy.ndarray, shape (n,)
        Arguments at which each is not negative, and is.

    """
    every = np.arange(len(keeps))
    # b is the newest, a on the other side of the root, c the one before.
    b, a = loses.copy(), keeps.copy()
    f_b, f_a = function(every, b), np.maximum(function(every, a), 0.0)
    share = np.full(len(keeps), 0.5)
    for _ in range(MOST_CALLS):
        size = np.abs(b - a)
        near = 2.0 * float_info.epsilon * np.maximum(np.abs(a), np.abs(b))
        rows = np.flatnonzero((size > 2.0 * near) & (f_a != 0.0) & (f_b != 0.0))
        if not len(rows):
            break
        nearest = near[rows] / size[rows]
        t = b[rows] + np.clip(share[rows], nearest, 1.0 - nearest) * (a[rows] - b[rows])
        f_t = function(rows, t)
        same = (f_t >= 0.0) == (f_b[rows] >= 0.0)
        c, f_c = np.where(same, b[rows], a[rows]), np.where(same, f_b[rows], f_a[rows])
        a[rows] = np.where(same, a[rows], b[rows])
        f_a[rows] = np.where(same, f_a[rows], f_b[rows])
        b[rows], f_b[rows] = t, f_t
        share[rows] = _share((a[rows], f_a[rows]), (t, f_t), (c, f_c))
    return np.where(f_b >= 0.0, b, a)


def _share(
    side: tuple[FloatArray, FloatArray],
    newest: tuple[FloatArray, FloatArray],
    before: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return where from b (0) to a (1) the root is expected; the middle where that is unsure."""
    (a, f_a), (b, f_b), (c, f_c) = side, newest, before
    with np.errstate(all='ignore'):
        xi, phi = (b - a) / (c - a), (f_b - f_a) / (f_c - f_a)
        converges = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        share = f_b / (f_a - f_b) * f_c / (f_a - f_c)
        share += (c - b) / (a - b) * f_b / (f_c - f_b) * f_a / (f_c - f_a)
    found: FloatArray = np.where(converges & np.isfinite(share), share, 0.5)
    return found


def least_near(
    function: Callable[[IndexArray, FloatArray], FloatArray],
    middle: FloatArray,
    width: float,
    rounding: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """
    Return where functions are least within a width to both sides of a middle, and that least.

    It zooms in at the least of nine points, much closer where the parabola through it and its
    neighbours says where to look, until no more than rounding is to be gained.

    Parameters
    ----------
    function : callable
        The values of the functions with these numbers, each at nine arguments, shape (k, 9); NaN
        where there is none.
    middle : numpy.ndarray, shape (n,)
        Where to look first.
    width : float
        How far to both sides.
    rounding : numpy.ndarray, shape (n,)
        What of the values is rounding.

    """
    at, least = middle.copy(), np.full(len(middle), np.inf)
    middle, widths = middle.copy(), np.full(len(middle), width)
    rows = np.arange(len(middle))
    for _ in range(MOST_CALLS):
        points = middle[rows, None] + widths[rows, None] * AROUND
        values = function(rows, points)
        values[np.isnan(values)] = np.inf
        place, own = values.argmin(axis=1), np.arange(len(rows))
        low, lowest = values[own, place], points[own, place]
        better = low < least[rows]
        at[rows[better]], least[rows[better]] = lowest[better], low[better]
        inside = (place > 0) & (place < len(AROUND) - 1)
        before, after = (values[own, (place + k) % len(AROUND)] for k in (-1, 1))
        gap = widths[rows] * (AROUND[1] - AROUND[0])
        with np.errstate(invalid='ignore', divide='ignore'):
            bend = before - 2.0 * low + after
            shift, gain = (before - after) / (2.0 * bend), (after - before) ** 2 / (8.0 * bend)
            flat = values.max(axis=1) - low <= rounding[rows]
        fits = inside & (bend > 0.0) & np.isfinite(bend)
        middle[rows] = lowest + np.where(fits, shift * gap, 0.0)
        wide = np.minimum(WIDEN * widths[rows], width)
        widths[rows] = np.where(fits, gap / PARABOLA, np.where(inside, gap, wide))
        done = flat | (fits & (gain <= rounding[rows]) & (gap < 1e-5 * width))
        done |= (inside & (gap < NARROWEST * width)) | np.isinf(low)
        rows = rows[~done]
        if not len(rows):
            break
    return at, least
