"""Check motion: jumps and standstill of the crank, drift of the path, tracking of a walker."""

from collections.abc import Iterator
from math import degrees, nan

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.times import median, merge_intervals, overlaps, pairs, time_steps
from klann_ros.sanitize.text import listed, times as times_
import numpy as np

_FULL_TURN = 2 * np.pi
# A jump exceeds the median change by this factor.
_JUMP_RATIO = 5.0
# An interval with missing messages exceeds the median by this factor.
_MISSING_RATIO = 1.5
# Shortest plausible period of messages [s].
_MIN_PERIOD = 1e-6
# Drift compares the first and the last of this number of parts.
_DRIFT_PARTS = 4
# Interpolation is exact to 0.1 mm below this product of distances [rad^2].
_MAX_CHORD = 1e-4
# Jumps there and back of two unknown sources: their number, and their share of all steps.
_MIN_SWAPS, _MIN_SWAP_SHARE = 10, 0.1
# Shortest standstill of a crank that is reported [s].
_MIN_STANDSTILL = 2.0


def check_motion(review: Review) -> Iterator[Finding]:
    """Yield jumps and standstill of the crank, and drift of the foot path."""
    for leg in review.legs:
        if len(leg.evaluated.cranks):
            swaps = back_and_forth(review, leg.evaluated)
            if swaps.size:
                yield _swaps(review, leg.evaluated, swaps)
            else:
                yield from _jumps(review, leg.evaluated)
            yield from _standstill(review, leg.evaluated)
        # With a geometry `check_poses` judges every foot; two solvers may have two legs.
        alone = leg.answers.duplicates.solvers == 1
        if leg.errors is None and len(leg.evaluated.feet) and alone:
            yield from _drift(review, leg.evaluated)


def back_and_forth(review: Review, leg: LegRecording) -> IndexArray:
    """Return the inputs after which the crank jumps, and back at its next jump: two sources."""
    steps = np.diff(leg.cranks.values[:, 0])
    jumps = np.flatnonzero(np.abs(steps) > review.limits.crank_jump)
    there, back = steps[jumps[:-1]], steps[jumps[1:]]
    swaps = np.abs(there + back) < np.abs(there) / 2
    if _is_shared(review, leg):
        # Under load the inputs of each publisher arrive in blocks, with few jumps between them.
        needed = 2.0
    else:
        # One source may rock the crank, but not between two inputs.
        swaps &= np.diff(jumps) == 1
        needed = max(_MIN_SWAPS, _MIN_SWAP_SHARE * len(steps))
    rows = jumps[:-1][swaps]
    return rows if len(rows) >= needed else rows[:0]


def _is_shared(review: Review, leg: LegRecording) -> bool:
    return len(leg.crank_topics) > 1 or review.recording.is_shared(leg.crank_topics)


def _swaps(review: Review, leg: LegRecording, rows: IndexArray) -> Finding:
    by = np.abs(np.diff(leg.cranks.values[:, 0])[rows]).max()
    text = f'the crank angle jumps back and forth {times_(rows.size)}, by up to {by:.3g} rad'
    where = f' ({listed(sorted(leg.crank_topics))})'
    meaning = f'two sources alternate, or an encoder slips{where}'
    if _is_shared(review, leg):
        meaning = f'multiple publishers set the crank at once{where}, each with its own angle'
    time = review.since_start(leg.cranks.times[rows[0] + 1])
    return Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _jumps(review: Review, leg: LegRecording) -> Iterator[Finding]:
    # `check_answers` finds invalid angles; NaN fails the comparison.
    alphas, times = leg.cranks.values[:, 0], leg.cranks.times
    valid = np.abs(alphas) <= MAX_CRANK_ANGLE
    if not valid.all():
        alphas, times = alphas[valid], times[valid]
    if len(alphas) < 2:
        return
    steps = np.abs(np.diff(alphas))
    usual, period = median(steps), median(time_steps(times))
    limit = max(review.limits.crank_jump, _JUMP_RATIO * usual)
    rows = np.flatnonzero(steps > limit)
    # A new publisher may start at another angle.
    restarts = review.recording.restarts_on(leg.crank_topics)
    unrecorded = merge_intervals([*review.recording.unrecorded, *restarts])
    rows = rows[~overlaps(times[rows], times[rows + 1], unrecorded)]
    # The crank turns on while messages are lost or delayed.
    waits = (times[rows + 1] - times[rows]) / 1e9
    unseen = waits > max(_MISSING_RATIO * period, review.limits.gap_time)
    turned = _MISSING_RATIO * usual / max(period, _MIN_PERIOD) * waits * unseen
    rows = rows[steps[rows] - turned > limit]
    if rows.size:
        text = f'the crank angle jumps {times_(rows.size)}, by up to {steps[rows].max():.3g} rad'
        meaning = 'the angle was set, an encoder slips, or inputs were lost before publishing'
        time = review.since_start(times[rows[0] + 1])
        yield Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _standstill(review: Review, leg: LegRecording) -> Iterator[Finding]:
    alphas, times = leg.cranks.values[:, 0], leg.cranks.times
    changes = np.flatnonzero(alphas[1:] != alphas[:-1])
    if not changes.size:
        return
    steps = time_steps(times)
    # The time of gaps does not count.
    regular = steps <= Limits().max_interval(median(steps))
    elapsed = np.concatenate([[0.0], np.cumsum(steps * regular)])
    firsts, lasts = np.append(0, changes + 1), np.append(changes, len(times) - 1)
    still = elapsed[lasts] - elapsed[firsts]
    longest = int(np.argmax(still))
    if still[longest] > _MIN_STANDSTILL:
        text = f'the crank stands still for {still[longest]:.1f} s, while its angle is published'
        meaning = 'expected at rest; otherwise the sensor is frozen'
        time = review.since_start(times[firsts[longest]])
        yield Finding('frozen', Severity.NOTE, text, meaning, time, leg.title)


