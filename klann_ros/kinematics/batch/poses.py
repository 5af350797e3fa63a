"""Many poses at once: solved (`linkage_poses`), or given by measured angles."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import prod
from typing import Any, TypeAlias

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import AnyArray, FloatArray, plane_vectors
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.validation import real_array
from klann_ros.sanitize.units import warn_of_degrees
import numpy as np
from numpy.typing import ArrayLike

from .blockwise import changing_linkages, fill_blockwise
from .dyads import BLOCK_SIZE, PinnedDyads
from .kernels import choose_kernel
from .results import LinkagePoses, part_of

Progress: TypeAlias = Callable[[int, int], object]
# About as many crank angles of a batch are looked at for degrees.
MAX_ANGLE_SAMPLES = 64
# Numbers of a pose up to which they are stored pose by pose; more are stored number by number.
MAX_INTERLEAVED = 16


def linkage_poses(
    linkages: Any,
    alphas: ArrayLike,
    *,
    angles: bool = False,
    points: bool = False,
    transmission_angles: bool = False,
    velocities: bool = False,
    gradients: bool = False,
    out: FloatArray | None = None,
    progress: Progress | None = None,
    kernel: str | None = None,
) -> LinkagePoses:
    """
    Return the poses of one linkage, or of many of one structure, at many crank angles.

    The geometric method in the linkages' assembly modes, on whole arrays: an unreachable angle
    gives NaN and a reason. Coupled loops are solved by Newton-Raphson along their branch. Memory
    beyond the results is some megabytes and a kilobyte a linkage, whatever the number of poses;
    `alphas` is copied only if it is no array, or cannot be flattened.

    Parameters
    ----------
    linkages : Linkage, KlannGeometry, leg, Variants, or iterable of them
        One linkage, or n of them. Variants are arrays of numbers, much faster than objects.
    alphas : array-like of real numbers
        Crank angles, of any shape and any number of turns [rad].
    angles, points, transmission_angles : bool
        Whether to compute the angles, the points and the transmission angles as well.
    velocities : bool
        Whether to compute derivatives by the crank angle: of the foot, and of the requested angles
        and points. `LinkagePoses.crank_torque` needs them.
    gradients : bool
        Whether to compute derivatives by every dimension, in the order of `dimension_names`: of
        the foot, of the requested angles and points, and of the foot's velocity if requested. Far
        from singular poses they are as precise as the poses.
    out : numpy.ndarray of float64, optional
        Array for the feet, in exactly their shape. It may be a view whose axes of crank angles can
        be flattened without a copy.
    progress : callable, optional
        Called with (done, total) poses after each block. With tqdm:
        `progress=lambda done, total: bar.update(done - bar.n)`.
    kernel : str, optional
        'numpy', or 'numba' (the extra "fast"), which is three to four times as fast for many
        linkages once it is loaded, and 1.3 to 2 times for one. By default numba for 100 000 poses
        or more, if installed. They agree to rounding. Coupled loops always use NumPy.

    Returns
    -------
    LinkagePoses
        The leading shape (...) of its arrays is that of `alphas` for one linkage, (n,
        `*alphas.shape`) for n of them.

    Raises
    ------
    TypeError
        `linkages` is of none of these types.
    GeometryError
        The linkages have different structures.
    ValueError
        `alphas` is no array of real numbers, `out` does not fit, or the kernel is unavailable.

    Examples
    --------
    >>> import numpy as np
    >>> from klann_ros.kinematics import shipped_linkage
    >>> poses = linkage_poses(shipped_linkage('jansen'), np.linspace(0.0, 2.0 * np.pi, 1000))
    >>> poses.h.shape, int(np.count_nonzero(poses.reason))
    ((1000, 2), 0)

    """
    is_single, variants = _variants(linkages)
    crank_angles = real_array('alphas', alphas)
    angle_samples = crank_angles.flat[:: max(1, crank_angles.size // MAX_ANGLE_SAMPLES)]
    warn_of_degrees('alphas', angle_samples.tolist())
    count = 0 if variants is None else len(variants)
    shape = crank_angles.shape if is_single else (count, *crank_angles.shape)
    structure = None if variants is None else variants.base.structure
    names = tuple(d.name for d in structure.dimensions) if gradients and structure else ()
    axes: dict[str, tuple[int, ...]] = {'h': (2,)}
    if angles:
        axes['angles'] = (len(structure.bodies) - 1 if structure else 0,)
    if points:
        axes['points'] = (len(structure.points) if structure else 0, 2)
    axes |= _derivative_axes(axes, len(names), velocities=velocities, gradients=gradients)
    del axes['h']
    if transmission_angles:
        axes['transmission_angles'] = (len(structure.groups) if structure else 0,)
    arrays: dict[str, Any] = {name: _empty(shape, axes[name]) for name in axes}
    poses = LinkagePoses(
        np.empty((*shape, 2)) if out is None else out,
        np.empty(shape, dtype=np.uint8),
        **arrays,
        dimension_names=names,
    )
    table = (count, crank_angles.size)
    h = poses.h.reshape(*table, 2) if out is None else _checked(out, shape, table)
    kernel_class = choose_kernel(kernel, prod(shape))
    if np.may_share_memory(h, crank_angles):
        # Results must not overwrite crank angles that are still to be read.
        crank_angles = crank_angles.copy()
    if variants is not None:
        for name, name_axes in axes.items():
            arrays[name] = arrays[name].reshape(*table, *name_axes)
        tables = LinkagePoses(h, poses.reason.reshape(table), **arrays)
        _fill(variants, crank_angles.reshape(-1), tables, kernel_class, progress)
    poses.reason.setflags(write=False)
    for array in poses.arrays().values():
        if array is not out:
            array.setflags(write=False)
    return poses


def _derivative_axes(
    axes: Mapping[str, tuple[int, ...]], count: int, *, velocities: bool, gradients: bool
) -> dict[str, tuple[int, ...]]:
    """Return the last axes of the derivatives by the crank angle, and by `count` dimensions."""
    derivatives: dict[str, tuple[int, ...]] = {}
    for name, name_axes in axes.items():
        if velocities:
            derivatives[f'{name}_1'] = name_axes
        if gradients:
            derivatives[f'{name}_gradient'] = (*name_axes, count)
    if velocities and gradients:
        derivatives['h_1_gradient'] = (2, count)
    return derivatives


def _variants(linkages: Any) -> tuple[bool, Variants | None]:
    """Return whether it is a single linkage, and the variants; None without any."""
    if isinstance(linkages, Variants):
        return False, linkages
    if isinstance(linkages, str) or not isinstance(linkages, Iterable):
        return True, Variants.of([as_linkage(linkages)])
    legs = list(linkages)
    return False, Variants.of(map(as_linkage, legs)) if legs else None


def _empty(shape: tuple[int, ...], axes: tuple[int, ...]) -> FloatArray:
    """Return an array of (*shape, *axes); many last axes are first in memory: rows of poses."""
    if prod(axes) <= MAX_INTERLEAVED:
        return np.empty((*shape, *axes))
    first = range(len(axes))
    return np.moveaxis(np.empty((*axes, *shape)), first, [n - len(axes) for n in first])


def _checked(out: object, shape: tuple[int, ...], table: tuple[int, int]) -> FloatArray:
    """Return `out` as a table of n linkages at k crank angles, shape (n, k, 2)."""
    if not isinstance(out, np.ndarray) or out.dtype != np.float64:
        kind = out.dtype if isinstance(out, np.ndarray) else type(out).__name__
        raise ValueError(f'out is refused: it must be an array of float64, not {kind}')
    if out.shape != (*shape, 2):
        raise ValueError(f'out is refused: its shape must be {(*shape, 2)}, not {out.shape}')
    if not out.flags.writeable:
        raise ValueError('out is refused: it is read-only')
    view = out.reshape(*table, 2)
    if out.size and not np.may_share_memory(view, out):
        msg = f'out is refused: its strides {out.strides} do not let it be filled without a copy'
        raise ValueError(msg)
    return view


def _fill(
    variants: Variants,
    alphas: AnyArray,
    results: LinkagePoses,
    kernel: Any,
    progress: Progress | None,
) -> None:
    """
    Fill in the results, tables of n rows and k columns: n variants at k crank angles [rad].

    `kernel` is the class of a kernel.
    """
    pinned = PinnedDyads(variants, results, kernel) if variants.base.two_circles else None
    is_dyadic = variants.base.is_dyadic
    changing = changing_linkages(variants) if is_dyadic else {}
    done = 0
    total = results.reason.size
    # Missing poses become NaN on the way; the reasons are computed from these.
    with np.errstate(all='ignore'):
        for rows, columns in _blocks(len(variants), alphas.size, one_by_one=not is_dyadic):
            for part, linkage in _parts(rows, changing):
                if pinned is not None and linkage is None:
                    pinned.fill(part, columns, alphas)
                else:
                    block = part_of(results, part, columns)
                    fill_blockwise(variants, part, alphas[columns], block, linkage)
            done += (rows.stop - rows.start) * (columns.stop - columns.start)
            if progress is not None:
                progress(done, total)


def _parts(rows: slice, changing: Mapping[int, Linkage]) -> Iterator[tuple[slice, Linkage | None]]:
    """Yield the rows of linkages with change points one by one, the others together."""
    start = rows.start
    for i in sorted(i for i in changing if rows.start <= i < rows.stop):
        if start < i:
            yield slice(start, i), None
        yield slice(i, i + 1), changing[i]
        start = i + 1
    if start < rows.stop:
        yield slice(start, rows.stop), None


def _blocks(legs: int, angles: int, *, one_by_one: bool) -> Iterator[tuple[slice, slice]]:
    """Yield rows and columns of blocks: all linkages at the first crank angles, and so on."""
    for first in range(0, angles, BLOCK_SIZE):
        columns = slice(first, min(first + BLOCK_SIZE, angles))
        step = 1 if one_by_one else BLOCK_SIZE // (columns.stop - first)
        for leg in range(0, legs, step):
            yield slice(leg, min(leg + step, legs)), columns


# Measured or recorded poses have coordinates of shape (n, number of angles).


def vectors(leg: Any, angles: FloatArray) -> list[FloatArray]:
    """Return the bodies' vectors u of each pose, the common input of the other functions."""
    structure = as_linkage(leg).structure
    angles = real_array('angles', angles)
    if angles.shape[1:] != (len(structure.bodies),):
        shape = f'(n, {len(structure.bodies)})'
        raise ValueError(f'angles is refused: its shape must be {shape}, not {angles.shape}')
    with np.errstate(invalid='ignore', over='ignore'):
        return joints.body_vectors(structure, [*angles.T])


