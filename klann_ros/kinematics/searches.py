"""Bracketed roots and minima of functions of one variable, one at a time or many at once."""

from collections.abc import Callable, Generator
from math import isnan
from sys import float_info

from klann_ros.kinematics.arrays import FloatArray, IndexArray
import numpy as np

# An argument and the function there.
Sample = tuple[float, float]
# Evaluates the functions with these indices, each at one argument or more.
Functions = Callable[[IndexArray, FloatArray], FloatArray]
# Bisection alone needs about 60, zooming alone some 20.
MAX_CALLS = 200
GOLDEN_RATIO = (5.0**0.5 - 1.0) / 2.0
# The points of a zoom, and the factor by which the next one is narrower if a parabola fits.
ZOOM_POINTS: FloatArray = np.linspace(-1.0, 1.0, 9)
PARABOLA_ZOOM = 64.0
# The factor by which a zoom is wider after a parabola that has missed the minimum.
WIDENING = 8.0
# The narrowest zoom, relative to the first.
MIN_WIDTH = 1e-8


def root(function: Callable[[float], float], left: Sample, right: Sample) -> float:
    """
    Return the root of a continuous function, to the last digits of the bracket's ends.

    The function is of opposite sign at these, or 0; an argument where it is NaN counts as a root.
    """
    steps = _chandrupatla(left, right, scale=max(abs(left[0]), abs(right[0])))
    try:
        t = next(steps)
        while not isnan(function_of_t := function(t)):
            t = steps.send(function_of_t)
    except StopIteration as done:
        nearest: Sample = min(done.value, key=lambda sample: abs(sample[1]))
        return nearest[0]
    return t


def last_nonnegative(function: Functions, inside: FloatArray, outside: FloatArray) -> FloatArray:
    """
    Return the last arguments where n functions are not negative, to rounding.

    Each is not negative at its argument in `inside`, and negative, or NaN, in `outside`.
    """
    indices = np.arange(len(inside))
    negative = function(indices, outside)
    positive = np.maximum(function(indices, inside), 0.0)
    inside_samples = zip(inside.tolist(), positive.tolist(), strict=True)
    outside_samples = zip(outside.tolist(), negative.tolist(), strict=True)
    searches = [*map(_chandrupatla, inside_samples, outside_samples)]
    last_arguments = np.empty(len(inside))
    # The next argument of each search that has not ended, by the index of its function.
    pending: dict[int, float] = {}

    def advance(index: int, sample: float | None) -> None:
        try:
            pending[index] = searches[index].send(sample)  # type: ignore[arg-type]  # None starts
        except StopIteration as done:
            pending.pop(index, None)
            (b, f_b), (a, _) = done.value
            last_arguments[index] = b if f_b >= 0.0 else a

    for index in indices.tolist():
        advance(index, None)
    while pending:
        indices = np.array([*pending])
        samples = function(indices, np.array([*pending.values()]))
        for index, sample in zip(indices.tolist(), samples.tolist(), strict=True):
            advance(index, sample)
    return last_arguments


def _chandrupatla(
    left: Sample, right: Sample, scale: float = 0.0
) -> Generator[float, float, tuple[Sample, Sample]]:
    """
    Yield arguments, receive the function there, and return the samples that bracket the root.

    Inverse quadratic interpolation where the last three samples ensure convergence, else
    bisection; the root stays bracketed. It ends at a bracket of four roundings of `scale`, by
    default of the larger argument, which a root at 0 makes ever smaller. (T. R. Chandrupatla, A
    new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function without
    using derivatives, Advances in Engineering Software 28 (1997) 145.)
    """
    # b is the newest, a on the other side of the root, c the one before.
    b, f_b = right
    a, f_a = left
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
        xi = (b - a) / (c - a)
        phi = (f_b - f_a) / (f_c - f_a)
        # The expected place of the root from b (0) to a (1).
        fraction = 0.5
        if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
            weight_of_c = f_b / (f_c - f_b) * f_a / (f_c - f_a)
            fraction = f_b / (f_a - f_b) * f_c / (f_a - f_c) + (c - b) / (a - b) * weight_of_c
    return (b, f_b), (a, f_a)


