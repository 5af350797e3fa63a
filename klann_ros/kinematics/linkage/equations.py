"""
The loop equations of a linkage, f = W u + c, and its points, p = Q u + q, with their Jacobian.

The functions take one linkage, or many at once: a number is a float, or an array with one for
each linkage.
"""

from cmath import rect
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.arrays import ComplexArray, FloatArray, plane_vectors, real_rows
from klann_ros.kinematics.errors import GeometryError
import numpy as np

from . import joints
from .blocks import Block, blocks_of
from .dyads import max_vector_length
from .structure import FIXED, Structure
from .topology import Path

# A complex number, or an array of them.
Vector = Any


def moved_numbers(
    structure: Structure, numbers: Sequence[Any], factor: Any, shift: Any
) -> list[Any]:
    """Return the dimensions of linkages turned, scaled and moved: z -> factor z + shift."""
    pivots, _ = link_vectors(structure, numbers)
    moved = []
    for d, number in zip(structure.dimensions, numbers, strict=True):
        if d.is_length:
            moved.append(np.abs(factor) * number)
        elif d.kind in {'x', 'y'}:
            pivot = d.sense * (factor * pivots[d.place] + shift)
            moved.append(np.real(pivot) if d.kind == 'x' else np.imag(pivot))
        elif structure.frames[structure.bars[d.place][0]] == FIXED:
            angle = number + d.sense * np.angle(factor)
            moved.append(angle - TURN * np.round(angle / TURN))
        else:
            moved.append(number)
    return moved


def link_vectors(
    structure: Structure, numbers: Sequence[Any]
) -> tuple[list[Vector], list[Vector]]:
    """
    Return the pivots and the bars as vectors x + i y, each bar in the frame of its body [m].

    `numbers` are the dimensions in their order, floats or arrays of shape (n,) [m, rad]. A brace
    that is too short or too long for its triangle gives NaN.
    """
    signed: dict[tuple[str, int], Any] = {}
    for d, number in zip(structure.dimensions, numbers, strict=True):
        signed[d.kind, d.place] = number if d.sense > 0 else -number
    pivots = []
    for place in range(len(structure.pivots)):
        pivots.append(signed.get(('x', place), 0.0) + 1j * signed.get(('y', place), 0.0))
    bars: list[Vector] = []
    places: dict[tuple[int, str], Vector] = {}
    for number, (body, bar) in enumerate(structure.bars):
        if number in structure.lines:
            # Its length is the sliding distance: see `joints`.
            bars.append(polar(1.0, signed.get(('bend', number), 0.0)))
            places[body, bar.end] = 0j
            continue
        length = signed['length', number]
        start = places.setdefault((body, bar.start), 0j)
        if bar.brace is None:
            vector = polar(length, signed.get(('bend', number), 0.0))
        else:
            base = places[body, bar.brace.start] - start
            side = 1 if bar.brace.side == 'left' else -1
            vector = triangle_apex(base, length, signed['brace', number], side)
        bars.append(vector)
        places[body, bar.end] = start + vector
    return pivots, bars


def body_points(
    structure: Structure, bar_vectors: Sequence[Vector]
) -> dict[tuple[int, str], Vector]:
    """
    Return the positions of each body's points in its frame, by its index and their names [m].

    The origin of a frame is the first point of its body. `bar_vectors` are those of all bars in
    the frames of their bodies.
    """
    positions: dict[tuple[int, str], Vector] = {}
    for index, (body, bar) in enumerate(structure.bars):
        if index in structure.lines:
            # The end of a line is the origin of the body that slides along it.
            positions[body, bar.end] = 0j
        else:
            # A bar starts where one before it ends.
            start = positions.setdefault((body, bar.start), 0j)
            positions[body, bar.end] = start + bar_vectors[index]
    return positions


def polar(length: Any, angle: Any) -> Vector:
    """Return length e^(i angle)."""
    if isinstance(length, float) and isinstance(angle, float):
        return rect(length, angle)
    return length * np.exp(1j * np.asarray(angle))