def loop_errors(leg: Any, angles: FloatArray, u: joints.Vectors | None = None) -> FloatArray:
    """
    Return the closure error of each pose, the Euclidean norm of f, shape (n,) [m].

    NaN where a coordinate is not finite. `u` are the poses' `vectors`, if known.
    """
    linkage = as_linkage(leg)
    w, c = linkage.equations
    u = vectors(leg, angles) if u is None else u
    with np.errstate(invalid='ignore', over='ignore'):
        f = np.stack(u, axis=-1) @ w.T + c
        return np.asarray(np.sqrt((f.real**2 + f.imag**2).sum(axis=1)))


def feet(leg: Any, angles: FloatArray, u: joints.Vectors | None = None) -> FloatArray:
    """Return the foot H of each pose, shape (n, 2) [m], NaN as for `loop_errors`."""
    linkage = as_linkage(leg)
    terms, constant = linkage.point_rows[linkage.foot]
    u = vectors(leg, angles) if u is None else u
    with np.errstate(invalid='ignore', over='ignore'):
        start = np.full(len(angles), constant, dtype=np.complex128)
        h = joints.vector_sum(terms, u, start)
    return plane_vectors(h)


def differences(leg: Any, x: FloatArray, y: FloatArray) -> FloatArray:
    """
    Return the differences of poses' coordinates without the crank's, shape (n, k - 1).

    Angles modulo a turn, in [-pi, pi] [rad]; distances relative to the linkage's size.
    """
    linkage = as_linkage(leg)
    slides = np.array([body.slides for body in linkage.structure.bodies[1:]])
    with np.errstate(invalid='ignore', over='ignore'):
        difference = x - y
        return np.where(slides, difference / linkage.size, wrapped(difference))


def wrapped(angles: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi], unchanged if within already; NaN for infinite ones."""
    with np.errstate(over='ignore', invalid='ignore'):
        return np.asarray(angles - TURN * np.round(angles / TURN))


def transmission_angles(leg: Any, angles: FloatArray) -> FloatArray:
    """Return the transmission angles of each pose, one a block [rad]; see `loop_errors`."""
    linkage = as_linkage(leg)
    u = vectors(leg, angles)
    with np.errstate(invalid='ignore', over='ignore'):
        return np.column_stack([block.transmission_angle(u) for block in linkage.blocks])
