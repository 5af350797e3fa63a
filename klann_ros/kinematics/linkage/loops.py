"""
The loop equations of a linkage, as its bodies give them.

With u_j = exp(i s_j phi_j), the unit vector of body j (s_j = -1 where its angle phi_j is measured
clockwise), every vector of a linkage is a sum of constants times these: the loops are closed where

    f = W u + c = 0        (complex: the real parts are the x equations, the imaginary ones the y)

and the points are at p = Q u + q. Their derivatives follow from du_j/dphi_j = i s_j u_j. For the
Klann leg f is SEM 104's f1 + i f2 and f3 + i f4, term by term.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from sys import float_info

import numpy as np
from numpy.typing import NDArray

from .decomposition import Group
from .description import Bar, Description

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class LoopEquations:
    """
    The loop equations of a linkage with n bodies, m loops and p points.

    Attributes
    ----------
    w : numpy.ndarray, shape (m, n), complex
        W: what each body adds to each loop [m].
    c : numpy.ndarray, shape (m,), complex
        The pivots' part in each loop [m].
    q_u : numpy.ndarray, shape (p, n), complex
        Q: what each body adds to each point [m].
    q : numpy.ndarray, shape (p,), complex
        The pivots' part in each point [m].
    closing : tuple of str
        The point at which each loop closes.
    rows : tuple of tuple of int
        Which loops belong to each group of bodies.

    """

    w: Complex
    c: Complex
    q_u: Complex
    q: Complex
    closing: tuple[str, ...]
    rows: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class _Path:
    """How a point is reached: from a pivot along bars of bodies."""

    start: complex
    bodies: Complex
    bars: int


def loop_equations(description: Description, groups: Sequence[Group]) -> LoopEquations:
    """
    Return the loop equations of a linkage.

    Every point is reached from the pivots along bars, group by group, and in a group over as few
    bars as can be. A bar that leads to a point which has been reached already closes a loop: the
    path over this bar less the point's own.

    Parameters
    ----------
    description : Description
        The linkage.
    groups : sequence of tuple of int
        The groups of bodies in the order in which they are placed, without the crank.

    """
    n = len(description.bodies)
    paths = {
        name: _Path(place, np.zeros(n, dtype=np.complex128), 0)
        for name, place in description.pivots.items()
    }
    _grow(description, (0,), paths)
    closing = [_grow(description, group, paths) for group in groups]
    loops = [(path, point) for closed in closing for path, point in closed]
    points = [paths[point] for point in description.points]
    w = np.array([path.bodies - paths[point].bodies for path, point in loops]).reshape(-1, n)
    # A body there and back again leaves rounding, and no unknown.
    w[np.abs(w) <= 8.0 * float_info.epsilon * np.abs(w).max(initial=0.0)] = 0.0
    return LoopEquations(
        w=w,
        c=np.array([path.start - paths[point].start for path, point in loops]),
        q_u=np.array([path.bodies for path in points]),
        q=np.array([path.start for path in points]),
        closing=tuple(point for _, point in loops),
        rows=_rows([len(closed) for closed in closing]),
    )


def _grow(
    description: Description, group: Group, paths: dict[str, _Path]
) -> list[tuple[_Path, str]]:
    """Reach the points of a group; return the paths that close loops, and at which points."""
    rest = [(j, bar) for j in group for bar in description.bodies[j].bars]
    loops = []
    while rest:
        reached = [(j, bar) for j, bar in rest if bar.start in paths or bar.end in paths]
        j, bar = min(reached, key=lambda item: _bars_away(item[1], paths))
        rest.remove((j, bar))
        if bar.start in paths:
            path, point = _along(paths[bar.start], j, bar.vector), bar.end
        else:
            path, point = _along(paths[bar.end], j, -bar.vector), bar.start
        if point in paths:
            loops.append((path, point))
        else:
            paths[point] = path
    return loops


def _bars_away(bar: Bar, paths: Mapping[str, _Path]) -> int:
    return paths[bar.start if bar.start in paths else bar.end].bars


def _rows(counts: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return the rows of each group, which follow one another."""
    ends = list(accumulate(counts))
    return tuple(tuple(range(end - count, end)) for count, end in zip(counts, ends, strict=True))


def _along(path: _Path, j: int, vector: complex) -> _Path:
    bodies = path.bodies.copy()
    bodies[j] += vector
    return _Path(path.start, bodies, path.bars + 1)
