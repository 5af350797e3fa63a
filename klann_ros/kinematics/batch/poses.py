"""Poses by the million: `klann_poses`."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import prod

from klann_ros.kinematics.klann.geometry import KlannGeometry
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .batch import fill, Progress, Results
from .block import Codes
from .constants import Array, numbers, pack
from .kernels import choose


@dataclass(frozen=True, eq=False)
class KlannPoses:
    """
    Many poses; where one was not solved, all its numbers are NaN.

    The arrays are read-only, except an `h` that the caller has provided.

    Attributes
    ----------
    h : numpy.ndarray, shape (..., 2)
        The foot H [m].
    reason : numpy.ndarray of uint8, shape (...)
        0 where the pose was solved, else a `Reason`.
    angles : numpy.ndarray, shape (..., 4), or None
        gamma, beta, delta, theta in (-pi, pi] [rad], if asked for.
    points : numpy.ndarray, shape (..., 8, 2), or None
        The points A to H [m], if asked for.

    """

    h: Array
    reason: Codes
    angles: Array | None = None
    points: Array | None = None


def klann_poses(
    geometries: KlannGeometry | Iterable[KlannGeometry],
    alphas: ArrayLike,
    *,
    angles: bool = False,
    points: bool = False,
    out: Array | None = None,
    progress: Progress | None = None,
    kernel: str | None = None,
) -> KlannPoses:
    """
    Return the poses of one leg or of many, each at all crank angles, by the geometric method.

    Nothing is iterated, and a pose that cannot be reached is NaN with its reason, never a wrong
    number. Beyond the results it takes one megabyte, and one kilobyte a leg, however many
    poses there are; `alphas` is copied only if it is no array, or one that cannot be flattened.

    Parameters
    ----------
    geometries : KlannGeometry or iterable of KlannGeometry
        One leg, or n of them.
    alphas : array-like of real numbers
        Crank angles, of any shape and any number of turns [rad].
    angles, points : bool
        Whether the angles and the points are wanted, too.
    out : numpy.ndarray of float64, optional
        Where H goes, in exactly its shape; no other array of H is made. It may be a view, as long
        as its axes of crank angles can be flattened into one without a copy.
    progress : callable, optional
        Called with (done, total) poses after each few thousand. With tqdm:
        `progress=lambda done, total: bar.update(done - bar.n)`.
    kernel : str, optional
        'numpy', or 'numba' (the extra "fast"), which is three to four times as fast for many legs
        once it is loaded, and 1.3 to 2 times for one. By itself a batch of 100 000 poses or more
        takes numba where it can be had. They agree to rounding.

    Returns
    -------
    KlannPoses
        The leading shape (...) of its arrays is that of `alphas` for one leg, (n, *alphas.shape)
        for n of them.

    Raises
    ------
    TypeError
        `geometries` is neither a KlannGeometry nor an iterable of them.
    ValueError
        `alphas` is no array of real numbers, `out` does not fit, or the kernel cannot be had.

    Examples
    --------
    >>> import numpy as np
    >>> poses = klann_poses(KlannGeometry.sem104(), np.linspace(0.0, 2.0 * np.pi, 1_000_000))
    >>> poses.h.shape, int(np.count_nonzero(poses.reason))
    ((1000000, 2), 0)

    """
    legs, flat = _legs(geometries), _alphas(alphas)
    shape = flat.shape if isinstance(geometries, KlannGeometry) else (len(legs), *flat.shape)
    constants = pack(*numbers(legs))
    chosen = choose(kernel, prod(shape))
    made = KlannPoses(
        np.empty((*shape, 2)) if out is None else out,
        np.empty(shape, dtype=np.uint8),
        np.empty((*shape, 4)) if angles else None,
        np.empty((*shape, 8, 2)) if points else None,
    )
    table = (len(legs), flat.size)
    h = made.h.reshape(*table, 2) if out is None else _checked(out, shape, table)
    if np.may_share_memory(h, flat):
        # Else the first results would overwrite crank angles that are still to come.
        flat = flat.copy()
    results = Results(
        h,
        made.reason.reshape(table),
        None if made.angles is None else made.angles.reshape(*table, 4),
        None if made.points is None else made.points.reshape(*table, 8, 2),
    )
    fill(constants, flat.reshape(-1), results, chosen, progress)
    for array in (made.reason, made.angles, made.points, None if made.h is out else made.h):
        if array is not None:
            array.setflags(write=False)
    return made


def _legs(geometries: object) -> list[KlannGeometry]:
    if isinstance(geometries, KlannGeometry):
        return [geometries]
    legs = []
    for leg in geometries if isinstance(geometries, Iterable) else [geometries]:
        if not isinstance(leg, KlannGeometry):
            msg = f'geometries: {leg!r} is refused: it must be a KlannGeometry'
            raise TypeError(msg)
        legs.append(leg)
    return legs


def _alphas(alphas: ArrayLike) -> NDArray[np.generic]:
    try:
        array = np.asarray(alphas)
        if array.dtype.kind == 'O':
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        msg = f'alphas is refused: it must be an array of real numbers ({error})'
        raise ValueError(msg) from None
    if array.dtype.kind not in 'iuf':
        msg = f'alphas is refused: it must be an array of real numbers, not of {array.dtype}'
        raise ValueError(msg)
    return array


def _checked(out: object, shape: tuple[int, ...], table: tuple[int, int]) -> Array:
    """Return `out` as a table of n legs at k crank angles, shape (n, k, 2)."""
    if not isinstance(out, np.ndarray) or out.dtype != np.float64:
        kind = out.dtype if isinstance(out, np.ndarray) else type(out).__name__
        msg = f'out is refused: it must be an array of float64, not {kind}'
        raise ValueError(msg)
    if out.shape != (*shape, 2):
        msg = f'out is refused: its shape must be {(*shape, 2)}, not {out.shape}'
        raise ValueError(msg)
    if not out.flags.writeable:
        msg = 'out is refused: it is read-only'
        raise ValueError(msg)
    view = out.reshape(*table, 2)
    if out.size and not np.may_share_memory(view, out):
        msg = f'out is refused: its strides {out.strides} do not let it be filled without a copy'
        raise ValueError(msg)
    return view
