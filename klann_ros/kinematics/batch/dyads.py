"""
Linkages whose blocks are all dyads, in bulk: the geometric method for many crank angles at once.

Where all joints are pins a kernel runs the compiled program. Dyads with sliding joints are solved
by `linkage.dyads` on arrays of complex numbers, which takes three times as long.
"""

from collections.abc import Iterator, Sequence, Set as AbstractSet
from itertools import islice
from typing import Any, TypeAlias

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import AnyArray, BoolArray, ByteArray, ComplexArray, FloatArray
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.dyads import cross, Dyad, dyad_solver, DyadSolver
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .kernels import NumpyKernel
from .program import compile_program, constants, Derived, differentiate, PathTerms, Program
from .results import LinkagePoses, part_of, Reason, store, unreachable

Pairs: TypeAlias = tuple[tuple[str, str], ...]
# Poses of a block: its buffers stay in a processor's second-level cache.
BLOCK_SIZE = 8192
# Single linkages whose constants are cached: repeated calls have few poses each.
MAX_CACHED = 64
_cache: dict[object, tuple[PathTerms, FloatArray]] = {}


class PinnedDyads:
    """Linkages of pinned dyads: a kernel runs their program."""

    def __init__(self, variants: Variants, results: LinkagePoses, kernel: Any) -> None:
        self._results, self._variants, self._crank = results, variants, kernel.crank
        self._structure = structure = variants.base.structure
        others = results.arrays().keys() - {'h'}
        self._program = program = compile_program(structure, links=bool(others))
        self._derived = Derived(program, {})
        if results.h_1 is not None:
            self._derived = differentiate(program)
            self._program = self._derived.program
        kind = bool(others), results.h_1 is not None
        self._terms, self._constants = _terms_of(variants, self._program, kind)
        self._wanted = self._names(program, others)
        names = (name for pairs in self._wanted.values() for pair in pairs for name in pair)
        self._kernel = kernel(self._program, (*program.foot, *names), BLOCK_SIZE)
        self._block_crank: tuple[slice, Any] | None = None

    def _names(self, program: Program, others: AbstractSet[str]) -> dict[str, Pairs]:
        """Return the pairs of numbers that the kernel computes besides the foot."""
        wanted: dict[str, Pairs] = {}
        if others - {'points'}:
            wanted['links'] = program.links
        if 'points' in others:
            wanted['points'] = program.points
        for name, pairs in (
            ('h', [program.foot]),
            ('angles', program.links),
            ('points', program.points),
        ):
            if f'{name}_1' in others:
                wanted[f'{name}_1'] = self._derived.of(pairs)
        return wanted

    def fill(self, rows: slice, columns: slice, alphas: AnyArray) -> None:
        """Compute and store a block."""
        if self._block_crank is None or self._block_crank[0] != columns:
            angles = np.ascontiguousarray(alphas[columns], dtype=np.float64)
            self._block_crank = columns, self._crank(angles)
        crank = self._block_crank[1]
        found, missing = self._kernel.run(self._constants, rows, crank)
        h, reason = self._results.h[rows, columns], self._results.reason[rows, columns]
        h[..., 0] = found[0]
        h[..., 1] = found[1]
        reason[...] = Reason.SOLVED
        gone = np.isnan(found[0]) if missing else None
        if gone is not None:
            h[gone] = np.nan
            reason[gone] = self._reasons(rows, crank)[gone]
            reason[self._variants.error_codes[rows] != 0] = Reason.REFUSED
        for array in self._store(rows, columns, found[2:]):
            if gone is not None:
                array[gone] = np.nan

    def _reasons(self, rows: slice, crank: tuple[FloatArray, FloatArray]) -> ByteArray:
        """Return the reason of each missing pose: the first dyad that does not close."""
        names, count = self._program.distances, crank[0].size * (rows.stop - rows.start)
        kernel = NumpyKernel(self._program, names, count)
        distances, _ = kernel.run(self._constants, rows, crank)
        why: ByteArray = np.zeros(distances[0].shape, dtype=np.uint8)
        for k in reversed(range(len(names))):
            w_a, w_b = (np.abs(link)[rows, None] for link in self._terms.links(k))
            folded, stretched = (w_a - w_b) ** 2, (w_a + w_b) ** 2
            far = distances[k] > stretched
            closes = (distances[k] >= folded) & ~far & (distances[k] > 0.0)
            why[~closes] = unreachable(k + 1, far=False)
            why[far] = unreachable(k + 1, far=True)
        why[:, np.isnan(crank[0])] = Reason.CRANK_ANGLE
        return why

    def _store(
        self, rows: slice, columns: slice, found: Sequence[FloatArray]
    ) -> Iterator[FloatArray]:
        """Store and yield the requested arrays except the feet."""
        part = part_of(self._results, rows, columns)
        numbers = iter(list(zip(found[::2], found[1::2], strict=True)))
        own = {name: [*islice(numbers, len(pairs))] for name, pairs in self._wanted.items()}
        singular = self._singular(own['links'], rows) if part.h_1 is not None else None
        for name, array in part.arrays().items():
            if name == 'h':
                continue
            if name in {'angles', 'angles_1'}:
                self._store_angles(array, own, rows, rate=name == 'angles_1')
            elif name == 'transmission_angles':
                self._store_transmission(array, own['links'])
            elif name == 'h_1':
                array[..., 0], array[..., 1] = own['h_1'][0]
            else:
                for k, (x, y) in enumerate(own[name]):
                    array[..., k, 0], array[..., k, 1] = x, y
            if singular is not None and name.endswith('_1'):
                array[singular] = np.nan
            yield array

    def _store_angles(
        self, angles: FloatArray, own: dict[str, list[Any]], rows: slice, *, rate: bool
    ) -> None:
        senses = self._structure.senses
        links = [(k, j) for k, group in enumerate(self._structure.groups) for j in group]
        for n, (k, j) in enumerate(links):
            if rate:
                angles[..., j - 1] = _angle_rate(own['links'][n], own['angles_1'][n], senses[j])
            else:
                w = self._terms.links(k)[n % 2]
                x, y = own['links'][n]
                angles[..., j - 1] = _angle(x, y, w[rows, None], senses[j])

    def _store_transmission(self, angles: FloatArray, links: list[Any]) -> None:
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            along = np.abs(np.arctan2(x * v - y * u, x * u + y * v))
            angles[..., k] = along if k + 1 in self._structure.outside else np.pi - along

    def _singular(self, links: list[Any], rows: slice) -> BoolArray:
        """Return the poses with a singular dyad, to rounding."""
        found: BoolArray = np.zeros(links[0][0].shape, dtype=np.bool_)
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            sine = np.abs(x * v - y * u) / (np.hypot(x, y) * np.hypot(u, v))
            least = np.broadcast_to(self._terms.singular_sine(k), len(self._variants))
            found |= sine <= least[rows, None]
        return found


