"""Check each pose against its crank angle, and each foot against its pose."""

from collections.abc import Iterator
from typing import NamedTuple

from klann_ros.kinematics.arrays import BoolArray, FloatArray
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import PoseErrors
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import isin, pairs
from klann_ros.sanitize.text import verb
import numpy as np


class WrongPoses(NamedTuple):
    """Flags of the wrong poses by fault; the faults exclude each other."""

    garbled: BoolArray
    open_: BoolArray
    unreachable: BoolArray
    flipped: BoolArray

    @classmethod
    def of(cls, errors: PoseErrors, limits: Limits) -> 'WrongPoses':
        """Return which poses are wrong."""
        garbled = np.isinf(errors.residuals)
        open_ = ~garbled & (errors.residuals > limits.closure)
        closed = ~garbled & ~open_
        sines = np.sin(errors.transmission_angles).min(axis=1)
        flipped = closed & (errors.angle_errors * sines > limits.angle)
        return cls(garbled, open_, closed & np.isnan(errors.angle_errors), flipped)

    def any(self) -> BoolArray:  # noqa: A003, RUF100 - as NumPy calls it
        """Return the poses with any fault."""
        found: BoolArray = np.logical_or.reduce(self)
        return found


def wrong_poses(leg: ReviewedLeg, errors: PoseErrors, limits: Limits) -> WrongPoses:
    """Return the wrong poses, without those of a second solver."""
    wrong = WrongPoses.of(errors, limits)
    explained = leg.answers.duplicates.explained(wrong.any())
    for flags in wrong:
        flags[explained] = False
    return wrong


class _Fault(NamedTuple):
    """A fault: flags of poses or feet, and its texts."""

    check: str
    which: BoolArray
    verbs: tuple[str, str]
    text: str
    meaning: str


def check_poses(review: Review) -> Iterator[Finding]:
    """Yield wrong poses and feet; each pose has one fault at most."""
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
        'solver_node never publishes such a pose: another node did',
    )
    yield _Fault(
        'closure',
        wrong.open_,
        ('does', 'do'),
        f'not close the loops{_by_up_to(errors.residuals, wrong.open_, "m")}',
        'the poses are of a leg with other dimensions',
    )
    yield _Fault(
        'reach',
        wrong.unreachable,
        ('stands', 'stand'),
        'at a crank angle that the leg cannot reach',
        'the loops still close within the limit: the crank is at the end of its range',
    )
    yield _Fault(
        'branch',
        wrong.flipped,
        ('is', 'are'),
        'in another assembly mode than the leg'
        f'{_by_up_to(errors.angle_errors, wrong.flipped, "rad")}',
        'the loops close, but in another assembly mode: the branch flipped',
    )


def _feet(
    leg: ReviewedLeg, errors: PoseErrors, limits: Limits, wrong_poses_: BoolArray
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
        f'not at the position that the angles of their poses give{by}',
        'angles and foot contradict each other: the bent bodies, or GH, have other dimensions',
    )


def _by_up_to(errors: FloatArray, which: BoolArray, unit: str) -> str:
    """Return the largest of some errors in words."""
    return f' (by up to {errors[which].max():.3g} {unit})' if which.any() else ''


def _follow(leg: ReviewedLeg, wrong: BoolArray) -> BoolArray:
    """Return the feet of wrong poses, and those without a unique pose."""
    of_feet, of_poses = pairs(leg.evaluated.feet.stamps, leg.evaluated.poses.stamps)
    several = leg.evaluated.poses.stamps[leg.answers.duplicates.rows]
    follow = isin(leg.evaluated.feet.stamps, several)
    follow[of_feet] |= wrong[of_poses]
    return follow
