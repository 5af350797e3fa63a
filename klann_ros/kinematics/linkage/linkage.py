"""A linkage: its structure, its dimensions, its assembly mode or branch."""

from cmath import phase
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from math import degrees
from typing import Any, ClassVar, TypeVar

from klann_ros.kinematics import validation
from klann_ros.kinematics.arrays import ComplexArray, FloatArray, real_rows
from klann_ros.kinematics.errors import GeometryError, NotAssembledError, NotConvergedError
from klann_ros.kinematics.newton import newton_raphson
import numpy as np

from . import joints
from .branch import Branch
from .change_points import ChangePoints, COURSES, InterpolatedPose, JUST_AFTER, PARALLEL, SIGN
from .dimension_derivatives import vector_derivatives
from .equations import LoopEquations, moved_numbers, path_terms, term_matrix
from .structure import dimension_places, Structure

# Newton-Raphson needs only a few corrections from a usable start.
MAX_START_ITERATIONS = 50
# Minimum |sin| between two links at the start: below it the assembly mode is undefined.
MIN_START_SINE = 1e-6
GeometryT = TypeVar('GeometryT', bound='NamedGeometry')


class Linkage(LoopEquations):
    """
    A crank-driven linkage of N bars: immutable; `LinkageLeg` solves it.

    Parameters
    ----------
    structure : Structure
        Its bodies and joints.
    numbers : sequence of float
        Its dimensions, in the structure's order [m, rad].
    assembly : sequence of int, optional
        The assembly mode: the sign (+1 or -1) of each block's sine.
    start : sequence of float, optional
        An angle for every body, the crank's first [rad]: at the crank's, Newton-Raphson starts
        from the others. It leads to the assembly, if none is given, and to the branch of coupled
        loops.
    at_change_points : str
        How it goes on at change points, where a dyad is in line and two motions meet: 'parallel',
        along the tangent; 'crossed', along the tangent of the other motion, on which every dyad
        with change points has the opposite sign (the antiparallelogram); or 'sign', with the same
        sign, so that the motion turns back.
    reference : float, optional
        The crank angle at which the signs hold, just after it at a change point [rad]: that of
        the start, or 0.
    name, source : str
        Its name, and the source of its numbers.

    Raises
    ------
    GeometryError
        A dimension is invalid, the crank does not determine the motion, or the linkage cannot be
        assembled near its start.

    """

    def __init__(
        self,
        structure: Structure,
        numbers: Sequence[float],
        *,
        assembly: Sequence[int] | None = None,
        start: Sequence[float] | None = None,
        at_change_points: str = PARALLEL,
        reference: float | None = None,
        name: str = '',
        source: str = '',
    ) -> None:
        super().__init__(structure, numbers)
        self.at_change_points = validation.choice('at_change_points', at_change_points, COURSES)
        self.name = name
        self.source = source
        self.start_guess = None if start is None else tuple(map(float, start))
        self.assembly = (
            self._signs()
            if assembly is None
            else validation.assembly_signs(assembly, len(structure.groups))
        )
        if reference is None:
            reference = 0.0 if self.start_guess is None else self.start_guess[0]
        self.reference = reference

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Linkage):
            return False
        # The change points are searched for equal dimensions alone.
        is_same = self.structure == other.structure and self.numbers == other.numbers
        return is_same and self._key == other._key

    def __hash__(self) -> int:
        return hash((self.structure, self.numbers))

    def __repr__(self) -> str:
        return f'<Linkage {self.name!r}: {", ".join(self.joint_names)}>'

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Linkage, **self._arguments), ()

    @property
    def _arguments(self) -> dict[str, Any]:
        """Return the constructor's arguments."""
        return {
            'structure': self.structure,
            'numbers': self.numbers,
            'assembly': self.assembly,
            'start': self.start_guess,
            'at_change_points': self.at_change_points,
            'reference': self.reference,
            'name': self.name,
            'source': self.source,
        }

    def _with(self, **changes: Any) -> 'Linkage':
        """Return the linkage with some of the constructor's arguments replaced."""
        return Linkage(**self._arguments | changes)

    @property
    def _key(self) -> tuple[Any, ...]:
        """Return all that its motion depends on; the start matters only for coupled loops."""
        start = None if self.is_dyadic else self.start_guess
        branch = (self.at_change_points, self.reference) if self.change_points else ()
        return self.structure, self.numbers, self.assembly, start, branch

    def varied(self, changes: Mapping[str, float] | None = None, **named: float) -> 'Linkage':
        """
        Return the linkage with some of its numbers replaced [m, rad].

        By their names in `dimensions`, as a mapping, or as keywords where these are Python's.

        Raises
        ------
        GeometryError
            The result is no linkage, or there is no such dimension.

        """
        numbers = {**(changes or {}), **named}
        replaced = list(self.numbers)
        places = dimension_places(self.structure.dimensions, numbers)
        for name, number in numbers.items():
            replaced[places[name]] = number
        start = () if self.is_dyadic else self.start
        return self._with(numbers=replaced, **self._mode(start, self.assembly))

    def in_assembly(self, assembly: Sequence[int], reference: float | None = None) -> 'Linkage':
        """
        Return the linkage in another assembly mode: see `assemblies`.

        `reference` is the crank angle at which it holds, by default the same [rad].

        Raises
        ------
        GeometryError
            There is not one sign, +1 or -1, for each block; or its loops are coupled, whose
            assembly mode only a start defines: see `assembly_poses`.

        """
        if not self.is_dyadic:
            msg = 'its loops are coupled: take the linkage of one of its assembly_poses'
            raise GeometryError(msg)
        reference = self.reference if reference is None else reference
        return self._with(assembly=assembly, start=None, reference=reference)

    def from_start(self, start: Sequence[float]) -> 'Linkage':
        """Return the linkage in the assembly of a start: see the parameter."""
        return self._with(assembly=None, start=start, reference=None)

    def at_every_change_point(self, course: str) -> 'Linkage':
        """Return the linkage with another course at its change points: see the parameter."""
        return self._with(at_change_points=course)

    def with_foot(self, point: str) -> 'Linkage':
        """
        Return the linkage with another of its points as foot, which `h` and `foot_path` are of.

        Raises
        ------
        GeometryError
            It is none of its points, or a pivot, which does not move.

        """
        return self._with(structure=self.structure.with_foot(point))

    def with_coupler_point(self, body: str, u: float, v: float, name: str = 'P') -> 'Linkage':
        """
        Return the linkage with another point, which is fixed to a body and is the foot.

        Parameters
        ----------
        body : str
            The name of the body's angle, such as 'theta3'.
        u, v : float
            Its place [m]: u from the body's first point along its first bar, v to the left.
        name : str
            The point's name.

        Raises
        ------
        GeometryError
            There is no such body, u or v is not finite, the name is taken, or it is a pivot.

        """
        place = complex(validation.finite_number('u', u), validation.finite_number('v', v))
        start = ''
        if body in self.structure.angles:
            start = self.structure.bodies[self.structure.angles.index(body)].points[0]
            if place == 0.0:
                return self.with_foot(start)
        numbers = (*self.numbers, abs(place), phase(place))
        return self._with(structure=self.structure.with_point(name, body, start), numbers=numbers)

    def scaled(self, factor: float) -> 'Linkage':
        """
        Return the linkage scaled by a factor.

        Raises
        ------
        GeometryError
            The factor is not positive, or a length gets too large or too small.

        """
        return self.moved(validation.positive_factor(factor))

    def moved(self, factor: complex, shift: complex = 0j) -> 'Linkage':
        """
        Return the linkage turned, scaled and moved: every point z gets to factor z + shift.

        Raises
        ------
        GeometryError
            A length gets too large or too small.

        """
        numbers = moved_numbers(self.structure, self.numbers, factor, shift)
        rotations = np.array(self.structure.senses) * phase(factor)
        start = [] if self.is_dyadic else [*self.start]
        for j, body in enumerate(self.structure.bodies if start else ()):
            start[j] = abs(factor) * start[j] if body.slides else start[j] + rotations[j]
        reference = self.reference + float(rotations[0])
        mode = self._mode(start, self.assembly)
        return self._with(numbers=numbers, reference=reference, **mode)

    def _mode(self, start: Sequence[float] | None, assembly: Sequence[int]) -> dict[str, Any]:
        """Return the arguments for an assembly mode: signs, or a start for coupled loops."""
        if self.is_dyadic:
            return {'assembly': assembly, 'start': None}
        return {'assembly': None, 'start': start}

    def mirrored(self) -> 'Linkage':
        """Return the linkage mirrored in the x axis: every angle has the other sign."""
        numbers = [*self.numbers]
        for n, dimension in enumerate(self.structure.dimensions):
            numbers[n] *= -1.0 if dimension.kind in ('y', 'bend') else 1.0
        # A mirror keeps distances and reverses angles.
        start = [] if self.is_dyadic else [*self.start]
        for j, body in enumerate(self.structure.bodies if start else ()):
            start[j] *= 1.0 if body.slides else -1.0
        signs = [*self.assembly]
        reference = self.reference
        if self.is_dyadic and self.change_points:
            # The signs hold after the reference, which in the mirror is before it.
            signs = [*self.assembly_at(self.change_points.middle)]
            reference = self.change_points.middle + 2.0 * JUST_AFTER
        for b, block in enumerate(self.blocks):
            signs[b] *= 1 if block.slides else -1
        structure = self.structure.mirrored()
        mode = self._mode(start, signs)
        return self._with(structure=structure, numbers=numbers, reference=-reference, **mode)

    @cached_property
    def change_points(self) -> ChangePoints:
        """Return its change points, which decide on the signs along its path; false for none."""
        return ChangePoints(self)

    def assembly_at(self, beta: float) -> tuple[int, ...]:
        """Return the signs of the same motion that hold just after a path angle [rad]."""
        # 'crossed' reverses some signs: the same ones wherever it is.
        at_reference = self.signs(self.reference + JUST_AFTER)
        signs = zip(self.signs(beta + JUST_AFTER), at_reference, self.assembly, strict=True)
        return tuple(at_beta * reference * sign for at_beta, reference, sign in signs)

    @property
    def is_searched(self) -> bool:
        """Return whether its change points are known already."""
        return 'change_points' in vars(self)

    def rule_out_change_points(self) -> None:
        """Note that it has no change points, which saves the search."""
        vars(self).setdefault('change_points', ChangePoints(self, is_searched=True))

    def signs(self, beta: float) -> tuple[int, ...]:
        """Return the sign of each block at a path angle, the unwrapped crank angle [rad]."""
        if not self.change_points:
            return self.assembly
        return tuple(map(int, self.change_points.signs(beta)))

    def interpolated(self, beta: float) -> InterpolatedPose | None:
        """Return the pose at a path angle near a change point; None elsewhere."""
        return self.change_points.interpolated(beta)

    @cached_property
    def start(self) -> tuple[float, ...]:
        """Return the pose that Newton-Raphson reaches from the start, the crank's angle first."""
        if self.start_guess is None:
            raise GeometryError('it has no start, which its coupled loops need')
        alpha, *guess = self.start_guess
        try:
            limits: Any = {'tolerance': 1e-9, 'max_iterations': MAX_START_ITERATIONS}
            x = newton_raphson(self, alpha, np.array(guess), **limits)[-1]
        except NotConvergedError as error:
            w, c = self.equations
            gaps = np.abs(w @ self.vectors(alpha, guess) + c)
            widest = int(np.argmax(gaps))
            raise NotAssembledError(
                f'it cannot be assembled near its start: Newton-Raphson finds no pose at the '
                f'crank angle {alpha:g} rad ({degrees(alpha):g} deg); at the start angles the '
                f'loop that closes at {self.structure.paths.closing[widest]} is open by '
                f'{gaps[widest]:.3g} m, check its lengths and these angles'
            ) from error
        return alpha, *self.wrapped(x)

    # Derivatives by the dimensions.

    def derivatives(
        self, alpha: float, x: Sequence[float] | FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """
        Return the derivatives of the other coordinates and of the foot by each dimension.

        Their shapes are (n - 1, d) and (2, d).
        The loops stay closed, Phi dx = -df: see `dimension_derivatives`.
        """
        rows, row_changes, constant_changes = self._row_derivatives
        u = self.vectors(alpha, x)
        jacobian = real_rows(rows @ joints.vector_jacobian(self.structure, u)[:, 1:])
        opened = real_rows(u @ row_changes + constant_changes)
        dx = np.asarray(-np.linalg.solve(jacobian[:-2], opened[:-2]))
        return dx, opened[-2:] + jacobian[-2:] @ dx

    @cached_property
    def _row_derivatives(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return W over Q of the foot, and the derivatives of these and of their constants."""
        structure = self.structure
        bodies = len(structure.bodies)
        pivots, bars = vector_derivatives(structure, self.bars, structure.dimensions)
        paths = (*structure.paths.loops, structure.paths.points[self.foot])
        terms = [path_terms(structure, path, [*pivots], [*bars]) for path in paths]
        rows, _ = term_matrix((*self.rows, self.point_rows[self.foot]), bodies)
        return rows, *term_matrix(terms, bodies, len(structure.dimensions))

    # Coupled loops.

    @cached_property
    def prefix_bodies(self) -> tuple[int, ...]:
        """Return the bodies placed up to the last coupled loops, the crank first."""
        bodies = {0}
        prefix = {0}
        for group, rows in zip(self.structure.groups, self.structure.paths.rows, strict=True):
            bodies |= {*group}
            if len(rows) > 1:
                prefix = {*bodies}
        return tuple(sorted(prefix))

    @cached_property
    def branch(self) -> Branch:
        """Return the branch of its coupled loops; it takes some 10 ms to be followed."""
        count = 0
        for block in self.blocks:
            if not block.is_dyad:
                count = block.number
        head = self._prefix(count)
        return Branch(head, head.start, count, crosses=self.at_change_points != SIGN)

    def _prefix(self, count: int) -> 'Linkage':
        """Return the subchain of the first blocks as a linkage."""
        if count == len(self.blocks):
            return self
        structure = self.structure.prefix(count)
        number_of = {}
        for dimension, number in zip(self.structure.dimensions, self.numbers, strict=True):
            number_of[dimension.kind, dimension.place] = number
        bars = [n for n, (body, _) in enumerate(self.structure.bars) if body in self.prefix_bodies]
        numbers = []
        for d in structure.dimensions:
            place = d.place if d.kind in ('x', 'y') else bars[d.place]
            numbers.append(number_of.get((d.kind, place), 0.0))
        start = [self.start[j] for j in self.prefix_bodies]
        return Linkage(structure, numbers, assembly=self.assembly[:count], start=start)

    def _signs(self) -> tuple[int, ...]:
        u = self.vectors(self.start[0], self.start[1:])
        signs = []
        for block in self.blocks:
            sine = block.sine(u)
            if abs(sine) <= max(MIN_START_SINE, block.singular_sine):
                msg = 'its start pose is singular, which leaves the branch open: give another'
                raise NotAssembledError(msg)
            signs.append(1 if sine > 0.0 else -1)
        return tuple(signs)


@dataclass(frozen=True)
class NamedGeometry:
    """The common part of geometries, whose fields are the dimensions of a structure."""

    structure: ClassVar[Structure]

    def varied(  # noqa: PYI019 - typing has Self since 3.11
        self: GeometryT, changes: Mapping[str, float] | None = None, **numbers: float
    ) -> GeometryT:
        """
        Return it with some of its numbers replaced.

        Parameters
        ----------
        changes : mapping of str to float, optional
            By name, such as 'l_bc', 'angle_bcg' or 'coupler' [m, rad].
        **numbers
            The same as keywords: `varied(l_bc=0.36)`.

        Raises
        ------
        GeometryError
            It is no such linkage any more, or there is no such number.

        """
        replaced: dict[str, Any] = {**(changes or {}), **numbers}
        dimension_places(self.structure.dimensions, replaced)
        return replace(self, **replaced)

    def scaled(self: GeometryT, factor: float) -> GeometryT:  # noqa: PYI019 - see `varied`
        """Return the linkage scaled by a factor; raises a GeometryError unless it is positive."""
        factor = validation.positive_factor(factor)
        changes = {}
        for dimension in self.structure.dimensions:
            if dimension.unit == 'm':
                changes[dimension.name] = factor * getattr(self, dimension.name)
        return self.varied(changes)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the linkage: it is made on first use."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def as_linkage(source: Any) -> Linkage:
    """Return a linkage itself, or the one of a geometry or a leg; a TypeError for others."""
    linkage = source if isinstance(source, Linkage) else getattr(source, 'linkage', None)
    if not isinstance(linkage, Linkage):
        hint = '; a file has one: linkage_from_file, shipped_linkage' * isinstance(source, str)
        msg = f'{source!r} is refused: it must be a Linkage, a KlannGeometry or a leg{hint}'
        raise TypeError(msg)
    return linkage