def _drift(review: Review, leg: LegRecording) -> Iterator[Finding]:
    drift = _path_drift(leg)
    if drift > review.limits.path_drift:
        text = f'the foot path drifts by {drift:.3g} m from the first to the last part'
        meaning = 'equal crank angles give different foot positions: a length has changed'
        yield Finding('drift', Severity.WARNING, text, meaning, leg=leg.title)


def _path_drift(leg: LegRecording) -> float:
    """Return how far the foot paths of the first and the last quarter are apart; NaN if short."""
    of_feet, of_poses = pairs(leg.feet.stamps, leg.poses.stamps)
    alphas, feet = leg.poses.values[of_poses, 0], leg.feet.values[of_feet]
    finite = np.isfinite(alphas) & np.isfinite(feet).all(axis=1)
    alphas, feet = alphas[finite], feet[finite]
    quarter = len(alphas) // _DRIFT_PARTS
    first, last = slice(0, quarter), slice(len(alphas) - quarter, len(alphas))
    if quarter < _DRIFT_PARTS or min(np.ptp(alphas[first]), np.ptp(alphas[last])) < _FULL_TURN:
        return nan
    known, is_exact = _interpolated(alphas[first], feet[first], alphas[last])
    apart = np.hypot(*(feet[last] - known).T)[is_exact]
    return float(apart.max()) if apart.size else nan


def _interpolated(
    alphas: FloatArray, feet: FloatArray, at: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return interpolated feet, and where the interpolation is exact enough."""
    wanted, known = np.mod(at, _FULL_TURN), np.sort(np.mod(alphas, _FULL_TURN))
    found = [np.interp(wanted, alphas, column, period=_FULL_TURN) for column in feet.T]
    known = np.concatenate([known[-1:] - _FULL_TURN, known, known[:1] + _FULL_TURN])
    after = np.clip(np.searchsorted(known, wanted), 1, len(known) - 1)
    left, right = wanted - known[after - 1], known[after] - wanted
    # The error is this half product times the curvature of the path.
    return np.column_stack(found), left * right / 2 < _MAX_CHORD


def check_walking(review: Review) -> Iterator[Finding]:
    """Yield crank lag, phase error and odometry error above their limits."""
    limits, since = review.limits, review.since_start
    for walk in review.walks:
        title, lag, phase = walk.namespace.lstrip('/'), walk.crank_lag, walk.phase_error
        if lag > limits.crank_lag and walk.lag_time is not None:
            text = f'a crank was up to {degrees(lag):.3g} deg off its command'
            meaning = 'its motor is too weak or blocked, or its encoder jumped'
            time = since(walk.lag_time)
            yield Finding('crank_lag', Severity.WARNING, text, meaning, time, title)
        if phase > limits.phase and walk.phase_time is not None:
            off = f'up to {degrees(phase):.3g} deg off its command'
            text = f'the phase between two cranks was {off}'
            meaning = 'the gait was not kept; the body may lose its support'
            time = since(walk.phase_time)
            yield Finding('phase', Severity.WARNING, text, meaning, time, title)
        off_limit = walk.odometry_error > limits.odometry * walk.distance
        if off_limit and walk.odometry_time is not None:
            text = (
                f'odometry was up to {walk.odometry_error:.3g} m off the ground truth over '
                f'{walk.distance:.3g} m, its heading up to {degrees(walk.heading_error):.3g} deg'
            )
            meaning = 'the feet slipped, crank angles were lost, or it turned without an IMU'
            time = since(walk.odometry_time)
            yield Finding('odometry', Severity.WARNING, text, meaning, time, title)
