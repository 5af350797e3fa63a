"""All blocks of a batch, one after the other, in the same memory."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from klann_ros.kinematics.linkage.variants import Variants
import numpy as np
from numpy.typing import NDArray

from . import coupled
from .numpy_kernel import NumpyKernel
from .program import Array, constants, Numbers, program
from .reason import Reason, unreachable

Codes: TypeAlias = NDArray[np.uint8]
Progress: TypeAlias = Callable[[int, int], object]
Rows: TypeAlias = Sequence[Array]
# Poses a block: all that is made of them stays in a processor's second-level cache.
SIZE = 8192


@dataclass(frozen=True, eq=False)
class LinkagePoses:
    """
    Many poses; where one was not solved, all its numbers are NaN.

    The arrays are read-only, except an `h` that the caller has provided.

    Attributes
    ----------
    h : numpy.ndarray, shape (..., 2)
        The foot [m].
    reason : numpy.ndarray of uint8, shape (...)
        0 where the pose was solved, else a `Reason`.
    angles : numpy.ndarray, shape (..., n - 1), or None
        The other angles, in the order of `joint_names`, in (-pi, pi] [rad], if asked for.
    points : numpy.ndarray, shape (..., p, 2), or None
        The points, in the structure's order [m], if asked for.

    """

    h: Array
    reason: Codes
    angles: Array | None = None
    points: Array | None = None


def fill(
    variants: Variants,
    alphas: NDArray[Any],
    results: LinkagePoses,
    kernel: Any,
    progress: Progress | None,
) -> None:
    """
    Fill in the results, tables of n rows and k columns: n variants at k crank angles [rad].

    The kernel is `numpy_kernel` or `numba_kernel`; `progress` is called with (done, total) poses
    after each block.
    """
    batch = _Dyads(variants, results, kernel) if variants.base.is_dyadic else None
    done, total = 0, results.reason.size
    # What cannot be computed becomes NaN on its way, and is then explained.
    with np.errstate(all='ignore'):
        for rows, columns in _blocks(len(variants), alphas.size, one_by_one=batch is None):
            if batch is None:
                coupled.place(variants, rows.start, alphas[columns], _part(results, rows, columns))
            else:
                batch.place(rows, columns, alphas)
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


def _part(results: LinkagePoses, rows: slice, columns: slice) -> LinkagePoses:
    """Return the part of the results that a block is."""
    angles, points = results.angles, results.points
    return LinkagePoses(
        results.h[rows, columns],
        results.reason[rows, columns],
        None if angles is None else angles[rows, columns],
        None if points is None else points[rows, columns],
    )


class _Dyads:
    """Linkages whose blocks are all dyads: a kernel runs their program."""

    def __init__(self, variants: Variants, results: LinkagePoses, kernel: Any) -> None:
        self._results, self._variants, self._turn = results, variants, kernel.turn
        self._structure = structure = variants.base.structure
        links = results.angles is not None or results.points is not None
        self._program = made = program(structure, links=links)
        self._numbers = Numbers(structure, *variants.vectors, variants.signs)
        self._constants = constants(made, self._numbers, len(variants))
        angles = made.links if results.angles is not None else ()
        points = made.points if results.points is not None else ()
        wanted = (*made.foot, *(name for pair in (*angles, *points) for name in pair))
        self._kernel = kernel.Kernel(made, wanted, SIZE)
        self._turned: tuple[slice, Any] | None = None

    def place(self, rows: slice, columns: slice, alphas: NDArray[Any]) -> None:
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

    def _explained(self, rows: slice, crank: tuple[Array, Array]) -> Codes:
        """Return why each pose is not there, if it is not: the first dyad that does not close."""
        names, count = self._program.distances, crank[0].size * (rows.stop - rows.start)
        kernel = NumpyKernel(self._program, names, count)
        distances, _ = kernel.run(self._constants, rows, crank)
        why: Codes = np.zeros(distances[0].shape, dtype=np.uint8)
        for k in reversed(range(len(names))):
            w_a, w_b = (np.abs(link)[rows, None] for link in self._numbers.links(k))
            folded, stretched = (w_a - w_b) ** 2, (w_a + w_b) ** 2
            far = distances[k] > stretched
            closes = (distances[k] >= folded) & ~far & (distances[k] > 0.0)
            why[~closes] = unreachable(k + 1, far=False)
            why[far] = unreachable(k + 1, far=True)
        why[:, np.isnan(crank[0])] = Reason.CRANK_ANGLE
        return why

    def _store(self, rows: slice, columns: slice, found: Rows) -> Iterator[Array]:
        """Store angles and points, as far as they are wanted; yield what was stored."""
        pairs = list(zip(found[::2], found[1::2], strict=True))
        if self._results.angles is not None:
            angles = self._results.angles[rows, columns]
            for k, group in enumerate(self._structure.groups):
                for j, w in zip(group, self._numbers.links(k), strict=True):
                    own = w[rows, None], self._structure.senses[j]
                    angles[..., j - 1] = _angle(*pairs.pop(0), *own)
            yield angles
        if self._results.points is not None:
            points = self._results.points[rows, columns]
            for k, (x, y) in enumerate(pairs):
                points[..., k, 0], points[..., k, 1] = x, y
            yield points


def _angle(x: Array, y: Array, w: NDArray[np.complex128], sense: int) -> Array:
    """Return the angle of a body by its link W u, in (-pi, pi] [rad]."""
    if w.imag.any():
        turned = (x + 1j * y) * w.conj()
        x, y = turned.real, turned.imag
    else:
        sign = np.sign(w.real)
        x, y = sign * x, sign * y
    angle: Array = np.arctan2(sense * y, x)
    angle[angle == -np.pi] = np.pi
    return angle
