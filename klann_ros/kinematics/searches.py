"""Bracketed roots and minima of functions of one variable, one at a time or many at once."""

from collections.abc import Callable, Generator
from math import isnan
from sys import float_info

from klann_ros.kinematics.arrays import FloatArray, IndexArray
import numpy as np

# An argument and its value.
Sample = tuple[float, float]
# Of the functions with these numbers at one or more arguments each.
Functions = Callable[[IndexArray, FloatArray], FloatArray]
# Bisection alone needs about 60, zooming alone some 20.
MAX_CALLS = 200
GOLDEN_RATIO = (5.0**0.5 - 1.0) / 2.0
# The points of a zoom, and the factor by which the next one is narrower if a parabola fits.
ZOOM_POINTS: FloatArray = np.linspace(-1.0, 1.0, 9)
# ... and wider after a parabola that has missed the minimum. The last is relative to the first.
PARABOLA_ZOOM, WIDENING, MIN_WIDTH = 64.0, 8.0, 1e-8


def root(function: Callable[[float], float], left: Sample, right: Sample) -> float:
    """
    Return the root of a continuous function, to the last digits of the bracket's ends.

    The values at these are of opposite sign, or 0; an argument where it is NaN counts as a root.
    """
    steps = _chandrupatla(left, right, scale=max(abs(left[0]), abs(right[0])))
    try:
        t = next(steps)
        while not isnan(value := function(t)):
            t = steps.send(value)
    except StopIteration as done:
        found: Sample = min(done.value, key=lambda sample: abs(sample[1]))
        return found[0]
    return t


def last_nonnegative(function: Functions, inside: FloatArray, outside: FloatArray) -> FloatArray:
    """
    Return the last arguments where n functions are not negative, to rounding.

    Each is not negative at its argument in `inside`, and negative, or NaN, in `outside`.
    """
    rows = np.arange(len(inside))
    values = function(rows, outside), np.maximum(function(rows, inside), 0.0)
    samples = (
        zip(arguments.tolist(), own.tolist(), strict=True)
        for arguments, own in zip((inside, outside), values[::-1], strict=True)
    )
    searches = [_chandrupatla(a, b) for a, b in zip(*samples, strict=True)]
    found = np.empty(len(inside))
    pending: dict[int, float] = {}

    def advance(row: int, value: float | None) -> None:
        try:
            pending[row] = searches[row].send(value)  # type: ignore[arg-type]  # None starts it
        except StopIteration as done:
            pending.pop(row, None)
            (b, f_b), (a, _) = done.value
            found[row] = b if f_b >= 0.0 else a

    for row in rows.tolist():
        advance(row, None)
    while pending:
        rows = np.array([*pending])
        values_at = function(rows, np.array([*pending.values()]))
        for row, value in zip(rows.tolist(), values_at.tolist(), strict=True):
            advance(row, value)
    return found


def _chandrupatla(
    left: Sample, right: Sample, scale: float = 0.0
) -> Generator[float, float, tuple[Sample, Sample]]:
    """
    Yield arguments, receive their values, and return the samples that bracket the root.

    Inverse quadratic interpolation where the last three values ensure convergence, else
    bisection; the root stays bracketed. It is exact relative to `scale`, or else to itself: a
    root at 0 has no last digit. (T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm
    for finding the zero of a nonlinear function without using derivatives, Advances in
    Engineering Software 28 (1997) 145.)
    """
    # b is the newest, a on the other side of the root, c the one before.
    (b, f_b), (a, f_a) = right, left
    fraction = 0.5
    for _ in range(MAX_CALLS):
        width = abs(b - a)
        resolution = 2.0 * float_info.epsilon * (scale or max(abs(a), abs(b)))
        if f_a == 0.0 or f_b == 0.0 or width <= 2.0 * resolution:
            break
        nearest = resolution / width
        t = b + min(max(fraction, nearest), 1.0 - nearest) * (a - b)
        f_t = yield t
        if (f_t >= 0.0) == (f_b >= 0.0):
            c, f_c = b, f_b
        else:
            c, f_c = a, f_a
            a, f_a = b, f_b
        b, f_b = t, f_t
        # Where from b (0) to a (1) the root is expected.
        xi, phi = (b - a) / (c - a), (f_b - f_a) / (f_c - f_a)
        if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
            of_c = f_b / (f_c - f_b) * f_a / (f_c - f_a)
            fraction = f_b / (f_a - f_b) * f_c / (f_a - f_c) + (c - b) / (a - b) * of_c
        else:
            fraction = 0.5
    return (b, f_b), (a, f_a)


