"""
The loop equations of a linkage, as its bodies give them.

With u_j = exp(i s_j phi_j), the unit vector of body j (s_j = -1 where its angle phi_j is measured
clockwise), every vector of a linkage is a sum of constants times these: the loops are closed where

    f = W u + c = 0        (complex: the real parts are the x equations, the imaginary ones the y)

and the points are at p = Q u + q. Their derivatives follow from du_j/dphi_j = i s_j u_j. For the
Klann leg f is SEM 104's f1 + i f2 and f3 + i f4, term by term.
"""

from dataclasses import dataclass

from klann_ros.kinematics.errors import GeometryError
import numpy as np
from numpy.typing import NDArray

from .description import Description

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

    """

    w: Complex
    c: Complex
    q_u: Complex
    q: Complex
    closing: tuple[str, ...]


@dataclass(frozen=True)
class _Path:
    """How a point is reached: from a pivot along bars of bodies."""

    start: complex
    bodies: Complex


def loop_equations(description: Description) -> LoopEquations:
    """
    Return the loop equations of a linkage.

    Every point is reached from the pivots over as few bars as can be. A bar that leads to a point
    which has been reached already closes a loop: the path over this bar less the point's own.

    Raises
    ------
    GeometryError
        A body is connected to nothing.

    """
    paths = {
        name: _Path(place, np.zeros(len(description.bodies), dtype=np.complex128))
        for name, place in description.pivots.items()
    }
    rest = [(j, bar) for j, body in enumerate(description.bodies) for bar in body.bars]
    loops: list[tuple[_Path, str]] = []
    while rest:
        reached = set(paths)
        later = []
        for j, bar in rest:
            if bar.start in reached:
                path, point = _along(paths[bar.start], j, bar.vector), bar.end
            elif bar.end in reached:
                path, point = _along(paths[bar.end], j, -bar.vector), bar.start
            else:
                later.append((j, bar))
                continue
            if point in paths:
                loops.append((path, point))
            else:
                paths[point] = path
        if len(later) == len(rest):
            j, bar = later[0]
            msg = (
                f'bar {bar.start}-{bar.end} of body {description.bodies[j].angle} is connected '
                f'to no pivot, not even by other bars'
            )
            raise GeometryError(msg)
        rest = later
    own = [paths[point] for _, point in loops]
    n = len(description.bodies)
    points = [paths[point] for point in description.points]
    return LoopEquations(
        w=np.array([p.bodies - o.bodies for (p, _), o in zip(loops, own, strict=True)]).reshape(
            -1, n
        ),
        c=np.array([p.start - o.start for (p, _), o in zip(loops, own, strict=True)]),
        q_u=np.array([path.bodies for path in points]),
        q=np.array([path.start for path in points]),
        closing=tuple(point for _, point in loops),
    )


def _along(path: _Path, j: int, vector: complex) -> _Path:
    bodies = path.bodies.copy()
    bodies[j] += vector
    return _Path(path.start, bodies)
