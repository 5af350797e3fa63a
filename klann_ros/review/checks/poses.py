"""Whether each pose is the right one for its crank angle, and each foot that of its pose."""

from collections.abc import Iterator
from typing import NamedTuple

from klann_ros.review.model.limits import Limits
from klann_ros.review.model.pairing import are_among, pairs
from klann_ros.review.model.pose_errors import PoseErrors
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import Flags, Floats
from klann_ros.sanitize.text import verb
import numpy as np


class WrongPoses(NamedTuple):
    """Which poses are wrong, and why; no pose for two reasons."""

    garbled: Flags
    open_: Flags
    unreachable: Flags
    flipped: Flags

    @classmethod
    def of(cls, errors: PoseErrors, limits: Limits) -> 'WrongPoses':
        """Return which poses are wrong."""
        garbled = np.isinf(errors.residuals)
        open_ = ~garbled & (errors.residuals > limits.closure)
        closed = ~garbled & ~open_
        sines = np.sin(errors.transmission_angles).min(axis=1)
        flipped = closed & (errors.angle_errors * sines > limits.angle)
        return cls(garbled, open_, closed & np.isnan(errors.angle_errors), flipped)

    def any(self) -> Flags:  # noqa: A003, RUF100 - as NumPy calls it
        """Return which poses are wrong for whatever reason."""
        found: Flags = np.logical_or.reduce(self)
        return found


def wrong_poses(leg: ReviewedLeg, errors: PoseErrors, limits: Limits) -> WrongPoses:
    """Return which poses are wrong, but for those of a second solver, which are found as such."""
    wrong = WrongPoses.of(errors, limits)
    excused = leg.answering.surplus.excused(wrong.any())
    for flags in wrong:
        flags[excused] = False
    return wrong


class _Fault(NamedTuple):
    """Which poses or feet have a fault, and how to say it."""

    check: str
    which: Flags
    verbs: tuple[str, str]
    text: str
    meaning: str


def check_poses(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with poses; of one pose the first thing only, as the rest follows."""
    for leg in review.legs:
        if leg.errors is None:
            continue
        wrong = wrong_poses(leg, leg.errors, review.limits)
        feet = _feet(leg, leg.errors, review.limits, wrong.any())
        for what, series, faults in (
            ('poses', leg.evaluated.poses, _poses(leg.errors, wrong)),
            ('feet (point_h)', leg.evaluated.feet, feet),
        ):
            for fault in faults:
                if fault.which.any():
                    count = int(fault.which.sum())
                    is_ = verb(count, *fault.verbs)
                    yield Finding(
                        fault.check,
                        Severity.ERROR,
                        f'{count} of {len(fault.which)} {what} {is_} {fault.text}',
                        fault.meaning,
                        review.recording.since_start(series.times[int(np.argmax(fault.which))]),
                        leg.recording.title,
                    )


def _poses(errors: PoseErrors, wrong: WrongPoses) -> Iterator[_Fault]:
    yield _Fault(
        'nan',
        wrong.garbled,
        ('has', 'have'),
        'an angle that is not finite',
        'solver_node never publishes such a pose: something else does',
    )
    yield _Fault(
        'closure',
        wrong.open_,
        ('does', 'do'),
        f'not close the loops{_by_up_to(errors.residuals, wrong.open_, "m")}',
        'the leg that was solved is not the one that it is held against',
    )
    yield _Fault(
        'reach',
        wrong.unreachable,
        ('stands', 'stand'),
        'at a crank angle that the leg cannot reach',
        'they close all the same, within the limit: the leg is at its very limit there',
    )
    yield _Fault(
        'branch',
        wrong.flipped,
        ('is', 'are'),
        f'not the assembly of the leg{_by_up_to(errors.angle_errors, wrong.flipped, "rad")}',
        'the loops close, but the leg is put together the other way: the branch flipped',
    )


def _feet(
    leg: ReviewedLeg, errors: PoseErrors, limits: Limits, wrong_poses_: Flags
) -> Iterator[_Fault]:
    garbled = np.isinf(errors.foot_errors)
    yield _Fault(
        'nan', garbled, ('is', 'are'), 'not finite', 'solver_node never publishes such a foot'
    )
    wrong = ~garbled & (errors.foot_errors > limits.foot)
    if wrong.any():
        wrong &= ~_follow(leg, wrong_poses_)
    by = _by_up_to(errors.foot_errors, wrong, 'm')
    yield _Fault(
        'foot',
        wrong,
        ('is', 'are'),
        f'not where the angles of their poses put them{by}',
        'angles and foot contradict each other: the bent bodies, or GH, are others',
    )


def _by_up_to(errors: Floats, which: Flags, unit: str) -> str:
    """Return how great some errors are at most, in words."""
    return f' (by up to {errors[which].max():.3g} {unit})' if which.any() else ''


def _follow(leg: ReviewedLeg, wrong: Flags) -> Flags:
    """Return which feet belong to wrong poses, or nobody knows to which."""
    of_feet, of_poses = pairs(leg.evaluated.feet.stamps, leg.evaluated.poses.stamps)
    several = leg.evaluated.poses.stamps[leg.answering.surplus.rows]
    follow = are_among(leg.evaluated.feet.stamps, several)
    follow[of_feet] |= wrong[of_poses]
    return follow
