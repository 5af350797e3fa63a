"""Check motion: jumps and standstill of the crank, drift of the path, tracking of a walker."""

from collections.abc import Iterator
from math import degrees, nan

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE, TURN, unwrapped
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.times import median, merge_intervals, overlaps, pairs, time_steps
from klann_ros.sanitize.text import listed, times as repeated
import numpy as np

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
        has_one_solver = leg.answers.duplicates.solvers == 1
        if leg.errors is None and len(leg.evaluated.feet) and has_one_solver:
            yield from _drift(review, leg.evaluated)


def back_and_forth(review: Review, leg: LegRecording) -> IndexArray:
    """Return the inputs after which the crank jumps, and back at its next jump: two sources."""
    steps = np.diff(unwrapped(leg.cranks.values[:, 0]))
    jumps = np.flatnonzero(np.abs(steps) > review.limits.crank_jump)
    jump_sizes = steps[jumps]
    returns = np.abs(jump_sizes[:-1] + jump_sizes[1:]) < np.abs(jump_sizes[:-1]) / 2
    if _is_shared(review, leg):
        # Under load the inputs of each publisher arrive in blocks, with few jumps between them.
        min_swaps = 2.0
    else:
        # One source may rock the crank, but not between two inputs.
        returns &= np.diff(jumps) == 1
        min_swaps = max(_MIN_SWAPS, _MIN_SWAP_SHARE * len(steps))
    swaps = jumps[:-1][returns]
    return swaps if len(swaps) >= min_swaps else swaps[:0]


def _is_shared(review: Review, leg: LegRecording) -> bool:
    return len(leg.crank_topics) > 1 or review.recording.is_shared(leg.crank_topics)


def _swaps(review: Review, leg: LegRecording, swaps: IndexArray) -> Finding:
    max_jump = degrees(np.abs(np.diff(unwrapped(leg.cranks.values[:, 0]))[swaps]).max())
    repetition = repeated(swaps.size)
    text = f'the crank angle jumps back and forth {repetition}, by up to {max_jump:.3g} deg'
    topics = listed(sorted(leg.crank_topics))
    meaning = f'two sources alternate, or an encoder slips ({topics})'
    if _is_shared(review, leg):
        meaning = f'multiple publishers set the crank at once ({topics}), each with its own angle'
    time = review.since_start(leg.cranks.times[swaps[0] + 1])
    return Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _jumps(review: Review, leg: LegRecording) -> Iterator[Finding]:
    """Yield jumps of the crank angle that neither its rate nor lost messages explain."""
    # `check_answers` finds invalid angles; NaN fails the comparison.
    angles = leg.cranks.values[:, 0]
    is_valid = np.abs(angles) <= MAX_CRANK_ANGLE
    alphas = unwrapped(angles[is_valid])
    times = leg.cranks.times[is_valid]
    if len(alphas) < 2:
        return
    steps = np.abs(np.diff(alphas))
    median_step = median(steps)
    period = median(time_steps(times))
    limit = max(review.limits.crank_jump, _JUMP_RATIO * median_step)
    jumps = np.flatnonzero(steps > limit)
    # A new publisher may start at another angle.
    restarts = review.recording.restarts_on(leg.crank_topics)
    unrecorded = merge_intervals([*review.recording.unrecorded, *restarts])
    jumps = jumps[~overlaps(times[jumps], times[jumps + 1], unrecorded)]
    # The crank turns on while messages are lost or delayed.
    waits = (times[jumps + 1] - times[jumps]) / 1e9
    is_unseen = waits > max(_MISSING_RATIO * period, review.limits.gap_time)
    # Where it stands at times, its speed is that before or after.
    around = np.concatenate([steps[:1], steps, steps[-1:]])
    usual_steps = np.minimum(np.maximum(around[jumps], around[jumps + 2]), limit)
    usual_rates = np.maximum(usual_steps, median_step) / max(period, _MIN_PERIOD)
    unseen_rotations = _MISSING_RATIO * usual_rates * waits * is_unseen
    jumps = jumps[steps[jumps] - unseen_rotations > limit]
    if jumps.size:
        max_jump = degrees(steps[jumps].max())
        text = f'the crank angle jumps {repeated(jumps.size)}, by up to {max_jump:.3g} deg'
        meaning = 'the angle was set, an encoder slips, or inputs were lost before publishing'
        # An angle in degrees begins again at 360, or at 180.
        if np.abs(steps[jumps] - 360.0).max() <= max(2.0 * median_step, 1.0):
            meaning = 'the angle is in degrees, and has to be in radians'
        time = review.since_start(times[jumps[0] + 1])
        yield Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _standstill(review: Review, leg: LegRecording) -> Iterator[Finding]:
    """Yield the longest standstill of a crank that turns at other times."""
    alphas = leg.cranks.values[:, 0]
    times = leg.cranks.times
    changes = np.flatnonzero(alphas[1:] != alphas[:-1])
    if not changes.size:
        return
    steps = time_steps(times)
    # The time of gaps does not count.
    is_regular = steps <= Limits().max_interval(median(steps))
    elapsed = np.concatenate([[0.0], np.cumsum(steps * is_regular)])
    firsts = np.append(0, changes + 1)
    lasts = np.append(changes, len(times) - 1)
    durations = elapsed[lasts] - elapsed[firsts]
    longest = int(np.argmax(durations))
    duration = durations[longest]
    if duration > _MIN_STANDSTILL:
        text = f'the crank stands still for {duration:.1f} s, while its angle is published'
        meaning = 'expected at rest; otherwise the sensor is frozen'
        time = review.since_start(times[firsts[longest]])
        yield Finding('frozen', Severity.NOTE, text, meaning, time, leg.title)


