"""Whether each pose is the right one for its crank angle, and each foot that of its pose."""

from collections.abc import Iterator
from typing import NamedTuple

from klann_ros.review.finding import Finding, Severity
from klann_ros.review.limits import Limits
from klann_ros.review.pairing import pairs
from klann_ros.review.resolved import Resolved
from klann_ros.review.reviewed import Review, ReviewedLeg
import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]


def check(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with poses; of one pose the first thing only, as the rest follows."""
    for leg in review.legs:
        if leg.resolved is not None:
            wrong = Wrong.of(leg.resolved, review.limits)
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


def _poses(
    review: Review, leg: ReviewedLeg, resolved: Resolved, wrong: Wrong
) -> Iterator[Finding]:
    garbled, open_, unreachable, flipped = wrong
    if garbled.any():
        meaning = 'solver_node never publishes such a pose: something else does'
        yield _finding(review, leg, 'nan', garbled, 'have an angle that is not finite', meaning)
    if open_.any():
        text = f'do not close the loops (by up to {resolved.residuals[open_].max():.3g} m)'
        meaning = 'the leg that was solved is not the one that the run tells'
        yield _finding(review, leg, 'closure', open_, text, meaning)
    if unreachable.any():
        text = 'stand at a crank angle that the leg cannot reach'
        meaning = 'they close all the same, within the limit: the leg is at its very limit there'
        yield _finding(review, leg, 'reach', unreachable, text, meaning)
    if flipped.any():
        worst = resolved.angle_errors[flipped].max()
        text = f'are not the assembly of the leg (by up to {worst:.3g} rad)'
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
        (garbled, 'nan', 'feet (point_h) are not finite'),
        (wrong, 'foot', 'feet (point_h) are not where the angles of their poses put them'),
    ):
        if which.any():
            worst = resolved.foot_errors[which].max()
            by = f' (by up to {worst:.3g} m)' if np.isfinite(worst) else ''
            time = feet.times[int(np.argmax(which))]
            meaning = 'angles and foot contradict each other: the bent bodies, or GH, are others'
            yield Finding(
                check_,
                Severity.ERROR,
                f'{int(which.sum())} of {len(which)} {text}{by}',
                meaning if check_ == 'foot' else 'solver_node never publishes such a foot',
                review.recording.since_start(time),
                leg.recording.title,
            )


def _follow(leg: ReviewedLeg, wrong: Flags) -> Flags:
    """Return which feet belong to wrong poses."""
    of_feet, of_poses = pairs(leg.judged.feet.stamps, leg.judged.poses.stamps)
    follow = np.zeros(len(leg.judged.feet), dtype=bool)
    follow[of_feet] = wrong[of_poses]
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
