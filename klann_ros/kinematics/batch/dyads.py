"""Linkages whose blocks are all dyads of pins, in bulk: a kernel runs their compiled program."""

from collections.abc import Hashable, Iterator, Sequence, Set as AbstractSet
from functools import cached_property
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
        self._results = results
        self._variants = variants
        self._crank = kernel.crank
        self._structure = variants.base.structure
        requested = results.arrays().keys() - {'h'}
        with_gradient = set()
        for name in requested:
            if name.endswith('_gradient'):
                with_gradient.add(name.split('_')[0])
        kind: dict[str, Any] = {
            'links': bool(requested),
            'gradients': frozenset(with_gradient),
            'rates': results.h_1 is not None,
        }
        self._program = program = compile_program(self._structure, **kind)
        self._terms, self._constants = _terms_of(variants, program, tuple(kind.values()))
        self._names = _names(program, requested)
        # Arrays that the kernel fills in: their numbers are one after another in memory.
        tables = {}
        for name, array in results.arrays().items():
            numbers_first = np.moveaxis(array, (0, 1), (-2, -1))
            table = numbers_first.reshape(prod(array.shape[2:]), *array.shape[:2])
            if table.flags.c_contiguous and len(table) == len(self._names.get(name, ())):
                tables[name] = self._names.pop(name), table
        names = chain(program.foot, *self._names.values())
        self._kernel = kernel(program, tuple(names), BLOCK_SIZE, [*tables.values()])
        self._block_crank: tuple[slice, Any] | None = None

    @cached_property
    def _singular_determinants(self) -> FloatArray:
        return self._terms.singular_determinants(len(self._variants))

    def fill(self, rows: slice, columns: slice, alphas: AnyArray) -> None:
        """Compute and store a block."""
        if self._block_crank is None or self._block_crank[0] != columns:
            angles = np.ascontiguousarray(alphas[columns], dtype=np.float64)
            self._block_crank = columns, self._crank(angles)
        crank = self._block_crank[1]
        numbers, is_incomplete = self._kernel.run(self._constants, rows, crank, columns.start)
        h = self._results.h[rows, columns]
        reason = self._results.reason[rows, columns]
        h[..., 0] = numbers[0]
        h[..., 1] = numbers[1]
        reason[...] = Reason.SOLVED
        missing = np.isnan(numbers[0]) if is_incomplete else None
        if missing is not None:
            h[missing] = np.nan
            reason[missing] = self._reasons(rows, crank)[missing]
            reason[self._variants.refused[rows]] = Reason.REFUSED
        for array in self._store(rows, columns, numbers[2:]):
            if missing is not None:
                array[missing] = np.nan

    def _reasons(self, rows: slice, crank: tuple[FloatArray, FloatArray]) -> ByteArray:
        """Return the reason of each missing pose: the first dyad that does not close."""
        count = crank[0].size * (rows.stop - rows.start)
        kernel = NumpyKernel(self._program, self._program.distances, count)
        distances, _ = kernel.run(self._constants, rows, crank)
        reasons: ByteArray = np.zeros(distances[0].shape, dtype=np.uint8)
        for k in reversed(range(len(distances))):
            r_a, r_b = (length[rows, None] for length in self._terms.link_lengths(k))
            is_far = distances[k] > (r_a + r_b) ** 2
            closes = (distances[k] >= (r_a - r_b) ** 2) & ~is_far & (distances[k] > 0.0)
            reasons[~closes] = unreachable(k + 1, far=False)
            reasons[is_far] = unreachable(k + 1, far=True)
        reasons[:, np.isnan(crank[0])] = Reason.CRANK_ANGLE
        return reasons

    def _store(
        self, rows: slice, columns: slice, numbers: Sequence[FloatArray]
    ) -> Iterator[FloatArray]:
        """Store and yield the requested arrays except the feet."""
        remaining = iter(numbers)
        numbers_of = {}
        for name, names in self._names.items():
            numbers_of[name] = [*islice(remaining, len(names))]
        links = _pairs(numbers_of['links'])
        singular = self._singular(numbers_of['D'], rows) if numbers_of['D'] else None
        for name, array in part_of(self._results, rows, columns).arrays().items():
            if name == 'h':
                continue
            if name == 'transmission_angles':
                self._store_transmission(array, links)
            elif name in {'angles', 'angles_1'}:
                link_rates = _pairs(numbers_of['angles_1']) if name == 'angles_1' else None
                self._store_angles(array, links, link_rates, rows)
            elif name in numbers_of:
                # Numbers in the order of the array's last axes.
                indices = np.ndindex(array.shape[2:])
                for index, number in zip(indices, numbers_of[name], strict=True):
                    array[(..., *index)] = number
            if singular is not None and name.endswith(('_1', '_gradient')):
                array[singular] = np.nan
            yield array

    def _store_angles(
        self, angles: FloatArray, links: Planes, rates: Planes | None, rows: slice
    ) -> None:
        """Store the angles, or their rates by the rates of the links."""
        senses = self._structure.senses
        for n, j in enumerate(chain(*self._structure.groups)):
            if rates is not None:
                angles[..., j - 1] = _angle_rate(links[n], rates[n], senses[j])
            else:
                w = self._terms.links(n // 2)[n % 2]
                angles[..., j - 1] = _angle(*links[n], w[rows, None], senses[j])

    def _store_transmission(self, angles: FloatArray, links: Planes) -> None:
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            deviation = np.abs(np.arctan2(x * v - y * u, x * u + y * v))
            is_outside = k + 1 in self._structure.outside
            angles[..., k] = deviation if is_outside else np.pi - deviation

    def _singular(self, determinants: Sequence[FloatArray], rows: slice) -> BoolArray | None:
        """Return the poses with a singular dyad, to rounding; None for none."""
        thresholds = self._singular_determinants[:, rows, None]
        singular: BoolArray | None = None
        for d, threshold in zip(determinants, thresholds, strict=True):
            # At regular poses the extremes decide, as D keeps its sign.
            if not max(d.min(), -d.max()) > threshold.max():
                is_singular = np.abs(d) <= threshold
                singular = is_singular if singular is None else singular | is_singular
        return singular


def _pairs(numbers: Sequence[FloatArray]) -> Planes:
    """Return vectors by their x and y, one after the other."""
    return [*zip(numbers[::2], numbers[1::2], strict=True)]


def _names(program: Program, requested: AbstractSet[str]) -> dict[str, Sequence[str]]:
    """Return the numbers that the kernel computes besides the foot, by the results."""
    # In one order, as the source that is compiled and cached has it.
    derivatives = sorted(name for name in requested if name.endswith(('_1', '_gradient')))
    links = [*chain(*program.links)]
    points = [*chain(*program.points)]
    by_links = requested & {'angles', 'angles_1', 'transmission_angles'}
    names: dict[str, Sequence[str]] = {
        'links': links if by_links else [],
        'D': program.determinants if derivatives else [],
        'points': points if 'points' in requested else [],
    }
    plain = {'h': program.foot, 'angles': links, 'points': points}
    for name in derivatives:
        quantity = name.split('_')[0]
        is_gradient = name.endswith('_gradient')
        numbers = program.gradients[quantity] if is_gradient else plain[quantity]
        if '_1' in name:
            numbers = [program.rates[number] for number in numbers]
        names[name] = numbers
    return names


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
    table = constants(program, terms, len(variants))
    if key is not None:
        if len(_cache) >= MAX_CACHED:
            _cache.clear()
        _cache[key] = terms, table
    return terms, table


def _angle(x: FloatArray, y: FloatArray, w: ComplexArray, sense: int) -> FloatArray:
    """Return the angle of a body by its link W u, in (-pi, pi] [rad]."""
    if w.imag.any():
        rotated = (x + 1j * y) * w.conj()
        x = rotated.real
        y = rotated.imag
    else:
        sign = np.sign(w.real)
        x = sign * x
        y = sign * y
    angle: FloatArray = np.arctan2(sense * y, x)
    angle[angle == -np.pi] = np.pi
    return angle


def _angle_rate(links: Any, links_1: Any, sense: int) -> Any:
    """Return dx/dalpha of a body by its link W u and the derivative, (x, y) each."""
    x, y = links
    x_1, y_1 = links_1
    return sense * (x * y_1 - y * x_1) / (x * x + y * y)
