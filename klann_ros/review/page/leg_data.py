"""A leg as the page has it: its shape, and its poses, of long runs those that tell the most."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import AnyLeg
from klann_ros.review.model.figures import path_of
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.review.model.times import Floats, RowIndices, Times
from klann_ros.web.shape import leg_shape
import numpy as np
from numpy.typing import ArrayLike

from . import packed


def kept_rows(
    count: int, columns: Sequence[Floats], most: int, needed: ArrayLike = ()
) -> RowIndices:
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
        About so many rows may be kept.
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
    kept: RowIndices = np.unique(np.concatenate(rows))
    return kept


def _greatest(column: Floats, stretches: int) -> RowIndices:
    """Return where the greatest value of each stretch is."""
    size = -(-len(column) // stretches)
    known = np.where(np.isnan(column), -np.inf, column)
    whole = len(known) // size
    begins = np.arange(whole) * size
    table = known[slice(whole * size)].reshape(whole, size)
    rows: RowIndices = begins + table.argmax(axis=1)
    rest = known[slice(whole * size, None)]
    return np.append(rows, whole * size + rest.argmax()) if rest.size else rows


def drawn_leg(leg: AnyLeg) -> dict[str, Any]:
    """Return a leg's shape, with the path that its foot has by the geometry."""
    return {**leg_shape(leg), **_path(leg)}


def _path(leg: AnyLeg) -> dict[str, Any]:
    """Return the path that the foot has by the geometry, and whether it ends where it began."""
    path = path_of(leg.linkage)
    if path is None:
        return {'path': None}
    return {'path': [packed.floats(s) for s in path.h.T], 'closed': path.full_turn}


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
    rows = kept_rows(count, columns, most, [*gaps, *(gaps + 1), *_found(leg, review)])
    kept = poses.values[rows]
    return {
        'of': count,
        'times': packed.times((poses.times[rows] - review.recording.start) / 1e9),
        'turns': packed.turns(kept[:, 0]),
        'angles': [
            packed.floats(column) if slides else packed.angles(column)
            for column, slides in zip(kept.T, leg.recording.solver.slides, strict=True)
        ],
        'rates': [packed.floats(column) for column in rates[rows].T] if has_rates else None,
        'foot': [packed.floats(column) for column in feet[rows].T],
        'residuals': packed.floats(residuals[rows]),
        'transmission': [packed.floats(column) for column in mu[rows].T],
        # After these rows there is nothing for a while.
        'gaps': np.searchsorted(rows, gaps).tolist(),
    }


def foot_rows(leg: ReviewedLeg, review: Review, most_bytes: float) -> dict[str, Any]:
    """Return a leg's feet without poses."""
    feet = leg.recording.feet
    columns = list(feet.values.T)
    rows = kept_rows(len(feet), columns, int(most_bytes / (3 * _SIZE)))
    return {
        'of': len(feet),
        'times': packed.times((feet.times[rows] - review.recording.start) / 1e9),
        'foot': [packed.floats(column[rows]) for column in columns],
        'gaps': [],
    }


def _gaps(times: Times, limits: Limits) -> RowIndices:
    """Return the rows after which there is a gap, as the check for gaps has it."""
    steps = np.diff(times) / 1e9
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    limit = max(limits.gap_periods * float(np.median(steps)), limits.gap_time)
    return np.flatnonzero(steps > limit)


def _found(leg: ReviewedLeg, review: Review) -> RowIndices:
    """Return the poses at which something was found: whoever jumps there shall see them."""
    seconds = [finding.time for finding in review.findings if finding.time is not None]
    moments = review.recording.start + np.array(seconds) * 1e9
    times = leg.recording.poses.times
    return np.minimum(np.searchsorted(times, moments), len(times) - 1)