def triangle_apex(base: Vector, r_p: Any, r_q: Any, side: int) -> Vector:
    """
    Return J - P of a triangle P-J-Q with Q - P and both other sides; NaN where there is none.

    J - P = z (Q - P) with z = 1/2 + w (K + i s r): see `klann_ros.kinematics.batch.program`.
    """
    with np.errstate(invalid='ignore', divide='ignore'):
        d_2 = abs(base) ** 2
        r = np.sqrt(((r_p + r_q) ** 2 - d_2) * (d_2 - (r_p - r_q) ** 2))
        z = 0.5 + ((r_p - r_q) * (r_p + r_q) + 1j * side * r) / (2.0 * d_2)
        apex = z * base
    return apex if isinstance(apex, np.ndarray) else complex(apex)


def path_terms(
    structure: Structure, path: Path, pivots: Sequence[Vector], bars: Sequence[Vector]
) -> tuple[dict[int, Vector], Vector]:
    """Return the coefficients of the bodies along a path, by index, and its constant [m]."""
    bodies: dict[int, Vector] = {}
    for number, times in path.bars:
        body = structure.carriers[number]
        bodies[body] = bodies.get(body, 0.0) + times * bars[number]
    constant = bodies.pop(FIXED, 0.0)
    for place, times in path.pivots:
        constant = constant + times * pivots[place]
    return bodies, constant


def term_matrix(
    rows: Sequence[tuple[Mapping[int, Vector], Vector]], bodies: int, *shape: int
) -> tuple[ComplexArray, ComplexArray]:
    """Return rows of numbers of a shape as a table (m, n, *shape), and constants (m, *shape)."""
    w = np.zeros((len(rows), bodies, *shape), dtype=np.complex128)
    c = np.zeros((len(rows), *shape), dtype=np.complex128)
    for k, (terms, constant) in enumerate(rows):
        c[k] = constant
        for j, coefficient in terms.items():
            w[k, j] = coefficient
    return w, c


NO_TRIANGLE = 'this brace and its bar do not meet'


