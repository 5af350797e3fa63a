"""
Blocks of a linkage, solved one after the other: dyads, and coupled loops.

Position, velocity and acceleration all come down to one linear step: by which turns d of its
bodies does a block open its loops by a given -r,

    sum over its bodies of W du = -r,    with du of its bodies by d: see `joints`.

The determinant of that step over the product of the columns' lengths is the sine of the angle
between the links of a dyad, and stands for it where loops are coupled.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

from klann_ros.kinematics.arrays import ComplexArray, FloatArray, real_rows
from klann_ros.kinematics.errors import UnreachableError
import numpy as np

from .dyads import cross, Dyad, dyad_solver, DyadSolver, max_vector_length, RELATIVE_ROUNDING
from .joints import Closing, jacobian_column, vector_sum, Vectors
from .structure import Structure

# Coefficients of the bodies; arrays for many linkages.
Terms = Mapping[int, Any]


@dataclass(frozen=True, eq=False)
class Block:
    """Loops that are solved together: one of a dyad, several where they are coupled."""

    # The block's number in the linkage, from 1.
    number: int
    # The coefficients of the bodies, and the constant, of each loop [m].
    rows: tuple[tuple[Terms, complex], ...]
    # The bodies that it places.
    unknowns: tuple[int, ...]
    # The structure of the linkage.
    structure: Structure
    # Names of the two ends and the two links of a dyad.
    names: tuple[str, str, str, str]
    # Whether a dyad's transmission angle is measured outside of its joint.
    outside: bool = False

    @property
    def is_dyad(self) -> bool:
        """Return whether it is one loop of two bodies that are placed without iteration."""
        return len(self.rows) == 1

    @property
    def is_driven(self) -> bool:
        """Return whether it is a dyad of two links whose ends the crank alone moves."""
        return self.is_dyad and not self.slides and {0, *self.unknowns} == self.rows[0][0].keys()

    @property
    def four_bar_lengths(self) -> tuple[Any, Any, Any, Any]:
        """Return the ground, crank and links of a dyad that the crank alone drives [m]."""
        terms, constant = self.rows[0]
        a, b = self.unknowns
        return abs(constant), abs(terms[0]), abs(terms[a]), abs(terms[b])

    @property
    def driven_clearances(self) -> tuple[Any, Any]:
        """Return the smallest clearances of such a dyad: to folded, and to stretched [m]."""
        ground, crank, link_a, link_b = self.four_bar_lengths
        folded = abs(crank - ground) - abs(link_a - link_b)
        return folded, link_a + link_b - (crank + ground)

    @cached_property
    def slides(self) -> bool:
        """Return whether any of its bodies slides."""
        return self.structure.slides and self.structure.slides_any(self.unknowns)

    @property
    def two_branches(self) -> bool:
        """Return whether it has two assembly modes; with a single one its sign is +1."""
        return self._dyad is None or self._dyad.two_branches

    @property
    def sense(self) -> int:
        """Return the product of its angles' senses: their sign convention is no assembly mode."""
        return self.structure.turning_sense(self.unknowns)

    @cached_property
    def _dyad(self) -> DyadSolver | None:
        """Return the solver of a dyad; None where loops are coupled."""
        if len(self.rows) > 1:
            return None
        a, b = self.unknowns
        return dyad_solver(Dyad(self.structure, (a, b), *self.rows[0]))

    @property
    def dyad_solver(self) -> DyadSolver:
        """Return the solver of a dyad, its geometric method; see `dyads`."""
        if self._dyad is None:
            raise AssertionError('coupled loops are no dyad')
        return self._dyad

    @cached_property
    def rounding(self) -> Any:
        """Return the rounding of its loops [m]."""
        return RELATIVE_ROUNDING * max_vector_length(self.structure, self.rows)

    @cached_property
    def scale(self) -> float:
        """Return the ratio of its determinant to its sine; of two circles r_a r_b."""
        if self._dyad is not None:
            return self._dyad.scale
        lengths = np.zeros((len(self.rows), len(self.unknowns)))
        for k, (terms, _) in enumerate(self.rows):
            for n, j in enumerate(self.unknowns):
                lengths[k, n] = abs(terms.get(j, 0.0))
        # Rows first: a small loop would make all of it look singular.
        longest = lengths.max(axis=1)
        columns = np.linalg.norm(lengths / longest[:, None], axis=0)
        return float(np.prod(longest**2) * np.prod(columns))

    @cached_property
    def rounding_of_sine(self) -> Any:
        """Return the rounding of the sine near the middle of the reach."""
        if self._dyad is not None:
            return self.rounding / self._dyad.min_length
        longest = 0.0
        for terms, _ in self.rows:
            for j in terms.keys() & self.unknowns:
                longest = max(longest, abs(terms[j]))
        return self.rounding / longest

    @property
    def singular_sine(self) -> Any:
        """
        Return the smallest sine above rounding at any pose: below it no velocity is known.

        Near the reach of a dyad the sine's square is proportional to the distance from it.
        """
        return self.rounding_of_sine**0.5

    # The geometric method of a dyad.

    def closure_vector(self, u: Vectors) -> Any:
        """Return a dyad's W_a u_a + W_b u_b as the other bodies require it [m]."""
        _, constant = self.rows[0]
        if not self._placed_terms:
            # A dyad that stands still does so at each of many poses.
            constant = constant + 0.0 * u[0]
        return -vector_sum(self._placed_terms, u, constant)

    @cached_property
    def _placed_terms(self) -> Terms:
        """Return the coefficients of a dyad's loop but for its own two bodies [m]."""
        placed_terms = dict(self.rows[0][0])
        for j in self.unknowns:
            placed_terms.pop(j, None)
        return placed_terms

    def place(self, u: Vectors, alpha: float, sign: int) -> tuple[complex, complex]:
        """
        Return the vectors of a dyad's two bodies by the geometric method.

        Where they miss each other by no more than rounding the links are in line: a change-point
        linkage, such as a parallelogram, passes such poses. An UnreachableError if they do not
        meet, or everywhere.
        """
        closure = self.closure_vector(u)
        solver = self.dyad_solver
        u_a, u_b = solver.place(u, closure, sign)
        if u_a != u_a or u_b != u_b:  # noqa: PLR0124 - NaN
            shortfall = max(0.0, -float(solver.clearance(closure, u)))
            is_too_far = bool(solver.is_too_far(closure))
            unit = self.structure.unit
            raise UnreachableError(alpha, self.number, shortfall, is_too_far, self.names, unit)
        return complex(u_a), complex(u_b)

    # Figures of a pose, given the vectors of all bodies; or of many, given arrays of them.

    def jacobian(self, u: Any) -> Any:
        """Return its part of Phi, shape (..., 2 k, 2 k) [m/rad]: of each loop x, then y."""
        rows = []
        for terms, _ in self.rows:
            columns = [jacobian_column(self.structure, terms, u, i) for i in self.unknowns]
            rows += [np.real(columns), np.imag(columns)]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    def sine(self, u: Any) -> Any:
        """Return the determinant over `scale`, in [-1, 1]; its sign is the assembly."""
        if self._dyad is None:
            return np.linalg.det(self.jacobian(u)) / self.scale
        if self.slides:
            p, q = self._dyad.dyad.jacobian_columns(u)
            sine = self.sense * cross(p, q) / self._dyad.column_lengths(self.closure_vector(u))
            return sine if self.two_branches else abs(sine)
        p, q = self.links(u)
        return (p.imag * q.real - p.real * q.imag) / self.scale

    def links(self, u: Any) -> tuple[Any, Any]:
        """Return W_a u_a, from a dyad's near end to its joint, and W_b u_b, on to its far end."""
        terms, _ = self.rows[0]
        a, b = self.unknowns
        return terms[a] * u[a], terms[b] * u[b]

    def transmission_angle(self, u: Any) -> Any:
        """
        Return the angle between a dyad's links; of coupled loops asin(sine) [rad].

        Of a link and a line it is the angle between the two motions that they allow the joint.
        """
        if self._dyad is None:
            return np.arcsin(np.minimum(1.0, np.abs(self.sine(u))))
        return self._dyad.transmission_angle(u, outside=self.outside)

    def clearance(self, u: Vectors) -> Any:
        """
        Return the clearance of a dyad's ends within its reach [m].

        Of coupled loops it is the least singular value of their part of Phi [m/rad].
        """
        if self._dyad is not None:
            return self._dyad.clearance(self.closure_vector(u), u)
        return np.linalg.svd(self.jacobian(u), compute_uv=False)[..., -1]

    def openings(self, u: Vectors) -> list[Any]:
        """Return the closure error of each loop [m]."""
        return [vector_sum(terms, u, constant) for terms, constant in self.rows]

    def closing(self, u: Vectors) -> Closing:
        """Return its bodies, and what closes its loops again at many poses: see `Closing`."""
        if self._dyad is not None:
            changes = self._cramer(u, self._dyad)
        else:
            matrix = self.jacobian(u)
            singular = ~(np.abs(self.sine(u)) > self.singular_sine)
            matrix[singular | ~np.isfinite(matrix).all(axis=(-2, -1))] = np.nan
            changes = partial(solve_openings, matrix)

        def close(du: Vectors, further: Sequence[Any] = ()) -> Any:
            openings = []
            for k, (terms, _) in enumerate(self.rows):
                opening = vector_sum(terms, du, 0j * du[0])
                openings.append(opening + (further[k] if further else 0.0))
            return changes(np.array(openings))

        return self.unknowns, close

    def _cramer(self, u: Vectors, solver: DyadSolver) -> Callable[[ComplexArray], Any]:
        p, q = solver.dyad.jacobian_columns(u)
        determinant = cross(p, q)
        sine = determinant / solver.column_lengths(self.closure_vector(u))
        determinant = np.where(np.abs(sine) <= self.singular_sine, np.nan, determinant)
        return lambda opened: (
            cross(q, opened[0]) / determinant,
            cross(opened[0], p) / determinant,
        )


def solve_openings(matrix: FloatArray, opened: ComplexArray) -> FloatArray:
    """Return the changes, shape (2 k, ...), that undo the openings of k loops by their Phi."""
    right = np.moveaxis(real_rows(opened), 0, -1)
    solution: Any = np.linalg.solve(matrix, -right[..., None])
    changes: FloatArray = np.moveaxis(solution[..., 0], -1, 0)
    return changes


def blocks_of(structure: Structure, rows: Sequence[tuple[Terms, Any]]) -> tuple[Block, ...]:
    """Return the blocks of a structure, in the order of their solution, by its loops' terms."""
    blocks = []
    for k, group in enumerate(structure.groups, 1):
        block_rows = tuple(rows[i] for i in structure.paths.rows[k - 1])
        names = structure.dyad_names[k - 1]
        is_outside = k in structure.outside
        blocks.append(Block(k, block_rows, group, structure, names, is_outside))
    return tuple(blocks)