def peak(function: Callable[[float], float], left: float, right: float) -> float:
    """Return the peak of a function that has one between two angles (golden section)."""
    a = right - GOLDEN_RATIO * (right - left)
    b = left + GOLDEN_RATIO * (right - left)
    f_a = function(a)
    f_b = function(b)
    while right - left > 1e-9:
        if f_a > f_b:
            right, b, f_b = b, a, f_a
            a = right - GOLDEN_RATIO * (right - left)
            f_a = function(a)
        else:
            left, a, f_a = a, b, f_b
            b = left + GOLDEN_RATIO * (right - left)
            f_b = function(b)
    return (left + right) / 2.0


def minimum_near(
    function: Functions, middle: FloatArray, width: float, rounding: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the arguments and values of the minima of functions, within a width of a middle.

    It zooms in at the lowest of nine points, more narrowly where a parabola through it and its
    neighbours predicts the minimum, until only rounding is left to gain. The functions return
    samples at nine arguments each, shape (k, 9); NaN where there is none. `middle` and `rounding`,
    the round-off of the samples, have shape (n,).
    """
    arguments = middle.copy()
    minima = np.full(len(middle), np.inf)
    middles = middle.copy()
    widths = np.full(len(middle), width)
    # The functions whose search has not ended.
    indices = np.arange(len(middle))
    for _ in range(MAX_CALLS):
        points = middles[indices, None] + widths[indices, None] * ZOOM_POINTS
        samples = function(indices, points)
        samples[np.isnan(samples)] = np.inf
        rows = np.arange(len(indices))
        lowest = samples.argmin(axis=1)
        low = samples[rows, lowest]
        low_points = points[rows, lowest]
        is_better = low < minima[indices]
        arguments[indices[is_better]] = low_points[is_better]
        minima[indices[is_better]] = low[is_better]
        is_inside = (lowest > 0) & (lowest < len(ZOOM_POINTS) - 1)
        left = samples[rows, (lowest - 1) % len(ZOOM_POINTS)]
        right = samples[rows, (lowest + 1) % len(ZOOM_POINTS)]
        gap = widths[indices] * (ZOOM_POINTS[1] - ZOOM_POINTS[0])
        with np.errstate(invalid='ignore', divide='ignore'):
            bend = left - 2.0 * low + right
            shift = (left - right) / (2.0 * bend)
            gain = (right - left) ** 2 / (8.0 * bend)
            is_flat = samples.max(axis=1) - low <= rounding[indices]
        fits = is_inside & (bend > 0.0) & np.isfinite(bend)
        middles[indices] = low_points + np.where(fits, shift * gap, 0.0)
        wider = np.minimum(WIDENING * widths[indices], width)
        widths[indices] = np.where(fits, gap / PARABOLA_ZOOM, np.where(is_inside, gap, wider))
        is_done = is_flat | (fits & (gain <= rounding[indices]) & (gap < 1e-5 * width))
        is_done |= (is_inside & (gap < MIN_WIDTH * width)) | np.isinf(low)
        indices = indices[~is_done]
        if not len(indices):
            break
    return arguments, minima


def parabola_peak(left: FloatArray, middle: FloatArray, right: FloatArray) -> FloatArray:
    """Return the peaks of parabolas through three samples; the middle one if it is no peak."""
    with np.errstate(all='ignore'):
        bend = left - 2.0 * middle + right
        rise = (right - left) ** 2 / (-8.0 * bend)
    is_peak = (middle >= left) & (middle >= right) & (bend < 0.0) & np.isfinite(rise)
    return np.asarray(middle + np.where(is_peak, rise, 0.0), dtype=np.float64)
