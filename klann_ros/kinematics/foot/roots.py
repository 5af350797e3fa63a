"""A root of a function of one variable between two values of opposite sign."""

from collections.abc import Callable
from math import isnan
from sys import float_info

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
