"""Whether the crank and the foot moved as a leg can: jumps, drift, standstill."""

from collections.abc import Iterator
from math import nan

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.pairing import pairs
from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.times import (
    Flags,
    Floats,
    intervals,
    median,
    merged,
    overlap,
    RowIndices,
)
from klann_ros.sanitize.text import listed, times as times_
import numpy as np

_TURN = 2 * np.pi
# A change that is so many times the usual one is a jump, and not a fast crank.
_UNUSUAL = 5.0
# An interval that is so many times the usual one: a message is missing, or two are.
_LATE = 1.5
# No two messages are nearer to each other, as a rule [s].
_INSTANT = 1e-6
# The path is compared between the first and the last so many parts of a run.
_PARTS = 4
# Between crank angles so near the path is a straight line, to a tenth of a millimetre [rad^2].
_NEAR = 1e-4
# Who jumps there and back so often, and so great a part of the time, is two.
_SEVERAL, _OFTEN = 10, 0.1
# A crank that does not move for so long stands still [s].
_STANDSTILL = 2.0


def check_motion(review: Review) -> Iterator[Finding]:
    """Yield how the motion is not that of a leg."""
    for leg in review.legs:
        if len(leg.evaluated.cranks):
            swaps = back_and_forth(leg.evaluated, review.limits)
            yield from (
                _swaps(review, leg.evaluated, swaps)
                if swaps.size
                else _jumps(review, leg.evaluated)
            )
            yield from _standstill(review, leg.evaluated)
        # Else the geometry has judged every foot, and more strictly; two solvers have two legs.
        alone = leg.answering.surplus.solvers == 1
        if leg.errors is None and len(leg.evaluated.feet) and alone:
            yield from _drift(review, leg.evaluated)


def back_and_forth(leg: LegRecording, limits: Limits) -> RowIndices:
    """Return after which inputs the crank jumps, and at once back: two sources have two angles."""
    steps = np.diff(leg.cranks.values[:, 0])
    there, back = steps[:-1], steps[1:]
    # NaN and what is infinite is no jump.
    swaps = (np.minimum(np.abs(there), np.abs(back)) > limits.crank_jump) & (
        np.abs(there + back) < np.abs(there) / 2
    )
    rows = np.flatnonzero(swaps)
    return rows if len(rows) > max(_SEVERAL, _OFTEN * len(steps)) else rows[:0]


def _swaps(review: Review, leg: LegRecording, rows: RowIndices) -> Iterator[Finding]:
    by = np.abs(np.diff(leg.cranks.values[:, 0])[rows]).max()
    text = f'the crank angle jumps back and forth {times_(rows.size)}, by up to {by:.3g} rad'
    shared = any(t.shared for t in review.recording.topics if t.name in leg.crank_topics)
    several = shared or len(leg.crank_topics) > 1
    where = f' ({listed(sorted(leg.crank_topics))})'
    meaning = f'several turn the crank at once{where}: each has an angle of its own'
    if not several:
        meaning = f'two sources turn the crank by turns, or an encoder slips{where}'
    time = review.recording.since_start(leg.cranks.times[rows[0] + 1])
    yield Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _jumps(review: Review, leg: LegRecording) -> Iterator[Finding]:
    # What is no crank angle is rejected, and found as such; NaN fails the comparison as well.
    alphas, times = leg.cranks.values[:, 0], leg.cranks.times
    valid = np.abs(alphas) <= MAX_CRANK_ANGLE
    if not valid.all():
        alphas, times = alphas[valid], times[valid]
    if len(alphas) < 2:
        return
    steps = np.abs(np.diff(alphas))
    usual, period = median(steps), median(intervals(times))
    limit = max(review.limits.crank_jump, _UNUSUAL * usual)
    rows = np.flatnonzero(steps > limit)
    # Nor did one that another publisher turns from then on.
    restarts = review.recording.restarts_on(leg.crank_topics)
    holes = merged([*review.recording.holes, *restarts])
    rows = rows[~overlap(times[rows], times[rows + 1], holes)]
    # A crank that turned on unseen, while messages were lost or held up, did not jump.
    waits = (times[rows + 1] - times[rows]) / 1e9
    unseen = waits > max(_LATE * period, review.limits.gap_time)
    turned = _LATE * usual / max(period, _INSTANT) * waits * unseen
    rows = rows[steps[rows] - turned > limit]
    if rows.size:
        text = f'the crank angle jumps {times_(rows.size)}, by up to {steps[rows].max():.3g} rad'
        meaning = 'it was set so, an encoder slips, or inputs were lost before they were published'
        time = review.recording.since_start(times[rows[0] + 1])
        yield Finding('jump', Severity.WARNING, text, meaning, time, leg.title)


