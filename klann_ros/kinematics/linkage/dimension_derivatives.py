"""
Derivatives of a linkage's vectors by its dimensions: lengths, braces, bends and pivots.

Loops and points are sums of bars and pivots, f = W u + c and p = Q u + q, and W, c, Q and q are
linear in these. So with z of a bar and its derivative dz by a dimension, df at fixed coordinates
is the same sum with dz for z, and the implicit function theorem gives the rest,

    Phi dx = -df,    dp = (dQ) u + dq + Q du:

a linear step like the velocity's. A length changes its bar by dz = z / |z|, a bend by i z.
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
    changed_bars = [dimension.place]
    ends = {bar.end}
    for number, (later_body, later) in enumerate(structure.bars):
        if later_body != body or number <= dimension.place:
            continue
        braced = later.brace is not None and not ends.isdisjoint((later.start, later.brace.start))
        if braced:
            changed_bars.append(number)
        if braced or later.start in ends:
            ends.add(later.end)
    return tuple(changed_bars)


def vector_derivatives(
    structure: Structure, bars: Sequence[Any], dimensions: Sequence[Dimension]
) -> tuple[ComplexArray, ComplexArray]:
    """
    Return the derivatives of the pivots and of the bars by dimensions, along their second axis.

    Given the bars z: numbers, or arrays of some shapes that broadcast [m].
    """
    shape = np.broadcast_shapes(*map(np.shape, bars))
    count = len(dimensions)
    pivot_shape = len(structure.pivots), count, *[1] * len(shape)
    pivot_changes = np.zeros(pivot_shape, dtype=np.complex128)
    bar_changes = np.zeros((len(bars), count, *shape), dtype=np.complex128)
    for n, dimension in enumerate(dimensions):
        if dimension.kind in ('x', 'y'):
            unit = 1.0 if dimension.kind == 'x' else 1j
            pivot_changes[dimension.place, n] = dimension.sense * unit
        for number in moved_bars(structure, dimension):
            z = bars[number]
            body, bar = structure.bars[number]
            is_of_bar = number == dimension.place
            if bar.brace is None:
                is_length = dimension.kind == 'length'
                bar_changes[number, n] = z / abs(z) if is_length else dimension.sense * 1j * z
                continue
            points = body_points(structure, bars)
            changes = body_points(structure, [*bar_changes[:, n]])
            z_q = z - (points[body, bar.brace.start] - points[body, bar.start])
            d_base = changes[body, bar.brace.start] - changes[body, bar.start]
            p = abs(z) if is_of_bar and dimension.kind == 'length' else 0.0
            q = np.real(np.conj(z_q) * d_base)
            if is_of_bar and dimension.kind == 'brace':
                q = q + abs(z_q)
            bar_changes[number, n] = 1j * (q * z - p * z_q) / np.imag(np.conj(z) * z_q)
    return pivot_changes, bar_changes