def _terms_of(
    variants: Variants, program: Program, kind: tuple[bool, bool]
) -> tuple[PathTerms, FloatArray]:
    """Return the path terms and the constants of linkages for a program of a kind."""
    structure = variants.base.structure
    key = None
    if len(variants) == 1:
        key = structure, kind, variants.numbers.tobytes(), variants.signs.tobytes()
        if key in _cache:
            return _cache[key]
    terms = PathTerms(structure, *variants.vectors, variants.signs)
    found = terms, constants(program, terms, len(variants))
    if key is not None:
        if len(_cache) >= MAX_CACHED:
            _cache.clear()
        _cache[key] = found
    return found


def _angle(x: FloatArray, y: FloatArray, w: ComplexArray, sense: int) -> FloatArray:
    """Return the angle of a body by its link W u, in (-pi, pi] [rad]."""
    if w.imag.any():
        rotated = (x + 1j * y) * w.conj()
        x, y = rotated.real, rotated.imag
    else:
        sign = np.sign(w.real)
        x, y = sign * x, sign * y
    angle: FloatArray = np.arctan2(sense * y, x)
    angle[angle == -np.pi] = np.pi
    return angle


def _angle_rate(links: Any, links_1: Any, sense: int) -> Any:
    """Return dx/dalpha of a body by its link W u and the derivative, (x, y) each."""
    (x, y), (x_1, y_1) = links, links_1
    return sense * (x * y_1 - y * x_1) / (x * x + y * y)