def peak(function: Callable[[float], float], left: float, right: float) -> float:
    """Return where a function with one peak between two angles is greatest (golden section)."""
    a, b = right - GOLDEN_RATIO * (right - left), left + GOLDEN_RATIO * (right - left)
    at_a, at_b = function(a), function(b)
    while right - left > 1e-9:
        if at_a > at_b:
            right, b, at_b = b, a, at_a
            a = right - GOLDEN_RATIO * (right - left)
            at_a = function(a)
        else:
            left, a, at_a = a, b, at_b
            b = left + GOLDEN_RATIO * (right - left)
            at_b = function(b)
    return (left + right) / 2.0


def minimum_near(
    function: Functions, middle: FloatArray, width: float, rounding: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the arguments and values of the minima of functions, within a width of a middle.

    It zooms in at the least of nine points, more narrowly where a parabola through it and its
    neighbours predicts the minimum, until only rounding is left to gain. The functions return
    values at nine arguments each, shape (k, 9); NaN where there is none. `middle` and `rounding`,
    the round-off of the values, have shape (n,).
    """
    at, least = middle.copy(), np.full(len(middle), np.inf)
    middle, widths = middle.copy(), np.full(len(middle), width)
    rows = np.arange(len(middle))
    for _ in range(MAX_CALLS):
        points = middle[rows, None] + widths[rows, None] * ZOOM_POINTS
        values = function(rows, points)
        values[np.isnan(values)] = np.inf
        place, own = values.argmin(axis=1), np.arange(len(rows))
        low, lowest = values[own, place], points[own, place]
        better = low < least[rows]
        at[rows[better]], least[rows[better]] = lowest[better], low[better]
        inside = (place > 0) & (place < len(ZOOM_POINTS) - 1)
        before, after = (values[own, (place + k) % len(ZOOM_POINTS)] for k in (-1, 1))
        gap = widths[rows] * (ZOOM_POINTS[1] - ZOOM_POINTS[0])
        with np.errstate(invalid='ignore', divide='ignore'):
            bend = before - 2.0 * low + after
            shift, gain = (before - after) / (2.0 * bend), (after - before) ** 2 / (8.0 * bend)
            flat = values.max(axis=1) - low <= rounding[rows]
        fits = inside & (bend > 0.0) & np.isfinite(bend)
        middle[rows] = lowest + np.where(fits, shift * gap, 0.0)
        wide = np.minimum(WIDENING * widths[rows], width)
        widths[rows] = np.where(fits, gap / PARABOLA_ZOOM, np.where(inside, gap, wide))
        done = flat | (fits & (gain <= rounding[rows]) & (gap < 1e-5 * width))
        done |= (inside & (gap < MIN_WIDTH * width)) | np.isinf(low)
        rows = rows[~done]
        if not len(rows):
            break
    return at, least


def parabola_peak(before: FloatArray, own: FloatArray, after: FloatArray) -> FloatArray:
    """Return the peaks of parabolas through three values; the middle one if it is not greatest."""
    with np.errstate(all='ignore'):
        bend = before - 2.0 * own + after
        rise = (after - before) ** 2 / (-8.0 * bend)
    inside = (own >= before) & (own >= after) & (bend < 0.0) & np.isfinite(rise)
    return np.asarray(own + np.where(inside, rise, 0.0), dtype=np.float64)
