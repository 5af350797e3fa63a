"""
The numbers of a linkage as vectors: its pivots, its bars, and what they add to loops and points.

All of it works on one linkage and on many at once: a number is a float, or an array with one for
each linkage.
"""

from cmath import rect
from collections.abc import Mapping, Sequence
from typing import Any

from klann_ros.kinematics.arrays import ComplexArray
import numpy as np

from .paths import Path
from .structure import FIXED, Structure

# A complex number, or an array of them.
Vector = Any


def vectors(structure: Structure, numbers: Sequence[Any]) -> tuple[list[Vector], list[Vector]]:
    """
    Return the pivots and the bars as vectors x + i y, each bar in the frame of its body [m].

    `numbers` are the structure's dimensions in their order, floats or arrays of shape (n,) [m,
    rad]. A brace that is too short, or too long, for its triangle gives NaN.
    """
    pairs = zip(structure.dimensions, numbers, strict=True)
    given = {(d.kind, d.place): v if d.sense > 0 else -v for d, v in pairs}
    pivots = [
        given.get(('x', place), 0.0) + 1j * given.get(('y', place), 0.0)
        for place in range(len(structure.pivots))
    ]
    bars: list[Vector] = []
    places: dict[tuple[int, str], Vector] = {}
    for number, (body, bar) in enumerate(structure.bars):
        if number in structure.lines:
            # Its length is what the body slides by: see `joints`.
            bars.append(turned(1.0, given.get(('bend', number), 0.0)))
            places[body, bar.end] = 0j
            continue
        length = given['length', number]
        start = places.setdefault((body, bar.start), 0j)
        if bar.brace is None:
            vector = turned(length, given.get(('bend', number), 0.0))
        else:
            other = places[body, bar.brace.start] - start
            side = 1 if bar.brace.side == 'left' else -1
            vector = apex(other, length, given['brace', number], side)
        bars.append(vector)
        places[body, bar.end] = start + vector
    return pivots, bars


def turned(length: Any, angle: Any) -> Vector:
    """Return length e^(i angle)."""
    if isinstance(length, float) and isinstance(angle, float):
        return rect(length, angle)
    return length * np.exp(1j * np.asarray(angle))


def apex(base: Vector, r_p: Any, r_q: Any, side: int) -> Vector:
    """
    Return J - P of a triangle P-J-Q with Q - P and both other sides; NaN where there is none.

    J - P = z (Q - P) with z = 1/2 + w (K + i s r): see `klann_ros.kinematics.batch.program`.
    """
    with np.errstate(invalid='ignore', divide='ignore'):
        d_2 = abs(base) ** 2
        r = np.sqrt(((r_p + r_q) ** 2 - d_2) * (d_2 - (r_p - r_q) ** 2))
        z = 0.5 + ((r_p - r_q) * (r_p + r_q) + 1j * side * r) / (2.0 * d_2)
        found = z * base
    return found if isinstance(found, np.ndarray) else complex(found)


def row(
    structure: Structure, path: Path, pivots: Sequence[Vector], bars: Sequence[Vector]
) -> tuple[dict[int, Vector], Vector]:
    """Return what each body adds to a path, by its number, and what does not move adds [m]."""
    bodies: dict[int, Vector] = {}
    for number, times in path.bars:
        body = structure.carriers[number]
        bodies[body] = bodies.get(body, 0.0) + times * bars[number]
    fixed = bodies.pop(FIXED, 0.0)
    return bodies, sum((times * pivots[place] for place, times in path.pivots), fixed)


def matrix(
    rows: Sequence[tuple[Mapping[int, complex], complex]], bodies: int
) -> tuple[ComplexArray, ComplexArray]:
    """Return rows as a matrix, shape (m, n), and their constants, shape (m,)."""
    w = np.zeros((len(rows), bodies), dtype=np.complex128)
    for k, (terms, _) in enumerate(rows):
        for j, value in terms.items():
            w[k, j] = value
    return w, np.array([constant for _, constant in rows], dtype=np.complex128)