def _standstill(review: Review, leg: LegRecording) -> Iterator[Finding]:
    """Yield a crank that says the same for long, and moves at other times."""
    alphas, times = leg.cranks.values[:, 0], leg.cranks.times
    changes = np.flatnonzero(alphas[1:] != alphas[:-1])
    if not changes.size:
        return
    steps = intervals(times)
    # While nothing is said nobody knows.
    said = steps <= max(Limits.gap_periods * median(steps), Limits.gap_time)
    told = np.concatenate([[0.0], np.cumsum(steps * said)])
    firsts, lasts = np.append(0, changes + 1), np.append(changes, len(times) - 1)
    still = told[lasts] - told[firsts]
    longest = int(np.argmax(still))
    if still[longest] > _STANDSTILL:
        text = f'the crank stands still for {still[longest]:.1f} s, while its angle is published'
        meaning = 'as it should be if nobody turned it; else its sensor is frozen'
        time = review.recording.since_start(times[firsts[longest]])
        yield Finding('frozen', Severity.NOTE, text, meaning, time, leg.title)


def _drift(review: Review, leg: LegRecording) -> Iterator[Finding]:
    drift = path_drift(leg)
    if drift > review.limits.path_drift:
        text = f'the path of the foot moves by {drift:.3g} m from the first to the last part'
        meaning = 'the same crank angle gives another foot than before: a length has changed'
        yield Finding('drift', Severity.WARNING, text, meaning, leg=leg.title)


def path_drift(leg: LegRecording) -> float:
    """
    Return how far apart the paths of the first and the last quarter of a run are [m].

    The greatest distance at the same crank angle, interpolated; NaN for less than a turn in each.
    """
    alphas, feet = _feet_by_angle(leg)
    quarter = len(alphas) // _PARTS
    first, last = slice(0, quarter), slice(len(alphas) - quarter, len(alphas))
    if any(np.ptp(alphas[part]) < _TURN for part in (first, last) if quarter) or quarter < _PARTS:
        return nan
    known, is_exact = _interpolated(alphas[first], feet[first], alphas[last])
    apart = np.hypot(*(feet[last] - known).T)[is_exact]
    return float(apart.max()) if apart.size else nan


def _feet_by_angle(leg: LegRecording) -> tuple[Floats, Floats]:
    """Return crank angles and feet of the poses that have one, in the order of time."""
    of_feet, of_poses = pairs(leg.feet.stamps, leg.poses.stamps)
    alphas, feet = leg.poses.values[of_poses, 0], leg.feet.values[of_feet]
    finite = np.isfinite(alphas) & np.isfinite(feet).all(axis=1)
    return alphas[finite], feet[finite]


def _interpolated(alphas: Floats, feet: Floats, at: Floats) -> tuple[Floats, Flags]:
    """Return the feet at crank angles between known ones, and where these are near enough."""
    turned, wanted = np.mod(alphas, _TURN), np.mod(at, _TURN)
    order = np.argsort(turned)
    known = np.concatenate([turned[order[-1:]] - _TURN, turned[order], turned[order[:1]] + _TURN])
    rows = np.concatenate([order[-1:], order, order[:1]])
    after = np.clip(np.searchsorted(known, wanted), 1, len(known) - 1)
    left, right = wanted - known[after - 1], known[after] - wanted
    share = np.divide(left, left + right, out=np.zeros_like(left), where=left + right > 0)
    found = feet[rows[after - 1]] * (1 - share)[:, np.newaxis]
    found += feet[rows[after]] * share[:, np.newaxis]
    # The error of the interpolation is this half product times how sharply the path bends.
    return found, left * right / 2 < _NEAR
