"""All blocks of a batch, one after the other, in the same memory."""

from collections.abc import Callable, Iterator, Sequence, Set as AbstractSet
from itertools import islice
from typing import Any, TypeAlias

from klann_ros.kinematics.arrays import AnyArray, BoolArray, ByteArray, ComplexArray, FloatArray
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from . import coupled, sliding
from .derivative import angle_rates, Derived, differentiated
from .numpy_kernel import NumpyKernel
from .program import constants, Numbers, Program, program
from .results import LinkagePoses, part_of, Reason, unreachable

Progress: TypeAlias = Callable[[int, int], object]
Rows: TypeAlias = Sequence[FloatArray]
Pairs: TypeAlias = tuple[tuple[str, str], ...]
# Poses a block: all that is made of them stays in a processor's second-level cache.
SIZE = 8192


def fill(
    variants: Variants,
    alphas: AnyArray,
    results: LinkagePoses,
    kernel: Any,
    progress: Progress | None,
) -> None:
    """
    Fill in the results, tables of n rows and k columns: n variants at k crank angles [rad].

    The kernel is `numpy_kernel` or `numba_kernel`; `progress` is called with (done, total) poses
    after each block.
    """
    batch = _Dyads(variants, results, kernel) if variants.base.two_circles else None
    is_dyadic = variants.base.is_dyadic
    place = sliding.place if is_dyadic else coupled.place
    done, total = 0, results.reason.size
    # What cannot be computed becomes NaN on its way, and is then explained.
    with np.errstate(all='ignore'):
        for rows, columns in _blocks(len(variants), alphas.size, one_by_one=not is_dyadic):
            if batch is not None:
                batch.place(rows, columns, alphas)
            else:
                place(variants, rows, alphas[columns], part_of(results, rows, columns))
            done += (rows.stop - rows.start) * (columns.stop - columns.start)
            if progress is not None:
                progress(done, total)


def _blocks(legs: int, angles: int, *, one_by_one: bool) -> Iterator[tuple[slice, slice]]:
    """Yield rows and columns: all linkages at the first crank angles, then at the next."""
    for first in range(0, angles, SIZE):
        columns = slice(first, min(first + SIZE, angles))
        step = 1 if one_by_one else SIZE // (columns.stop - first)
        for leg in range(0, legs, step):
            yield slice(leg, min(leg + step, legs)), columns


# Of single linkages that were asked for: whoever asks again and again has few poses at a time.
_MOST_KEPT = 64
_kept: dict[object, tuple[Numbers, FloatArray]] = {}


def _numbers_of(
    variants: Variants, made: Program, kind: tuple[bool, bool]
) -> tuple[Numbers, FloatArray]:
    """Return the numbers and constants of linkages for a program, which is one of its kind."""
    structure = variants.base.structure
    key = None
    if len(variants) == 1:
        key = structure, kind, variants.numbers.tobytes(), variants.signs.tobytes()
        if key in _kept:
            return _kept[key]
    numbers = Numbers(structure, *variants.vectors, variants.signs)
    found = numbers, constants(made, numbers, len(variants))
    if key is not None:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        _kept[key] = found
    return found


