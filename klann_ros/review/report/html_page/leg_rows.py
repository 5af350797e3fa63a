"""A leg's poses as the page has them: a row each, of long runs those that tell the most."""

from typing import Any

from klann_ros.review.limits import Limits
from klann_ros.review.loading.layouts import Floats, Times
from klann_ros.review.pairing import pairs
from klann_ros.review.reviewed import Review, ReviewedLeg
import numpy as np

from . import packed
from .kept_rows import kept_rows, Rows

# What a number takes in the page, before base64 [bytes].
_SIZE = 4


def pose_rows(leg: ReviewedLeg, review: Review, most_bytes: float) -> dict[str, Any]:
    """Return a leg's poses, with what belongs to each: its foot, its velocities, how it closes."""
    poses, rates = leg.recording.poses, leg.recording.rates
    count = len(poses)
    feet = _paired_feet(leg)
    residuals, mu = _judgement(leg)
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


def _paired_feet(leg: ReviewedLeg) -> Floats:
    """Return the recorded foot of each pose; NaN where there is none."""
    poses, recorded = leg.recording.poses, leg.recording.feet
    feet = np.full((len(poses), 2), np.nan)
    of_feet, of_poses = pairs(recorded.stamps, poses.stamps)
    feet[of_poses] = recorded.values[of_feet]
    return feet


def _judgement(leg: ReviewedLeg) -> tuple[Floats, Floats]:
    """Return residuals and transmission angles; NaN for poses that were not judged."""
    count = len(leg.recording.poses)
    if leg.resolved is None:
        return np.full(count, np.nan), np.empty((count, 0))
    known = leg.resolved.transmission_angles
    if len(known) == count:
        return leg.resolved.residuals, known
    before = count - len(known)
    unknown = np.full((before, known.shape[1]), np.nan)
    return (
        np.concatenate([np.full(before, np.nan), leg.resolved.residuals]),
        np.concatenate([unknown, known]),
    )


def _gaps(times: Times, limits: Limits) -> Rows:
    """Return the rows after which there is a gap, as the check for gaps has it."""
    steps = np.diff(times) / 1e9
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    limit = max(limits.gap_periods * float(np.median(steps)), limits.gap_time)
    return np.flatnonzero(steps > limit)


def _found(leg: ReviewedLeg, review: Review) -> Rows:
    """Return the poses at which something was found: whoever jumps there shall see them."""
    seconds = [finding.time for finding in review.findings if finding.time is not None]
    moments = review.recording.start + np.array(seconds) * 1e9
    times = leg.recording.poses.times
    return np.minimum(np.searchsorted(times, moments), len(times) - 1)
