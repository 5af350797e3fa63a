"""
The least clearance of both dyads over a whole turn of the crank, for many legs at once.

A leg turns fully where it is not negative. Legs are rows of the numbers in NUMBERS, in that order,
which need not be legs that close: so a number can be changed until its leg turns no more.
"""

import numpy as np
from numpy.typing import NDArray

from .geometry import NUMBERS

# Crank angles of the search, an even number; then each round looks 8 times closer at the least.
SAMPLES, ZOOM, ROUNDS = 360, 17, 8

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def turn_clearances(legs: Array, assembly: tuple[int, int]) -> Array:
    """
    Return by how much each dyad of each leg stays inside its reach over the whole turn, at least.

    |BD| runs from | |AB| - |AD| | to |AB| + |AD|, so dyad 1 has its least clearance in closed
    form; that of dyad 2 is sampled over the turn, and its least refined to rounding.

    Parameters
    ----------
    legs : numpy.ndarray, shape (n, 13)
        The legs' NUMBERS [m, rad].
    assembly : tuple of int
        The assembly of all of them.

    Returns
    -------
    numpy.ndarray, shape (n, 2)
        Least clearance of dyads 1 and 2 [m]; negative where it loses the full turn. Where the
        first is negative the second means nothing.

    """
    return np.stack([first_clearances(legs), _least_second(legs, assembly[0])], axis=1)


def first_clearances(legs: Array) -> Array:
    """Return the least clearance of dyad 1 of each leg over the turn, shape (n,) [m]."""
    l_ab, l_bc, l_dc, *_ = legs.T
    ad = np.hypot(legs[:, NUMBERS.index('x_d')], legs[:, NUMBERS.index('y_a')])
    first: Array = np.minimum(l_bc + l_dc - (l_ab + ad), abs(l_ab - ad) - abs(l_bc - l_dc))
    return first


def _least_second(legs: Array, sign: int) -> Array:
    # From the direction of AD on: so the angles at which dyad 1 is nearest to its limits, where
    # the second's clearance is steepest, are among the samples.
    start = np.arctan2(-legs[:, NUMBERS.index('y_a')], legs[:, NUMBERS.index('x_d')])[:, None]
    step = 2.0 * np.pi / SAMPLES
    values = _second(legs, start + step * np.arange(SAMPLES), sign)
    middle = start + step * _lowest(values)[:, None]
    least: Array = values.min(axis=1)
    around = np.linspace(-1.0, 1.0, ZOOM)
    for _ in range(ROUNDS):
        angles = middle + step * around
        values = _second(legs, angles, sign)
        least = np.minimum(least, values.min(axis=1))
        middle = np.take_along_axis(angles, values.argmin(axis=1)[:, None], axis=1)
        step *= around[1] - around[0]
    return least


def _lowest(values: Array) -> Indices:
    """Return beside which sample of a turn the least is, by the parabola through each three."""
    before, after = np.roll(values, 1, axis=1), np.roll(values, -1, axis=1)
    bend = before - 2.0 * values + after
    dips = (values <= before) & (values <= after) & (bend > 0.0)
    deeper = (after - before) ** 2 / (8.0 * np.where(dips, bend, np.inf))
    lowest: Indices = (values - deeper).argmin(axis=1)
    return lowest


def _second(legs: Array, alphas: Array, sign: int) -> Array:
    """Return the clearance of dyad 2, shape (n, k), at crank angles of that shape."""
    l_ab, l_bc, l_dc, l_cg, l_ef, l_fg, _, x_d, y_a, x_e, y_e, bend, _ = legs.T[:, :, None]
    # C from B and D, as `dyad.joint` has it; dyad 1 closes, but for rounding.
    b_x, b_y = l_ab * np.cos(alphas), y_a + l_ab * np.sin(alphas)
    u, v = x_d - b_x, -b_y
    d = np.hypot(u, v)
    heron = (l_bc + l_dc - d) * (d - (l_bc - l_dc)) * (d + (l_bc - l_dc)) * (d + l_bc + l_dc)
    with np.errstate(divide='ignore', invalid='ignore'):
        along = (d * d + (l_bc - l_dc) * (l_bc + l_dc)) / (2.0 * d * d)
        across = sign * np.sqrt(np.maximum(heron, 0.0)) / (2.0 * d * d)
    bc_x, bc_y = along * u - across * v, along * v + across * u
    # G: C and the bent end of B-C-G.
    c, s = l_cg / l_bc * np.cos(bend), l_cg / l_bc * np.sin(bend)
    eg_x, eg_y = b_x + bc_x + c * bc_x - s * bc_y - x_e, b_y + bc_y + s * bc_x + c * bc_y - y_e
    eg = np.hypot(eg_x, eg_y)
    clearance: Array = np.minimum(l_ef + l_fg - eg, eg - abs(l_ef - l_fg))
    # Where B and D coincide nothing closes.
    return np.where(d > 0.0, clearance, -np.finfo(float).tiny)