def _drift(review: Review, leg: LegRecording) -> Iterator[Finding]:
    drift = _path_drift(leg)
    if drift > review.limits.path_drift:
        text = f'the foot path drifts by {1e3 * drift:.3g} mm from the first to the last part'
        meaning = 'equal crank angles give different foot positions: a length has changed'
        yield Finding('drift', Severity.WARNING, text, meaning, leg=leg.title)


def _path_drift(leg: LegRecording) -> float:
    """Return how far the foot paths of the first and the last quarter are apart; NaN if short."""
    of_feet, of_poses = pairs(leg.feet.stamps, leg.poses.stamps)
    alphas = leg.poses.values[of_poses, 0]
    feet = leg.feet.values[of_feet]
    is_finite = np.isfinite(alphas) & np.isfinite(feet).all(axis=1)
    alphas = alphas[is_finite]
    feet = feet[is_finite]
    quarter = len(alphas) // _DRIFT_PARTS
    if quarter < _DRIFT_PARTS or min(np.ptp(alphas[:quarter]), np.ptp(alphas[-quarter:])) < TURN:
        return nan
    first_feet, is_exact = _interpolated(alphas[:quarter], feet[:quarter], alphas[-quarter:])
    distances = np.hypot(*(feet[-quarter:] - first_feet).T)[is_exact]
    return float(distances.max()) if distances.size else nan


def _interpolated(
    alphas: FloatArray, feet: FloatArray, new_alphas: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return feet at other crank angles, and where the interpolation is exact enough."""
    new_angles = np.mod(new_alphas, TURN)
    columns = [np.interp(new_angles, alphas, column, period=TURN) for column in feet.T]
    nodes = np.sort(np.mod(alphas, TURN))
    nodes = np.concatenate([nodes[-1:] - TURN, nodes, nodes[:1] + TURN])
    next_nodes = np.clip(np.searchsorted(nodes, new_angles), 1, len(nodes) - 1)
    # The error is this half product times the curvature of the path.
    half_products = (new_angles - nodes[next_nodes - 1]) * (nodes[next_nodes] - new_angles) / 2
    return np.column_stack(columns), half_products < _MAX_CHORD


def check_walking(review: Review) -> Iterator[Finding]:
    """Yield crank lag, phase error and odometry error above their limits."""
    limits = review.limits
    for walk in review.walks:
        title = walk.namespace.lstrip('/')
        lag = walk.crank_lag
        phase = walk.phase_error
        if lag > limits.crank_lag and walk.lag_time is not None:
            text = f'a crank was up to {degrees(lag):.3g} deg off its command'
            meaning = 'its motor is too weak or blocked, or its encoder jumped'
            time = review.since_start(walk.lag_time)
            yield Finding('crank_lag', Severity.WARNING, text, meaning, time, title)
        if phase > limits.phase and walk.phase_time is not None:
            error = f'up to {degrees(phase):.3g} deg'
            text = f'the phase between two cranks was {error} off its command'
            meaning = 'the gait was not kept; the body may lose its support'
            time = review.since_start(walk.phase_time)
            yield Finding('phase', Severity.WARNING, text, meaning, time, title)
        is_odometry_off = walk.odometry_error > limits.odometry * walk.distance
        if is_odometry_off and walk.odometry_time is not None:
            text = (
                f'odometry was up to {walk.odometry_error:.3g} m off the ground truth over '
                f'{walk.distance:.3g} m, its heading up to {degrees(walk.heading_error):.3g} deg'
            )
            meaning = 'the feet slipped, crank angles were lost, or it turned without an IMU'
            time = review.since_start(walk.odometry_time)
            yield Finding('odometry', Severity.WARNING, text, meaning, time, title)
