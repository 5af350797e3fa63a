"""The data of a leg in its page: shape and poses, thinned out and packed in base64."""

from base64 import b64encode
from collections.abc import Sequence
from math import pi
from typing import Any

from klann_ros.kinematics import AnyLeg
from klann_ros.kinematics.arrays import FloatArray, IndexArray, IntArray
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import linkage_foot_path
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.web.shape import leg_shape
import numpy as np
from numpy.typing import ArrayLike, NDArray

Packed = dict[str, Any]

# The greatest of 32 bits, and what stands for a number that there is none of.
_MAX_INT32 = 2**31 - 1
_MISSING = -(2**31)
_TURN = 2.0 * pi


def pack_floats(values: NDArray[Any]) -> Packed:
    """Pack numbers as float32; NaN stays NaN."""
    with np.errstate(over='ignore'):
        return _packed('f32', values.astype('<f4'))


def pack_times(seconds: FloatArray) -> Packed:
    """Return times to the microsecond, or to 2^-31 of the longest."""
    longest = float(seconds.max(initial=0.0))
    return _scaled(seconds, max(1e-6, longest / _MAX_INT32))


def pack_angles(radians: FloatArray) -> Packed:
    """Return angles modulo a turn, to 2^-32 of it: 1.5e-9 rad, less than 1e-8 of any length."""
    with np.errstate(invalid='ignore', over='ignore'):
        parts = radians / _TURN
        # Of more turns than these no double tells the part.
        parts = np.where(np.abs(parts) <= _MAX_INT32, parts - np.round(parts), np.nan)
        return _scaled(parts * _TURN, _TURN / 2.0**32)


def pack_turns(radians: FloatArray) -> Packed:
    """Return the whole turns that `angles` leaves out."""
    with np.errstate(invalid='ignore', over='ignore'):
        return _scaled(np.round(radians / _TURN), 1.0)


def _scaled(values: FloatArray, scale: float) -> Packed:
    with np.errstate(invalid='ignore', over='ignore'):
        counts = np.round(values / scale)
        known = np.abs(counts) <= _MAX_INT32 + 1.0
    counts = np.where(known, np.clip(counts, -_MAX_INT32, _MAX_INT32), _MISSING)
    packed = _packed('i32', counts.astype('<i4'))
    return {**packed, 'scale': scale}


def _packed(kind: str, array: NDArray[Any]) -> Packed:
    return {'kind': kind, 'data': b64encode(array.tobytes()).decode('ascii')}


