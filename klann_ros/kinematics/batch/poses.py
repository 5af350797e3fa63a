"""Poses by the million: `linkage_poses`, and `klann_poses`, which is a face of it."""

from collections.abc import Iterable
from functools import cache
from math import prod
from typing import Any

from klann_ros.kinematics.arrays import AnyArray, FloatArray
from klann_ros.kinematics.klann.geometry import KlannGeometry
from klann_ros.kinematics.linkage.linkage import as_linkage
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np
from numpy.typing import ArrayLike

from . import numpy_kernel
from .batch import fill, Progress
from .results import LinkagePoses

# Loading numba and its machine code takes as long as NumPy takes for millions of poses; a batch
# as large as this is unlikely to be the only one.
WORTH_COMPILING = 100_000


def linkage_poses(
    linkages: Any,
    alphas: ArrayLike,
    *,
    angles: bool = False,
    points: bool = False,
    transmission_angles: bool = False,
    velocities: bool = False,
    out: FloatArray | None = None,
    progress: Progress | None = None,
    kernel: str | None = None,
) -> LinkagePoses:
    """
    Return the poses of one linkage, or of many of one structure, at many crank angles.

    The geometric method in the linkages' assemblies, on whole arrays: an angle that cannot be
    reached gives NaN and a reason, never a wrong number. Coupled loops are solved by Newton-
    Raphson along their branch. Beyond the results it takes some megabytes, and a kilobyte a
    linkage, however many poses there are; `alphas` is copied only if it is no array, or one that
    cannot be flattened.

    Parameters
    ----------
    linkages : Linkage, KlannGeometry, leg, Variants, or iterable of them
        One linkage, or n of them. Variants are arrays of numbers: much quicker than objects.
    alphas : array-like of real numbers
        Crank angles, of any shape and any number of turns [rad].
    angles, points, transmission_angles : bool
        Whether the angles, the points and the transmission angles are wanted, too.
    velocities : bool
        Whether the derivatives by the crank angle are wanted: of the foot, and of the angles and
        points that are. `LinkagePoses.velocity` and `.crank_torque` follow from them.
    out : numpy.ndarray of float64, optional
        Where the feet go, in exactly their shape; no other array of them is made. It may be a
        view, as long as its axes of crank angles can be flattened into one without a copy.
    progress : callable, optional
        Called with (done, total) poses after each few thousand. With tqdm:
        `progress=lambda done, total: bar.update(done - bar.n)`.
    kernel : str, optional
        'numpy', or 'numba' (the extra "fast"), which is three to four times as fast for many
        linkages once it is loaded, and 1.3 to 2 times for one. By itself a batch of 100 000 poses
        or more takes numba where it can be had. They agree to rounding. Coupled loops have NumPy's
        alone.

    Returns
    -------
    LinkagePoses
        The leading shape (...) of its arrays is that of `alphas` for one linkage, (n,
        `*alphas.shape`) for n of them.

    Raises
    ------
    TypeError
        `linkages` is none of the above.
    GeometryError
        They are of several structures.
    ValueError
        `alphas` is no array of real numbers, `out` does not fit, or the kernel cannot be had.

    Examples
    --------
    >>> import numpy as np
    >>> from klann_ros.kinematics import shipped_linkage
    >>> poses = linkage_poses(shipped_linkage('jansen'), np.linspace(0.0, 2.0 * np.pi, 1000))
    >>> poses.h.shape, int(np.count_nonzero(poses.reason))
    ((1000, 2), 0)

    """
    one, variants = _variants(linkages)
    flat = _alphas(alphas)
    count = 0 if variants is None else len(variants)
    shape = flat.shape if one else (count, *flat.shape)
    structure = None if variants is None else variants.base.structure
    bodies = 0 if structure is None else len(structure.bodies) - 1
    axes = {
        'angles': (bodies,) if angles else None,
        'points': (len(structure.points) if structure else 0, 2) if points else None,
        'transmission_angles': (len(structure.groups) if structure else 0,)
        if transmission_angles
        else None,
    }
    if velocities:
        axes |= {'h_1': (2,), 'angles_1': axes['angles'], 'points_1': axes['points']}
    wanted = {name: each for name, each in axes.items() if each is not None}
    made = LinkagePoses(
        np.empty((*shape, 2)) if out is None else out,
        np.empty(shape, dtype=np.uint8),
        **{name: np.empty((*shape, *each)) for name, each in wanted.items()},
    )
    table = (count, flat.size)
    h = made.h.reshape(*table, 2) if out is None else _checked(out, shape, table)
    chosen = _kernel(kernel, prod(shape))
    if np.may_share_memory(h, flat):
        # Else the first results would overwrite crank angles that are still to come.
        flat = flat.copy()
    if variants is not None:
        others = made.arrays()
        tables = {name: others[name].reshape(*table, *each) for name, each in wanted.items()}
        results = LinkagePoses(h, made.reason.reshape(table), **tables)
        fill(variants, flat.reshape(-1), results, chosen, progress)
    made.reason.setflags(write=False)
    for array in made.arrays().values():
        if array is not out:
            array.setflags(write=False)
    return made


