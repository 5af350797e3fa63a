"""Linkages whose blocks are all dyads of pins, in bulk: a kernel runs their compiled program."""

from collections.abc import Hashable, Iterator, Sequence, Set as AbstractSet
from itertools import chain, islice
from math import prod
from typing import Any, TypeAlias

from klann_ros.kinematics.arrays import AnyArray, BoolArray, ByteArray, ComplexArray, FloatArray
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .kernels import NumpyKernel
from .program import compile_program, constants, PathTerms, Program
from .results import LinkagePoses, part_of, Reason, unreachable

# The x and the y of vectors of many poses.
Planes: TypeAlias = list[tuple[FloatArray, FloatArray]]
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
        rates = results.h_1 is not None
        gradients = frozenset(
            name.removesuffix('_gradient').removesuffix('_1')
            for name in others
            if name.endswith('_gradient')
        )
        self._program = program = compile_program(
            structure, links=bool(others), gradients=gradients, rates=rates
        )
        kind = bool(others), rates, gradients
        self._terms, self._constants = _terms_of(variants, self._program, kind)
        self._wanted = _wanted(program, others)
        least = [self._terms.singular_determinant(k) for k in range(len(self._wanted['D']))]
        self._least_determinants = np.array([np.broadcast_to(d, len(variants)) for d in least])
        # Arrays that the kernel fills in: their numbers are one after another in memory.
        tables = {}
        for name, array in results.arrays().items():
            moved = np.moveaxis(array, (0, 1), (-2, -1))
            table = moved.reshape(prod(array.shape[2:]), *array.shape[:2])
            if table.flags.c_contiguous and len(table) == len(self._wanted.get(name, ())):
                tables[name] = self._wanted.pop(name), table
        names = chain(program.foot, *self._wanted.values())
        self._kernel = kernel(program, tuple(names), BLOCK_SIZE, [*tables.values()])
        self._block_crank: tuple[slice, Any] | None = None

    def fill(self, rows: slice, columns: slice, alphas: AnyArray) -> None:
        """Compute and store a block."""
        if self._block_crank is None or self._block_crank[0] != columns:
            angles = np.ascontiguousarray(alphas[columns], dtype=np.float64)
            self._block_crank = columns, self._crank(angles)
        crank = self._block_crank[1]
        found, missing = self._kernel.run(self._constants, rows, crank, columns.start)
        h, reason = self._results.h[rows, columns], self._results.reason[rows, columns]
        h[..., 0] = found[0]
        h[..., 1] = found[1]
        reason[...] = Reason.SOLVED
        gone = np.isnan(found[0]) if missing else None
        if gone is not None:
            h[gone] = np.nan
            reason[gone] = self._reasons(rows, crank)[gone]
            reason[self._variants.refused[rows]] = Reason.REFUSED
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
        numbers = iter(found)
        own = {name: [*islice(numbers, len(some))] for name, some in self._wanted.items()}
        links = [*zip(own['links'][::2], own['links'][1::2], strict=True)]
        singular = self._singular(own['D'], rows) if own['D'] else None
        for name, array in part.arrays().items():
            if name == 'h':
                continue
            if name == 'transmission_angles':
                self._store_transmission(array, links)
            elif name in {'angles', 'angles_1'}:
                rates = own.get('angles_1', [])
                pairs = [*zip(rates[::2], rates[1::2], strict=True)]
                self._store_angles(array, links, pairs if name == 'angles_1' else None, rows)
            elif name in own:
                # Numbers in the order of the array's last axes.
                for place, number in zip(np.ndindex(array.shape[2:]), own[name], strict=True):
                    array[(..., *place)] = number
            if singular is not None and name.endswith(('_1', '_gradient')):
                array[singular] = np.nan
            yield array

    def _store_angles(
        self, angles: FloatArray, links: Planes, rates: Planes | None, rows: slice
    ) -> None:
        """Store the angles, or their rates by those of the links."""
        senses = self._structure.senses
        sides = [(k, j) for k, group in enumerate(self._structure.groups) for j in group]
        for n, (k, j) in enumerate(sides):
            if rates is not None:
                angles[..., j - 1] = _angle_rate(links[n], rates[n], senses[j])
            else:
                w = self._terms.links(k)[n % 2]
                angles[..., j - 1] = _angle(*links[n], w[rows, None], senses[j])

    def _store_transmission(self, angles: FloatArray, links: Planes) -> None:
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            along = np.abs(np.arctan2(x * v - y * u, x * u + y * v))
            angles[..., k] = along if k + 1 in self._structure.outside else np.pi - along

    def _singular(self, determinants: Sequence[FloatArray], rows: slice) -> BoolArray | None:
        """Return the poses with a singular dyad, to rounding; None for none."""
        pairs = [*zip(determinants, self._least_determinants[:, rows, None], strict=True)]
        # Of regular poses the extremes tell, as D keeps its sign.
        if all(max(d.min(), -d.max()) > least.max() for d, least in pairs):
            return None
        found: BoolArray = np.logical_or.reduce([np.abs(d) <= least for d, least in pairs])
        return found


def _wanted(program: Program, others: AbstractSet[str]) -> dict[str, Sequence[str]]:
    """Return the numbers that the kernel computes besides the foot, by the results."""
    # In one order, as the source that is compiled and cached has it.
    derivatives = sorted(name for name in others if name.endswith(('_1', '_gradient')))
    links = [*chain(*program.links)]
    of_links = others & {'angles', 'angles_1', 'transmission_angles'}
    wanted: dict[str, Sequence[str]] = {
        'links': links if of_links else [],
        'D': program.determinants if derivatives else [],
        'points': [*chain(*program.points)] if 'points' in others else [],
    }
    numbers = {'h': program.foot, 'angles': links, 'points': [*chain(*program.points)]}
    for name in derivatives:
        of = name.removesuffix('_gradient')
        base = of.removesuffix('_1')
        own = program.gradients[base] if name.endswith('_gradient') else numbers[base]
        wanted[name] = [program.rates[each] for each in own] if of.endswith('_1') else own
    return wanted


def _terms_of(
    variants: Variants, program: Program, kind: Hashable
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