class LoopEquations:
    """
    The equations of a linkage: f = W u + c of its loops, and p = Q u + q of its points.

    Made of a structure and its dimensions in the structure's order [m, rad]; raises a
    GeometryError for an invalid one, or a triangle of bars that does not close.
    """

    # The assembly mode: the sign (+1 or -1) of each block's sine.
    assembly: tuple[int, ...]

    def __init__(self, structure: Structure, numbers: Sequence[float]) -> None:
        self.structure = structure
        self.numbers = _checked(structure, numbers)
        self.pivots, self.bars = link_vectors(structure, self.numbers)
        for d in structure.dimensions:
            if d.kind == 'brace' and np.isnan(self.bars[d.place]):
                msg = f'{d.name} = {self.dimensions[d.name]:g} m is refused: {NO_TRIANGLE}'
                raise GeometryError(msg)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the angles, the crank's first."""
        return self.structure.angles

    @property
    def dimensions(self) -> dict[str, float]:
        """Return its numbers by name [m, rad]."""
        names = (dimension.name for dimension in self.structure.dimensions)
        return dict(zip(names, self.numbers, strict=True))

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Return the blocks, in the order of their solution."""
        return blocks_of(self.structure, self.rows)

    @property
    def is_dyadic(self) -> bool:
        """Return whether every block is a dyad, so that the geometric method gives the pose."""
        return all(len(rows) == 1 for rows in self.structure.paths.rows)

    @property
    def two_circles(self) -> bool:
        """Return whether every block is a dyad that turns, which two circles place."""
        return self.is_dyadic and not self.structure.slides

    @cached_property
    def rows(self) -> tuple[tuple[dict[int, complex], complex], ...]:
        """Return the coefficients of the bodies and the constant of each loop [m]."""
        return self._terms(self.structure.paths.loops)

    @cached_property
    def point_rows(self) -> tuple[tuple[dict[int, complex], complex], ...]:
        """Return the coefficients of the bodies and the constant of each point [m]."""
        return self._terms(self.structure.paths.points)

    def _terms(self, paths: Sequence[Path]) -> tuple[tuple[dict[int, complex], complex], ...]:
        return tuple(path_terms(self.structure, p, self.pivots, self.bars) for p in paths)

    @property
    def foot(self) -> int:
        """Return the index of the foot among the points."""
        return self.structure.points.index(self.structure.foot)

    @cached_property
    def size(self) -> float:
        """Return its longest vector [m], the scale of sliding distances."""
        return float(max_vector_length(self.structure, self.rows))

    # Poses.

    def line(self, u: joints.Vectors, j: int) -> Any:
        """Return the unit vector along the line that a body slides along."""
        structure = self.structure
        return self.bars[structure.line_of[j]] * joints.carrier_rotation(structure, u, j)

    def coordinate_differences(self, x: Sequence[float], y: Sequence[float]) -> list[float]:
        """Return the differences of two poses' other coordinates [rad]; lengths by its size."""
        differences = []
        for n, body in enumerate(self.structure.bodies[1:]):
            difference = x[n] - y[n]
            differences.append(difference / self.size if body.slides else wrap(difference))
        return differences

    def wrapped(self, x: FloatArray) -> list[float]:
        """Return a pose's other coordinates, its angles in (-pi, pi]."""
        bodies = zip(self.structure.bodies[1:], x.tolist(), strict=True)
        return [x if body.slides else wrap(x) for body, x in bodies]

    # The equations as matrices.

    @cached_property
    def equations(self) -> tuple[ComplexArray, ComplexArray]:
        """Return W, shape (m, n), and c, shape (m,), of f = W u + c [m]."""
        return term_matrix(self.rows, len(self.structure.bodies))

    @cached_property
    def point_equations(self) -> tuple[ComplexArray, ComplexArray]:
        """Return Q, shape (p, n), and q, shape (p,), of p = Q u + q [m]."""
        return term_matrix(self.point_rows, len(self.structure.bodies))

    def f(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return f at a crank angle and the other coordinates, shape (n - 1,) [m]: see `Leg.f`."""
        w, c = self.equations
        return real_rows(w @ self.vectors(alpha, x) + c)

    def phi(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian df/dx, shape (n - 1, n - 1) [m/rad]; parameters as in `f`."""
        return self._jacobian(alpha, x)[:, 1:]

    def f_alpha(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return df/dalpha, shape (n - 1,) [m/rad]; parameters as in `f`."""
        return np.asarray(self._jacobian(alpha, x)[:, 0], dtype=np.float64)

    def points(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return the points, shape (p, 2), in the order of the structure's [m]."""
        q_u, q = self.point_equations
        return plane_vectors(q_u @ self.vectors(alpha, x) + q)

    def vectors(self, alpha: Any, x: Any) -> ComplexArray:
        """Return u_j of every body, shape (n,): see `joints`."""
        if self.structure.slides:
            return np.array(joints.body_vectors(self.structure, [alpha, *x]))
        u: ComplexArray = np.exp(self._i_s * np.array([alpha, *x]))
        return u

    @cached_property
    def _i_s(self) -> ComplexArray:
        """Return i s_j of every body, for linkages in which nothing slides: most of them."""
        return 1j * np.array(self.structure.senses)

    def _jacobian(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        u = self.vectors(alpha, x)
        w, _ = self.equations
        if self.structure.slides:
            return real_rows(w @ joints.vector_jacobian(self.structure, u))
        return real_rows(w * (self._i_s * u))


def _checked(structure: Structure, numbers: Sequence[float]) -> tuple[float, ...]:
    """Return the numbers as floats, if they are numbers of a linkage."""
    checked = []
    for dimension, number in zip(structure.dimensions, numbers, strict=True):
        # Nearly every number is one that nothing is wrong with.
        largest = TURN if dimension.kind == 'bend' else validation.MAX_MAGNITUDE
        if type(number) is float and validation.MIN_MAGNITUDE <= number <= largest:
            checked.append(number)
            continue
        finite = validation.finite_number(dimension.name, number)
        if dimension.is_length:
            validation.check_length(dimension.name, finite)
        if dimension.unit == 'm':
            validation.check_magnitude(dimension.name, finite)
        else:
            validation.check_bend(dimension.name, finite)
        checked.append(finite)
    return tuple(checked)
