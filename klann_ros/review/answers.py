"""What the solver was asked, and what it answered."""

from collections.abc import Iterator

from klann_ros.kinematics import CrankAngleError, KinematicsError
from klann_ros.kinematics.leg_types import Leg
import numpy as np
from numpy.typing import NDArray

from .finding import Finding, since_start
from .recording import Recording

# Why an input has no answer, the cause at its source first.
UNANSWERED = {
    'rejected': '{count} crank angles were none: not finite, or beyond 1e6 rad',
    'reach': '{count} of {asked} crank angles cannot be reached by this leg',
    'answers': '{count} of {asked} crank angles were not answered',
}


def wrong_questions(recording: Recording) -> Iterator[Finding]:
    """Yield whether poses are for another crank angle than the one that was asked."""
    known, asked = _asked(recording)
    alphas = recording.poses.values[known, 0]
    # A double comes through unchanged. What is not finite is wrong by itself, and found as such.
    wrong = np.isfinite(alphas) & (alphas != asked)
    if wrong.any():
        text = (
            f'{int(wrong.sum())} of {len(wrong)} poses are not for the crank angle that was asked'
        )
        first = recording.poses.times[known][int(np.argmax(wrong))]
        yield Finding('alpha', text, since_start(recording, first))


def unanswered(recording: Recording) -> Iterator[Finding]:
    """Yield what was asked and not answered, the run's edges left out."""
    cranks, poses = recording.cranks, recording.poses
    if not len(poses):
        return
    inside = (cranks.stamps >= poses.stamps.min()) & (cranks.stamps <= poses.stamps.max())
    rows = np.flatnonzero(inside & ~np.isin(cranks.stamps, poses.stamps))
    causes = [_cause(alpha, recording.leg) for alpha in cranks.values[rows].tolist()]
    for check, text in UNANSWERED.items():
        of_this = [row for row, cause in zip(rows.tolist(), causes, strict=True) if cause == check]
        if of_this:
            filled = text.format(count=len(of_this), asked=int(inside.sum()))
            first = cranks.times[of_this[0]]
            yield Finding(check, filled, since_start(recording, first))


def _asked(recording: Recording) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """
    Return for which poses the run tells the crank angle that was asked, and these angles [rad].

    It does where one input alone has the pose's stamp.
    """
    cranks = recording.cranks
    stamps, index, counts = np.unique(cranks.stamps, return_index=True, return_counts=True)
    alone = counts == 1
    rows = dict(zip(stamps[alone].tolist(), index[alone].tolist(), strict=True))
    row = np.array([rows.get(stamp, -1) for stamp in recording.poses.stamps.tolist()], dtype=int)
    known = row >= 0
    return known, cranks.values[row[known]]


def _cause(alpha: float, leg: Leg | None) -> str:
    if leg is None:
        return 'answers'
    try:
        leg.closed_form(alpha)
    except CrankAngleError:
        return 'rejected'
    except KinematicsError:
        return 'reach'
    return 'answers'
