"""Questions that the solver did not answer, and why."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from klann_ros.kinematics import CrankAngleError, KinematicsError, klann_poses, KlannLeg
from klann_ros.kinematics.batch.reason import Reason
from klann_ros.kinematics.leg_types import Leg
from klann_ros.review.loading.holes import Hole, overlap
from klann_ros.review.loading.layouts import Floats, Times
from klann_ros.review.pairing import found_in, Rows
from klann_ros.review.recording import LegRecording
import numpy as np
from numpy.typing import NDArray

# An answer comes so long after its question, at most [ns].
_SOON = 200_000_000


class Cause(IntEnum):
    """Why a question has no answer."""

    NO_ANGLE = 0  # not finite, or beyond what a crank angle may be
    OUT_OF_REACH = 1
    UNKNOWN = 2  # there should be one


class Unanswered(NamedTuple):
    """
    Questions without answer, the run's edges left out.

    Attributes
    ----------
    rows : numpy.ndarray
        Which crank inputs they are.
    causes : numpy.ndarray
        Why each was not answered, a Cause.
    asked : int
        How many questions there are, with and without answer.

    """

    rows: Rows
    causes: NDArray[np.intp]
    asked: int

    def of(self, cause: Cause, times: Times, holes: Sequence[Hole]) -> Rows:
        """Return those of a cause whose log times [ns] are not at a hole in the log."""
        rows = self.rows[self.causes == cause]
        # There either the question or its answer may be lost.
        kept: Rows = rows[~overlap(times[rows] - _SOON, times[rows] + _SOON, holes)]
        return kept


def unanswered(leg: LegRecording) -> Unanswered:
    """Return what a leg was asked and did not answer."""
    cranks, poses = leg.cranks, leg.poses
    if not (len(cranks) and len(poses)):
        return Unanswered(np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp), 0)
    inside = (cranks.stamps >= poses.stamps.min()) & (cranks.stamps <= poses.stamps.max())
    rows = np.flatnonzero(inside & ~found_in(cranks.stamps, poses.stamps))
    causes = _causes(turned(leg, cranks.values[rows, 0]), leg.solver.leg)
    return Unanswered(rows, causes, int(np.count_nonzero(inside)))


def refused(leg: LegRecording, found: Unanswered) -> list[Hole]:
    """Return from when to when a leg was asked what it cannot answer, log times [ns]."""
    times = leg.cranks.times
    rows = found.rows[found.causes != Cause.UNKNOWN]
    begins = times[np.maximum(rows - 1, 0)]
    ends = times[np.minimum(rows + 1, len(times) - 1)]
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def turned(leg: LegRecording, alphas: Floats) -> Floats:
    """Return the leg's crank angles for those of the crank, as solver_node computes them."""
    return leg.solver.direction * alphas + leg.solver.phase


def _causes(alphas: Floats, leg: Leg | None) -> NDArray[np.intp]:
    if leg is None:
        return np.full(len(alphas), Cause.UNKNOWN)
    if isinstance(leg, KlannLeg):
        reasons = klann_poses(leg.geometry, alphas).reason
        known = [reasons == Reason.CRANK_ANGLE, reasons != Reason.SOLVED]
        return np.select(known, [Cause.NO_ANGLE, Cause.OUT_OF_REACH], Cause.UNKNOWN)
    return np.array([_cause(leg, alpha) for alpha in alphas.tolist()], dtype=np.intp)


def _cause(leg: Leg, alpha: float) -> Cause:
    try:
        leg.closed_form(alpha)
    except CrankAngleError:
        return Cause.NO_ANGLE
    except KinematicsError:
        return Cause.OUT_OF_REACH
    return Cause.UNKNOWN