def klann_poses(geometries: Any, alphas: ArrayLike, **options: Any) -> LinkagePoses:
    """
    Return the poses of Klann legs: `linkage_poses` of their geometries.

    `angles` are gamma, beta, delta, theta, and `points` A to H.

    Raises
    ------
    TypeError
        `geometries` is neither a KlannGeometry nor an iterable of them.

    Examples
    --------
    >>> import numpy as np
    >>> poses = klann_poses(KlannGeometry.sem104(), np.linspace(0.0, 2.0 * np.pi, 1_000_000))
    >>> poses.h.shape, int(np.count_nonzero(poses.reason))
    ((1000000, 2), 0)

    """
    if isinstance(geometries, KlannGeometry):
        return linkage_poses(geometries, alphas, **options)
    legs = list(geometries) if isinstance(geometries, Iterable) else [geometries]
    for leg in legs:
        if not isinstance(leg, KlannGeometry):
            msg = f'geometries: {leg!r} is refused: it must be a KlannGeometry'
            raise TypeError(msg)
    if not legs:
        # None at all have a Klann leg's angles and points all the same.
        return linkage_poses(Variants(KlannGeometry().linkage, {'l_ab': []}), alphas, **options)
    return linkage_poses(legs, alphas, **options)


def _variants(linkages: Any) -> tuple[bool, Variants | None]:
    """Return whether one linkage is meant, and all as variants; None for none at all."""
    if isinstance(linkages, Variants):
        return False, linkages
    if isinstance(linkages, str) or not isinstance(linkages, Iterable):
        return True, Variants.of([as_linkage(linkages)])
    every = list(linkages)
    return False, Variants.of(map(as_linkage, every)) if every else None


def _alphas(alphas: ArrayLike) -> AnyArray:
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


def _checked(out: object, shape: tuple[int, ...], table: tuple[int, int]) -> FloatArray:
    """Return `out` as a table of n linkages at k crank angles, shape (n, k, 2)."""
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


def _kernel(name: str | None, poses: int) -> Any:
    """Return the module of a kernel."""
    if name not in (None, 'numpy', 'numba'):
        msg = f"kernel = {name!r} is refused: it must be 'numpy', 'numba' or None"
        raise ValueError(msg)
    if name == 'numpy' or (name is None and poses < WORTH_COMPILING):
        return numpy_kernel
    module, problem = _numba()
    if module is None and name == 'numba':
        msg = f"kernel = 'numba' is refused: numba cannot be used here ({problem})"
        raise ValueError(msg)
    return module or numpy_kernel


@cache
def _numba() -> tuple[Any, str]:
    try:
        from . import numba_kernel  # noqa: PLC0415 - numba takes long to load
    except Exception as error:  # noqa: BLE001, RUF100 - a numba that does not fit breaks anyhow
        return None, f'{type(error).__name__}: {error}'
    return numba_kernel, ''