class _Dyads:
    """Linkages whose blocks are all dyads: a kernel runs their program."""

    def __init__(self, variants: Variants, results: LinkagePoses, kernel: Any) -> None:
        self._results, self._variants, self._turn = results, variants, kernel.turn
        self._structure = structure = variants.base.structure
        others = results.arrays().keys() - {'h'}
        self._program = made = program(structure, links=bool(others))
        self._derived = Derived(made, {})
        if results.h_1 is not None:
            self._derived = differentiated(made)
            self._program = self._derived.program
        kind = bool(others), results.h_1 is not None
        self._numbers, self._constants = _numbers_of(variants, self._program, kind)
        self._wanted = self._names(made, others)
        names = (name for pairs in self._wanted.values() for pair in pairs for name in pair)
        self._kernel = kernel.Kernel(self._program, (*made.foot, *names), SIZE)
        self._turned: tuple[slice, Any] | None = None

    def _names(self, made: Program, others: AbstractSet[str]) -> dict[str, Pairs]:
        """Return the pairs of numbers that the kernel is to compute beside the foot."""
        wanted: dict[str, Pairs] = {}
        if others - {'points'}:
            wanted['links'] = made.links
        if 'points' in others:
            wanted['points'] = made.points
        for name, pairs in (('h', [made.foot]), ('angles', made.links), ('points', made.points)):
            if f'{name}_1' in others:
                wanted[f'{name}_1'] = self._derived.of(pairs)
        return wanted

    def place(self, rows: slice, columns: slice, alphas: AnyArray) -> None:
        """Compute and store a block."""
        if self._turned is None or self._turned[0] != columns:
            angles = np.ascontiguousarray(alphas[columns], dtype=np.float64)
            self._turned = columns, self._turn(angles)
        crank = self._turned[1]
        found, missing = self._kernel.run(self._constants, rows, crank)
        h, reason = self._results.h[rows, columns], self._results.reason[rows, columns]
        h[..., 0] = found[0]
        h[..., 1] = found[1]
        reason[...] = Reason.SOLVED
        gone = np.isnan(found[0]) if missing else None
        if gone is not None:
            h[gone] = np.nan
            reason[gone] = self._explained(rows, crank)[gone]
            reason[self._variants.refused[rows] != 0] = Reason.REFUSED
        for array in self._store(rows, columns, found[2:]):
            if gone is not None:
                array[gone] = np.nan

    def _explained(self, rows: slice, crank: tuple[FloatArray, FloatArray]) -> ByteArray:
        """Return why each pose is not there, if it is not: the first dyad that does not close."""
        names, count = self._program.distances, crank[0].size * (rows.stop - rows.start)
        kernel = NumpyKernel(self._program, names, count)
        distances, _ = kernel.run(self._constants, rows, crank)
        why: ByteArray = np.zeros(distances[0].shape, dtype=np.uint8)
        for k in reversed(range(len(names))):
            w_a, w_b = (np.abs(link)[rows, None] for link in self._numbers.links(k))
            folded, stretched = (w_a - w_b) ** 2, (w_a + w_b) ** 2
            far = distances[k] > stretched
            closes = (distances[k] >= folded) & ~far & (distances[k] > 0.0)
            why[~closes] = unreachable(k + 1, far=False)
            why[far] = unreachable(k + 1, far=True)
        why[:, np.isnan(crank[0])] = Reason.CRANK_ANGLE
        return why

    def _store(self, rows: slice, columns: slice, found: Rows) -> Iterator[FloatArray]:
        """Store all but the feet, as far as it is wanted; yield what was stored."""
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
                angles[..., j - 1] = angle_rates(own['links'][n], own['angles_1'][n], senses[j])
            else:
                w = self._numbers.links(k)[n % 2]
                x, y = own['links'][n]
                angles[..., j - 1] = _angle(x, y, w[rows, None], senses[j])

    def _store_transmission(self, angles: FloatArray, links: list[Any]) -> None:
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            along = np.abs(np.arctan2(x * v - y * u, x * u + y * v))
            angles[..., k] = along if k + 1 in self._structure.outside else np.pi - along

    def _singular(self, links: list[Any], rows: slice) -> BoolArray:
        """Return at which poses a dyad is in line, but for rounding."""
        found: BoolArray = np.zeros(links[0][0].shape, dtype=np.bool_)
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            sine = np.abs(x * v - y * u) / (np.hypot(x, y) * np.hypot(u, v))
            least = np.broadcast_to(self._numbers.singular_sine(k), len(self._variants))
            found |= sine <= least[rows, None]
        return found


def _angle(x: FloatArray, y: FloatArray, w: ComplexArray, sense: int) -> FloatArray:
    """Return the angle of a body by its link W u, in (-pi, pi] [rad]."""
    if w.imag.any():
        turned = (x + 1j * y) * w.conj()
        x, y = turned.real, turned.imag
    else:
        sign = np.sign(w.real)
        x, y = sign * x, sign * y
    angle: FloatArray = np.arctan2(sense * y, x)
    angle[angle == -np.pi] = np.pi
    return angle