def thin_rows(
    count: int, columns: Sequence[FloatArray], most: int, needed: ArrayLike = ()
) -> IndexArray:
    """
    Return the rows to keep, rising: all of them where they are no more than `most`.

    Half of those that are kept are evenly spaced. The others hold the least and the greatest value
    of each column in equal stretches of the run, so that no peak gets lost.

    Parameters
    ----------
    count : int
        How many rows there are.
    columns : sequence of numpy.ndarray, shape (count,)
        What shall keep its extremes; NaN is none.
    most : int
        Approximate maximum of the rows.
    needed : sequence of int
        RowIndices that are kept in any case.

    """
    if count <= most:
        return np.arange(count)
    half = max(most // 2, 2)
    even = np.linspace(0, count - 1, half).astype(np.intp)
    stretches = max(half // (2 * max(len(columns), 1)), 1)
    rows = [even, np.asarray(needed, dtype=np.intp)]
    for column in columns:
        rows += [_greatest(column, stretches), _greatest(-column, stretches)]
    thinned: IndexArray = np.unique(np.concatenate(rows))
    return thinned


def _greatest(column: FloatArray, stretches: int) -> IndexArray:
    """Return where the greatest value of each stretch is."""
    size = -(-len(column) // stretches)
    known = np.where(np.isnan(column), -np.inf, column)
    whole = len(known) // size
    begins = np.arange(whole) * size
    table = known[slice(whole * size)].reshape(whole, size)
    rows: IndexArray = begins + table.argmax(axis=1)
    rest = known[slice(whole * size, None)]
    return np.append(rows, whole * size + rest.argmax()) if rest.size else rows


def leg_drawing(leg: AnyLeg) -> dict[str, Any]:
    """Return a leg's shape, with the path that its foot has by the geometry."""
    return {**leg_shape(leg), **_path(leg)}


def _path(leg: AnyLeg) -> dict[str, Any]:
    """Return the path that the foot has by the geometry, and whether it ends where it began."""
    path = linkage_foot_path(leg.linkage)
    if path is None:
        return {'path': None}
    return {'path': [pack_floats(s) for s in path.h.T], 'closed': path.full_turn}


# What a number takes in the page, before base64 [bytes].
_SIZE = 4


def pose_rows(leg: ReviewedLeg, review: Review, most_bytes: float) -> dict[str, Any]:
    """Return a leg's poses, with what belongs to each: its foot, its velocities, how it closes."""
    poses, rates = leg.recording.poses, leg.recording.rates
    count = len(poses)
    feet = leg.recording.paired_feet()
    residuals, mu = np.full(count, np.nan), np.empty((count, 0))
    if leg.errors is not None:
        residuals = leg.for_all_poses(leg.errors.residuals)
        mu = leg.for_all_poses(leg.errors.transmission_angles)
    has_rates = rates.size > 0 and bool(np.isfinite(rates).any())
    columns = [*poses.values.T[1:], *feet.T, residuals, *mu.T]
    if has_rates:
        columns += list(rates.T)
    # A time, the whole turns and the crank's part of one more; the others are columns.
    most = int(most_bytes / (_SIZE * (3 + len(columns))))
    gaps = _gaps(poses.times, review.limits)
    rows = thin_rows(count, columns, most, [*gaps, *(gaps + 1), *_found(leg, review)])
    values = poses.values[rows]
    return {
        'of': count,
        'times': pack_times((poses.times[rows] - review.recording.start) / 1e9),
        'turns': pack_turns(values[:, 0]),
        'angles': [
            pack_floats(column) if slides else pack_angles(column)
            for column, slides in zip(values.T, leg.recording.solver.slides, strict=True)
        ],
        'rates': [pack_floats(column) for column in rates[rows].T] if has_rates else None,
        'foot': [pack_floats(column) for column in feet[rows].T],
        'residuals': pack_floats(residuals[rows]),
        'transmission': [pack_floats(column) for column in mu[rows].T],
        # After these rows there is nothing for a while.
        'gaps': np.searchsorted(rows, gaps).tolist(),
    }


def foot_rows(leg: ReviewedLeg, review: Review, most_bytes: float) -> dict[str, Any]:
    """Return a leg's feet without poses."""
    feet = leg.recording.feet
    columns = list(feet.values.T)
    rows = thin_rows(len(feet), columns, int(most_bytes / (3 * _SIZE)))
    return {
        'of': len(feet),
        'times': pack_times((feet.times[rows] - review.recording.start) / 1e9),
        'foot': [pack_floats(column[rows]) for column in columns],
        'gaps': [],
    }


def _gaps(times: IntArray, limits: Limits) -> IndexArray:
    """Return the rows after which there is a gap, as the check for gaps has it."""
    steps = np.diff(times) / 1e9
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    limit = max(limits.gap_periods * float(np.median(steps)), limits.gap_time)
    return np.flatnonzero(steps > limit)


def _found(leg: ReviewedLeg, review: Review) -> IndexArray:
    """Return the poses at the times of findings, which the page links to."""
    seconds = [finding.time for finding in review.findings if finding.time is not None]
    moments = review.recording.start + np.array(seconds) * 1e9
    times = leg.recording.poses.times
    return np.minimum(np.searchsorted(times, moments), len(times) - 1)
