"""All blocks of a batch, one after the other, in the same memory."""

from collections.abc import Callable, Iterator, Sequence, Set as AbstractSet
from dataclasses import dataclass, fields
from itertools import islice
from typing import Any, TypeAlias

from klann_ros.kinematics.linkage.variants import Variants
import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import coupled
from .derivative import angle_rates, Derived, differentiated
from .numpy_kernel import NumpyKernel
from .program import Array, constants, Numbers, Program, program
from .reason import Reason, unreachable
from .sliding import SlidingBatch

Codes: TypeAlias = NDArray[np.uint8]
Progress: TypeAlias = Callable[[int, int], object]
Rows: TypeAlias = Sequence[Array]
Pairs: TypeAlias = tuple[tuple[str, str], ...]
# Poses a block: all that is made of them stays in a processor's second-level cache.
SIZE = 8192


@dataclass(frozen=True, eq=False)
class LinkagePoses:
    """
    Many poses; where one was not solved, all its numbers are NaN.

    The arrays are read-only, except an `h` that the caller has provided. Derivatives are by the
    crank angle, and NaN at singular poses.

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
    transmission_angles : numpy.ndarray, shape (..., number of blocks), or None
        Those of `LinkagePose`, in [0, pi] [rad], if asked for.
    h_1 : numpy.ndarray, shape (..., 2), or None
        dH/dalpha, the foot's velocity at a crank rate of 1 rad/s [m/rad], if velocities are asked
        for.
    angles_1 : numpy.ndarray, shape (..., n - 1), or None
        Derivatives of the angles, if both are asked for.
    points_1 : numpy.ndarray, shape (..., p, 2), or None
        Derivatives of the points [m/rad], if both are asked for.

    """

    h: Array
    reason: Codes
    angles: Array | None = None
    points: Array | None = None
    transmission_angles: Array | None = None
    h_1: Array | None = None
    angles_1: Array | None = None
    points_1: Array | None = None

    def velocity(self, alpha_rate: ArrayLike) -> Array:
        """
        Return the foot's velocity dH/dalpha alpha_rate, shape (..., 2) [m/s].

        Parameters
        ----------
        alpha_rate : array-like of float
            Rate of the crank, one or of a shape that fits (...) [rad/s].

        Raises
        ------
        ValueError
            The velocities were not asked for, or the rate does not fit.

        """
        velocity: Array = self._asked_for() * np.asarray(alpha_rate, dtype=np.float64)[..., None]
        return velocity

    def crank_torque(self, force: ArrayLike) -> Array:
        """
        Return the torque at the crank that balances a force on the foot, shape (...) [N m].

        T = -F . dH/dalpha, counter-clockwise positive; see `Leg.crank_torque`.

        Parameters
        ----------
        force : array-like of float, shape (2,) or (..., 2)
            On the foot (x, y) [N], one or one for each pose.

        Raises
        ------
        ValueError
            The velocities were not asked for, or the force does not fit.

        """
        f = np.asarray(force, dtype=np.float64)
        if f.shape[-1:] != (2,):
            msg = f'force is refused: its shape must be (2,) or (..., 2), not {f.shape}'
            raise ValueError(msg)
        h_1 = self._asked_for()
        # From 0.0, so that no force takes a torque of 0.0 and not of -0.0.
        torque: Array = 0.0 - (f[..., 0] * h_1[..., 0] + f[..., 1] * h_1[..., 1])
        return torque

    def _asked_for(self) -> Array:
        if self.h_1 is None:
            msg = 'the velocities were not asked for: linkage_poses(..., velocities=True)'
            raise ValueError(msg)
        return self.h_1

    def arrays(self) -> dict[str, Array]:
        """Return the arrays that there are, by their names, without the reasons."""
        found = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: a for name, a in found.items() if a is not None and name != 'reason'}


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
    batch: _Dyads | SlidingBatch | None = None
    if variants.base.two_circles:
        batch = _Dyads(variants, results, kernel)
    elif variants.base.is_dyadic:
        batch = SlidingBatch(variants, results)
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
    parts = {name: array[rows, columns] for name, array in results.arrays().items()}
    return LinkagePoses(reason=results.reason[rows, columns], **parts)


class _Dyads:
    """Linkages whose blocks are all dyads: a kernel runs their program."""

    def __init__(self, variants: Variants, results: LinkagePoses, kernel: Any) -> None:
        self._results, self._variants, self._turn = results, variants, kernel.turn
        self._structure = structure = variants.base.structure
        others = results.arrays().keys() - {'h'}
        self._program = made = program(structure, links=bool(others))
        self._numbers = Numbers(structure, *variants.vectors, variants.signs)
        self._derived = Derived(made, {})
        if results.h_1 is not None:
            self._derived = differentiated(made)
            self._program = self._derived.program
        self._constants = constants(self._program, self._numbers, len(variants))
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
        """Store all but the feet, as far as it is wanted; yield what was stored."""
        part = _part(self._results, rows, columns)
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
        self, angles: Array, own: dict[str, list[Any]], rows: slice, *, rate: bool
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

    def _store_transmission(self, angles: Array, links: list[Any]) -> None:
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            along = np.abs(np.arctan2(x * v - y * u, x * u + y * v))
            angles[..., k] = along if k + 1 in self._structure.outside else np.pi - along

    def _singular(self, links: list[Any], rows: slice) -> NDArray[np.bool_]:
        """Return at which poses a dyad is in line, but for rounding."""
        found: NDArray[np.bool_] = np.zeros(links[0][0].shape, dtype=np.bool_)
        for k, ((x, y), (u, v)) in enumerate(zip(links[::2], links[1::2], strict=True)):
            sine = np.abs(x * v - y * u) / (np.hypot(x, y) * np.hypot(u, v))
            least = np.broadcast_to(self._numbers.singular_sine(k), len(self._variants))
            found |= sine <= least[rows, None]
        return found


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
