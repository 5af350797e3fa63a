"""Whether each pose is the right one for its crank angle, and each foot that of its pose."""

from collections.abc import Iterator
from typing import NamedTuple

from klann_ros.log.wording import verb
from klann_ros.review.finding import Finding, Severity
from klann_ros.review.limits import Limits
from klann_ros.review.pairing import found_in, pairs
from klann_ros.review.resolved import Resolved
from klann_ros.review.reviewed import Review, ReviewedLeg
import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]


def check(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with poses; of one pose the first thing only, as the rest follows."""
    for leg in review.legs:
        if leg.resolved is not None:
            wrong = wrong_poses(leg, leg.resolved, review.limits)
            yield from _poses(review, leg, leg.resolved, wrong)
            yield from _feet(review, leg, leg.resolved, wrong)


class Wrong(NamedTuple):
    """Which poses are wrong, and why; no pose for two reasons."""

    garbled: Flags
    open_: Flags
    unreachable: Flags
    flipped: Flags

    @classmethod
    def of(cls, resolved: Resolved, limits: Limits) -> 'Wrong':
        """Return which poses are wrong."""
        garbled = np.isinf(resolved.residuals)
        open_ = ~garbled & (resolved.residuals > limits.closure)
        closed = ~garbled & ~open_
        sines = np.sin(resolved.transmission_angles).min(axis=1)
        flipped = closed & (resolved.angle_errors * sines > limits.angle)
        return cls(garbled, open_, closed & np.isnan(resolved.angle_errors), flipped)

    def any(self) -> Flags:  # noqa: A003, RUF100 - as NumPy calls it
        """Return which poses are wrong for whatever reason."""
        found: Flags = np.logical_or.reduce(self)
        return found


def wrong_poses(leg: ReviewedLeg, resolved: Resolved, limits: Limits) -> Wrong:
    """Return which poses are wrong, but for those of a second solver, which are found as such."""
    wrong = Wrong.of(resolved, limits)
    excused = leg.answering.surplus.excused(wrong.any())
    for flags in wrong:
        flags[excused] = False
    return wrong


def _poses(
    review: Review, leg: ReviewedLeg, resolved: Resolved, wrong: Wrong
) -> Iterator[Finding]:
    garbled, open_, unreachable, flipped = wrong
    if garbled.any():
        text = f'{verb(int(garbled.sum()), "has", "have")} an angle that is not finite'
        meaning = 'solver_node never publishes such a pose: something else does'
        yield _finding(review, leg, 'nan', garbled, text, meaning)
    if open_.any():
        worst = resolved.residuals[open_].max()
        does = verb(int(open_.sum()), 'does', 'do')
        text = f'{does} not close the loops (by up to {worst:.3g} m)'
        meaning = 'the leg that was solved is not the one that it is held against'
        yield _finding(review, leg, 'closure', open_, text, meaning)
    if unreachable.any():
        stands = verb(int(unreachable.sum()), 'stands', 'stand')
        text = f'{stands} at a crank angle that the leg cannot reach'
        meaning = 'they close all the same, within the limit: the leg is at its very limit there'
        yield _finding(review, leg, 'reach', unreachable, text, meaning)
    if flipped.any():
        worst = resolved.angle_errors[flipped].max()
        is_ = verb(int(flipped.sum()), 'is', 'are')
        text = f'{is_} not the assembly of the leg (by up to {worst:.3g} rad)'
        meaning = 'the loops close, but the leg is put together the other way: the branch flipped'
        yield _finding(review, leg, 'branch', flipped, text, meaning)


def _feet(
    review: Review, leg: ReviewedLeg, resolved: Resolved, wrong_poses: Wrong
) -> Iterator[Finding]:
    feet = leg.judged.feet
    garbled = np.isinf(resolved.foot_errors)
    wrong = ~garbled & (resolved.foot_errors > review.limits.foot)
    if wrong.any():
        wrong &= ~_follow(leg, wrong_poses.any())
    for which, check_, text in (
        (garbled, 'nan', 'finite'),
        (wrong, 'foot', 'where the angles of their poses put them'),
    ):
        if which.any():
            count, worst = int(which.sum()), resolved.foot_errors[which].max()
            is_ = verb(count, 'is', 'are')
            by = f' (by up to {worst:.3g} m)' if np.isfinite(worst) else ''
            time = feet.times[int(np.argmax(which))]
            meaning = 'angles and foot contradict each other: the bent bodies, or GH, are others'
            yield Finding(
                check_,
                Severity.ERROR,
                f'{count} of {len(which)} feet (point_h) {is_} not {text}{by}',
                meaning if check_ == 'foot' else 'solver_node never publishes such a foot',
                review.recording.since_start(time),
                leg.recording.title,
            )


def _follow(leg: ReviewedLeg, wrong: Flags) -> Flags:
    """Return which feet belong to wrong poses, or nobody knows to which."""
    of_feet, of_poses = pairs(leg.judged.feet.stamps, leg.judged.poses.stamps)
    several = leg.judged.poses.stamps[leg.answering.surplus.rows]
    follow = found_in(leg.judged.feet.stamps, several)
    follow[of_feet] |= wrong[of_poses]
    return follow


def _finding(  # noqa: PLR0917 - all of a finding
    review: Review, leg: ReviewedLeg, check_: str, which: Flags, text: str, meaning: str
) -> Finding:
    time = leg.judged.poses.times[int(np.argmax(which))]
    return Finding(
        check_,
        Severity.ERROR,
        f'{int(which.sum())} of {len(which)} poses {text}',
        meaning,
        review.recording.since_start(time),
        leg.recording.title,
    )