class SlidingDyads:
    """
    Linkages of one structure whose blocks are all dyads.

    Parameters
    ----------
    variants : Variants
        The linkages.
    rows : slice or numpy.ndarray of int, optional
        A subset; all by default.

    """

    def __init__(self, variants: Variants, rows: Any = slice(None)) -> None:
        self.structure = structure = variants.base.structure
        count = len(variants)
        self._pivots, self._bars = (
            [np.broadcast_to(each, count)[rows, None] for each in some]
            for some in variants.vectors
        )
        self._signs = variants.signs[:, rows, None]
        self._loops = [self._row(structure.paths.loops[k]) for (k,) in structure.paths.rows]
        self.solvers: list[DyadSolver] = [
            dyad_solver(Dyad(structure, (group[0], group[1]), terms, constant))
            for group, (terms, constant) in zip(structure.groups, self._loops, strict=True)
        ]

    def vectors(self, alphas: FloatArray, blocks: int | None = None) -> list[Any]:
        """Return u_j of every body in the first `blocks` blocks, shapes (n, k)."""
        u: list[Any] = [None] * len(self.structure.bodies)
        u[0] = np.exp(1j * self.structure.senses[0] * alphas)
        for k, group in enumerate(self.structure.groups[:blocks]):
            a, b = group
            u[a], u[b] = self.solvers[k].place(u, self.closure_vector(k, u), self._signs[k])
        return u

    def closure_vector(self, k: int, u: list[Any]) -> Any:
        """Return the required W_a u_a + W_b u_b of a dyad, by the dyads before it [m]."""
        (terms, constant), own = self._loops[k], self.structure.groups[k]
        return -sum((w * u[j] for j, w in terms.items() if j not in own), constant)

    def derivatives(self, u: list[Any]) -> tuple[list[Any], list[Any]]:
        """Return dx/dalpha and du/dalpha of every body, shapes (n, k); NaN at singular poses."""
        structure, zero = self.structure, np.zeros(np.shape(u[-1]))
        x_1, u_1 = [zero] * len(u), [zero] * len(u)
        x_1[0] = zero + 1.0
        u_1[0] = joints.vector_velocity(structure, u, x_1, 0)
        for k, (a, b) in enumerate(structure.groups):
            terms, _ = self._loops[k]
            for j in (a, b):
                u_1[j] = zero + joints.known_velocity(structure, u, x_1, j, (a, b))
            opened = sum(w * u_1[j] for j, w in terms.items())
            solver = self.solvers[k]
            p, q = solver.dyad.jacobian_columns(u)
            determinant = cross(p, q)
            sine = determinant / solver.column_lengths(self.closure_vector(k, u))
            least = np.sqrt(solver.dyad.rounding / solver.min_length)
            determinant = np.where(np.abs(sine) <= least, np.nan, determinant)
            x_1[a], x_1[b] = cross(q, opened) / determinant, cross(opened, p) / determinant
            for j in (a, b):
                u_1[j] = joints.vector_velocity(structure, u, x_1, j)
        return x_1, u_1

    def point(self, u: list[Any], which: int, *, moved: bool = False) -> Any:
        """Return a point as a complex number [m]; of derivatives, its derivative."""
        terms, constant = self._row(self.structure.paths.points[which])
        start = np.zeros(np.shape(u[0]), dtype=np.complex128) + (0.0 if moved else constant)
        return sum((w * u[j] for j, w in terms.items()), start)

    def reasons(self, u: list[Any]) -> ByteArray:
        """Return the reason of each pose: the first dyad that does not close, or 0."""
        why: ByteArray = np.zeros(np.shape(u[-1]), dtype=np.uint8)
        for k, (a, b) in enumerate(self.structure.groups):
            gone = (np.isnan(u[a]) | np.isnan(u[b])) & (why == 0)
            far = gone & self.solvers[k].is_too_far(self.closure_vector(k, u))
            why[gone] = unreachable(k + 1, far=False)
            why[far] = unreachable(k + 1, far=True)
        return why

    def _row(self, path: Any) -> tuple[dict[int, Any], Any]:
        return path_terms(self.structure, path, self._pivots, self._bars)


def fill_sliding(variants: Variants, rows: slice, alphas: AnyArray, results: LinkagePoses) -> None:
    """Compute and store the poses of some of the variants."""
    dyads = SlidingDyads(variants, rows)
    angles = np.asarray(alphas, dtype=np.float64)[None, :]
    within = np.abs(angles) <= MAX_CRANK_ANGLE
    u = dyads.vectors(np.where(within, angles, np.nan))
    u = [np.broadcast_to(each, results.reason.shape) for each in u]
    why = dyads.reasons(u)
    why[np.broadcast_to(~within, why.shape)] = Reason.CRANK_ANGLE
    why[variants.error_codes[rows] != 0] = Reason.REFUSED
    results.reason[...] = why
    x_1, u_1 = dyads.derivatives(u) if results.h_1 is not None else ([], [])

    def transmission_angle(k: int) -> Any:
        outside = k + 1 in dyads.structure.outside
        return dyads.solvers[k].transmission_angle(u, outside=outside)

    store(results, dyads.structure, (u, x_1, u_1), dyads.point, transmission_angle)
    gone = why != 0
    if gone.any():
        for array in results.arrays().values():
            array[gone] = np.nan
