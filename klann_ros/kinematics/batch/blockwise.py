"""
Linkages with sliding joints or coupled loops, in bulk: block by block, on complex numbers.

Dyads are placed by the geometric method, for many linkages at once, which takes three times as
long as the program of pinned dyads. Coupled loops are solved by Newton-Raphson from guesses along
their branch, of one linkage at a time.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE, TURN
from klann_ros.kinematics.arrays import AnyArray, BoolArray, ByteArray, FloatArray
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.blocks import Block, blocks_of, solve_openings
from klann_ros.kinematics.linkage.change_points import may_touch_zero
from klann_ros.kinematics.linkage.dimension_derivatives import vector_derivatives
from klann_ros.kinematics.linkage.dyads import CONTACT_ROUNDING
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.linkage import Linkage
from klann_ros.kinematics.linkage.step import MAX_BRANCH_JUMP
from klann_ros.kinematics.linkage.topology import Path
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .results import LinkagePoses, open_loops, Reason, unreachable

MAX_ITERATIONS = 10
STEP_TOLERANCE = 1e-12
# Step of the search for linkages with change points among many [rad].
SCREENING_STEP = TURN / 72.0
_GRADIENTS = 'h_gradient', 'angles_gradient', 'points_gradient'


class Blockwise:
    """
    Linkages of one structure, solved block by block; `rows` are some of the variants.

    With coupled loops `rows` is a single one, a GeometryError if it is invalid; and where the row
    is a `linkage` with change points, along its path.
    """

    def __init__(
        self, variants: Variants, rows: Any = slice(None), linkage: Linkage | None = None
    ) -> None:
        self.structure = structure = variants.base.structure
        self._signs: Any = variants.signs[:, rows, None]
        # The poses near change points, and which ones they are.
        self._interpolated: list[Any] = []
        self._linkage = linkage
        if linkage is None and variants.base.is_dyadic:
            pivots, bars = variants.vectors
            self._pivots = [np.broadcast_to(pivot, len(variants))[rows, None] for pivot in pivots]
            self._bars = [np.broadcast_to(bar, len(variants))[rows, None] for bar in bars]
            loops = structure.paths.loops
            rows_of_loops = [path_terms(structure, path, *self._vectors) for path in loops]
            self.blocks = blocks_of(structure, rows_of_loops)
        else:
            self._linkage = linkage = linkage or variants[rows.start]
            self.blocks = linkage.blocks
            self._pivots = [*np.reshape(linkage.pivots, (-1, 1, 1))]
            self._bars = [*np.reshape(linkage.bars, (-1, 1, 1))]
            _ = linkage.change_points

    @property
    def _vectors(self) -> tuple[list[Any], list[Any]]:
        return self._pivots, self._bars

    def place(self, alphas: FloatArray, count: int | None = None) -> list[Any]:
        """Return u_j of every body in the first blocks, shapes (n, k); NaN where they are open."""
        u: list[Any] = [None] * len(self.structure.bodies)
        u[0] = np.exp(1j * self.structure.senses[0] * alphas)
        linkage = self._linkage
        signs = self._signs
        guesses = np.empty(0)
        if linkage and linkage.change_points:
            signs = linkage.change_points.signs(alphas)
        if linkage and not linkage.is_dyadic:
            guesses = linkage.branch.guesses(alphas[0])[:, None]
        for block, sign in zip(self.blocks[:count], signs, strict=False):
            if block.is_dyad:
                a, b = block.unknowns
                u[a], u[b] = block.dyad_solver.place(u, block.closure_vector(u), sign)
            elif linkage is not None:
                indices = [linkage.prefix_bodies.index(j) - 1 for j in block.unknowns]
                self._refine(block, u, guesses[indices], linkage.size)
        if linkage and linkage.change_points:
            self._interpolated = linkage.change_points.interpolated_poses(alphas)
        for near, pose in self._interpolated:
            x = [alphas[near], *pose.x.T]
            for j, vector in enumerate(joints.body_vectors(self.structure, x)):
                u[j][near] = vector
        return u

    def _interpolate_rates(self, u: list[Any], x_1: list[Any], u_1: list[Any]) -> None:
        """Replace the derivatives by the crank angle of poses near change points."""
        for near, pose in self._interpolated:
            rates = [np.ones(len(pose.x)), *pose.x_1.T]
            vectors = [vector[near] for vector in u]
            for j, rate in enumerate(rates):
                x_1[j][near] = rate
                u_1[j][near] = joints.vector_velocity(self.structure, vectors, rates, j)

    def _refine(self, block: Block, u: list[Any], guesses: FloatArray, size: float) -> None:
        """Place the bodies of coupled loops, from guesses of their coordinates."""
        slides = np.array([self.structure.bodies[j].slides for j in block.unknowns])
        sizes = np.where(slides, size, 1.0)[:, None, None]
        x = guesses
        converged = np.zeros(guesses.shape[1:], dtype=bool)

        def move() -> None:
            # Rotating bodies first: they orient the sliding ones.
            for n in np.argsort(slides, kind='stable').tolist():
                j = block.unknowns[n]
                u[j] = joints.body_vector(self.structure, u, j, x[n])

        for _ in range(MAX_ITERATIONS):
            move()
            openings = np.array(block.openings(u))
            converged |= np.abs(openings).max(axis=0) <= block.rounding
            if (converged | np.isnan(x).any(axis=0)).all():
                break
            matrix = block.jacobian(u)
            matrix[converged | ~np.isfinite(matrix).all(axis=(-2, -1))] = np.nan
            changes = solve_openings(matrix, openings)
            x = np.where(converged, x, x + changes)
            converged |= np.abs(changes / sizes).max(axis=0) <= STEP_TOLERANCE
        on_branch = np.abs((x - guesses) / sizes).max(axis=0) <= MAX_BRANCH_JUMP
        x = np.where(converged & on_branch, x, np.nan)
        move()

    def reasons(self, u: list[Any]) -> ByteArray:
        """Return the reason of each missing pose, its first block that does not close, or 0."""
        reasons: ByteArray = np.zeros(np.shape(u[-1]), dtype=np.uint8)
        for block in self.blocks:
            is_open = np.isnan(sum(u[j] for j in block.unknowns)) & (reasons == 0)
            if not is_open.any():
                continue
            if not block.is_dyad:
                reasons[is_open] = open_loops(block.number)
                continue
            is_far = is_open & block.dyad_solver.is_too_far(block.closure_vector(u))
            reasons[is_open] = unreachable(block.number, far=False)
            reasons[is_far] = unreachable(block.number, far=True)
        return reasons

    def store(self, results: LinkagePoses, u: list[Any]) -> None:
        """Store the requested results of poses."""
        structure = self.structure
        x_1: list[Any] = []
        u_1: list[Any] = []
        closings: list[joints.Closing] = []
        if results.h_1 is not None or results.h_gradient is not None:
            closings = [block.closing(u) for block in self.blocks]
            x_1, u_1 = joints.solve_rates(structure, u, closings, 1.0)
            singular = np.isnan(np.sum(x_1, axis=0))
            if singular.any():
                x_1 = [*np.where(singular, np.nan, x_1)]
                u_1 = [*np.where(singular, np.nan, u_1)]
            self._interpolate_rates(u, x_1, u_1)
        for name, array in results.arrays().items():
            if name == 'transmission_angles':
                for k, block in enumerate(self.blocks):
                    array[..., k] = block.transmission_angle(u)
            elif name.endswith('_1'):
                self._put(
                    name, array, x_1.__getitem__, partial(self._end, self._vectors, u_1, 0.0)
                )
            elif not name.endswith('_gradient'):
                coordinate = partial(joints.coordinate, structure, u)
                self._put(name, array, coordinate, partial(self._end, self._vectors, u, 1.0))
        if results.h_gradient is not None:
            self._store_gradients(results, (u, x_1, u_1), closings)

    def _store_gradients(
        self, results: LinkagePoses, poses: tuple[Any, Any, Any], closings: list[joints.Closing]
    ) -> None:
        """Store the derivatives by the dimensions, by the implicit function theorem."""
        u, x_1, u_1 = poses
        structure = self.structure
        # All arrays have the dimensions along their first axis.
        arrays = results.arrays()
        for name, array in arrays.items():
            arrays[name] = np.moveaxis(array, -1, 0)
        vector_changes = vector_derivatives(structure, self._bars, structure.dimensions)
        bent: Sequence[Any] = ()
        # First the derivatives of the pose, then those of its velocity.
        for vectors, fixed, names in ((u, 1.0, _GRADIENTS), (u_1, 0.0, ('h_1_gradient',))):
            if arrays.keys().isdisjoint(names):
                continue
            direct = partial(self._end, vector_changes, vectors, fixed)
            opened = []
            for loops in structure.paths.rows:
                opened.append([direct(structure.paths.loops[k]) for k in loops])
            dx, du = joints.solve_rates(structure, u, closings, 0.0, opened=opened, bent=bent)
            for name in arrays.keys() & {*names}:
                indirect = partial(self._end, self._vectors, du, 0.0)
                self._put(name, arrays[name], dx.__getitem__, direct, indirect)
                arrays[name][:, np.isnan(np.sum(x_1, axis=0))] = np.nan
            bent = joints.velocity_product(structure, u, x_1, dx)

    def _end(self, vectors: Any, u: Any, fixed: float, path: Path) -> Any:
        """Return the end of a path by its bars and u, and its pivots with a factor."""
        terms, constant = path_terms(self.structure, path, *vectors)
        start = np.zeros(np.shape(u[-1]), dtype=np.complex128) + fixed * constant
        return joints.vector_sum(terms, u, start)

    def _put(
        self, name: str, array: Any, coordinate: Callable[[int], Any], *ends: Callable[[Path], Any]
    ) -> None:
        """Store the coordinates, or the sums of the ends of paths: to the foot, or all points."""
        structure = self.structure
        if name.startswith('angles'):
            for j in range(1, len(structure.bodies)):
                array[..., j - 1] = coordinate(j)
            return
        is_foot = name.startswith('h')
        for n, point in enumerate([structure.foot] if is_foot else structure.points):
            path = structure.paths.points[structure.points.index(point)]
            vector = sum(end(path) for end in ends)
            coordinates = array if is_foot else array[..., n, :]
            coordinates[..., 0] = np.real(vector)
            coordinates[..., 1] = np.imag(vector)


def changing_linkages(variants: Variants) -> dict[int, Linkage]:
    """
    Return those of some dyadic variants that have change points, by their rows.

    Variants that are arrays are checked where the crank drives a dyad, and where they are their
    base; all of them if the base has change points in other dyads. The others keep their signs.
    """
    if variants.changing is None:
        variants.changing = {}
        for i in np.flatnonzero(_may_change(variants)).tolist():
            linkage = variants[i]
            if linkage.change_points:
                variants.changing[i] = linkage
    return variants.changing


def _may_change(variants: Variants) -> BoolArray:
    """Return which variants may have change points."""
    base = variants.base
    linkages = variants.linkages
    if linkages is not None and all(linkage.is_searched for linkage in linkages):
        return np.array([bool(linkage.change_points) for linkage in linkages])
    candidates: BoolArray = (variants.numbers == np.array(base.numbers)[:, None]).all(axis=0)
    if candidates.all():
        return candidates
    has_all_screened = linkages is not None
    for point in base.change_points.points:
        has_all_screened |= not base.blocks[point.block - 1].is_driven
    solver = Blockwise(variants)
    alphas = base.reference + np.arange(0.0, TURN, SCREENING_STEP)
    with np.errstate(all='ignore'):
        u = solver.place(alphas[None, :]) if has_all_screened else []
        for block in solver.blocks:
            if block.is_driven:
                rounding = CONTACT_ROUNDING * sum(block.four_bar_lengths)
                misses = np.abs(block.driven_clearances).min(axis=0)
                candidates |= (misses <= rounding)[:, 0]
            elif has_all_screened and block.two_branches:
                dyad = block.dyad_solver
                p = dyad.discriminant(dyad.span(u, block.closure_vector(u)))
                candidates |= may_touch_zero(p).any(axis=1)
    for linkage, candidate in zip(linkages or (), candidates, strict=False):
        if not candidate:
            linkage.rule_out_change_points()
    return candidates


def fill_blockwise(
    variants: Variants,
    rows: slice,
    alphas: AnyArray,
    results: LinkagePoses,
    linkage: Linkage | None = None,
) -> None:
    """Compute and store the poses of some of the variants, of one with coupled loops."""
    angles = np.asarray(alphas, dtype=np.float64)[None, :]
    within = np.abs(angles) <= MAX_CRANK_ANGLE
    refused = variants.refused[rows]
    try:
        linkages = None if refused.all() else Blockwise(variants, rows, linkage)
    except GeometryError:
        linkages = None
        refused = np.ones(1, dtype=bool)
    if linkages is not None:
        u = linkages.place(np.where(within, angles, np.nan))
        u = [np.broadcast_to(vector, results.reason.shape) for vector in u]
        results.reason[...] = linkages.reasons(u)
        linkages.store(results, u)
    results.reason[:, ~within[0]] = Reason.CRANK_ANGLE
    results.reason[refused] = Reason.REFUSED
    missing = results.reason != 0
    if missing.any():
        for array in results.arrays().values():
            array[missing] = np.nan
