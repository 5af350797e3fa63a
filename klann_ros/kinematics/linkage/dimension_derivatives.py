"""
Derivatives of a linkage's vectors by its dimensions: lengths, braces, bends and pivots.

Loops and points are sums of bars and pivots, f = W u + c and p = Q u + q, and W, c, Q and q are
linear in these. So with z of a bar and its derivative dz by a dimension, df at fixed coordinates
is the same sum with dz for z, and the implicit function theorem gives the rest,

    Phi dx = -df,    dp = (dQ) u + dq + Q du:

a linear step like that of the velocity. A length changes its bar by dz = z / |z|, a bend by i z.
Two sides r_p = |z| and r_q = |z - b| of a triangle with the base b, r_q being a brace, are kept by

    z . dz = r_p dr_p,    (z - b) . (dz - db) = r_q dr_q.
"""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics.arrays import ComplexArray
import numpy as np

from .equations import body_points
from .structure import Dimension, Structure


def moved_bars(structure: Structure, dimension: Dimension) -> tuple[int, ...]:
    """Return the bars that a dimension changes in their body's frame: its own, and braced ones."""
    if dimension.kind in ('x', 'y'):
        return ()
    body, bar = structure.bars[dimension.place]
    moved, ends = [dimension.place], {bar.end}
    for number, (other, later) in enumerate(structure.bars):
        if other != body or number <= dimension.place:
            continue
        braced = later.brace is not None and not ends.isdisjoint((later.start, later.brace.start))
        if braced:
            moved.append(number)
        if braced or later.start in ends:
            ends.add(later.end)
    return tuple(moved)


def vector_derivatives(
    structure: Structure, bars: Sequence[Any]
) -> tuple[list[ComplexArray], list[ComplexArray]]:
    """Return the derivatives of pivots and bars by all dimensions, along a first axis."""
    columns = zip(
        *(
            (*_pivot_derivatives(structure, d), *bar_derivatives(structure, bars, d))
            for d in structure.dimensions
        ),
        strict=True,
    )
    zero = np.zeros(np.shape(bars[0]), dtype=np.complex128)
    found = [np.array([part + zero for part in column]) for column in columns]
    count = len(structure.pivots)
    return found[:count], found[count:]


def _pivot_derivatives(structure: Structure, dimension: Dimension) -> list[complex]:
    moved = [0j] * len(structure.pivots)
    if dimension.kind in ('x', 'y'):
        moved[dimension.place] = dimension.sense * (1.0 if dimension.kind == 'x' else 1j)
    return moved


def bar_derivatives(structure: Structure, bars: Sequence[Any], dimension: Dimension) -> list[Any]:
    """Return the derivatives dz of the bars, given the bars z: numbers, or arrays [m]."""
    moved: list[Any] = [0.0] * len(bars)
    body = structure.bars[dimension.place][0]
    for number in moved_bars(structure, dimension):
        z = bars[number]
        bar = structure.bars[number][1]
        own = number == dimension.place
        if bar.brace is None:
            moved[number] = z / abs(z) if dimension.kind == 'length' else dimension.sense * 1j * z
            continue
        places, changed = body_points(structure, bars), body_points(structure, moved)
        z_q = z - (places[body, bar.brace.start] - places[body, bar.start])
        d_base = changed[body, bar.brace.start] - changed[body, bar.start]
        p = abs(z) if own and dimension.kind == 'length' else 0.0
        q = np.real(np.conj(z_q) * d_base)
        if own and dimension.kind == 'brace':
            q = q + abs(z_q)
        moved[number] = 1j * (q * z - p * z_q) / np.imag(np.conj(z) * z_q)
    return moved
