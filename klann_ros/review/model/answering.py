"""Which questions a leg's solver answered, which it did not and why, and which came back twice."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from klann_ros.kinematics import linkage_poses, Reason
from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
import numpy as np

from .pairing import alone, are_among, many_to_one, rises, stamp_counts, StampCounts
from .recording import LegRecording
from .times import Flags, Floats, RowIndices, Times


class Cause(IntEnum):
    """Why a question has no answer."""

    NO_ANGLE = 0  # not finite, or beyond what a crank angle may be
    OUT_OF_REACH = 1
    UNKNOWN = 2  # there should be one


class Surplus(NamedTuple):
    """Questions with more answers than one."""

    # Shape (n,): which poses answer them.
    rows: RowIndices
    # Shape (n,): which of them each answers, from 0.
    questions: RowIndices
    # Shape (n,): whether no other question has the same stamp: then these are answers to the same
    # one.
    alone: Flags
    # How many answer, if most have equally many from the first to the last; else 1.
    solvers: int

    def excused(self, wrong: Flags) -> RowIndices:
        """Return which poses are wrong, while another answer to the same question is right."""
        is_wrong = wrong[self.rows]
        answered = np.zeros(int(self.questions.max(initial=-1)) + 1, dtype=bool)
        answered[self.questions[~is_wrong]] = True
        excused: RowIndices = self.rows[is_wrong & answered[self.questions]]
        return excused


@dataclass(frozen=True, eq=False)
class Answering:
    """What a leg was asked, and what came of it."""

    # How many questions there are before the first answer, from it to the last, and after that:
    # what the start and the stop cut off is no fault.
    early: int
    asked: int
    late: int
    # How many answers there are to those in between.
    answers: int
    # Which of those were not answered, of all crank inputs.
    rows: RowIndices
    # Why each was not answered, a Cause.
    causes: RowIndices
    # What was answered more than once.
    surplus: Surplus

    def of(self, cause: Cause) -> RowIndices:
        """Return which questions were not answered for a cause."""
        rows: RowIndices = self.rows[self.causes == cause]
        return rows


_NONE = np.empty(0, dtype=np.intp)
_NO_SURPLUS = Surplus(_NONE, _NONE, np.empty(0, dtype=bool), 1)
# Fewer questions than these with several answers tell of no second solver.
_LEAST = 5


def answering(leg: LegRecording) -> Answering:
    """Return what a leg was asked, and what came of it."""
    asked, answers = leg.cranks.stamps, leg.poses.stamps
    if not len(answers):
        return Answering(len(asked), 0, 0, 0, _NONE, _NONE, _NO_SURPLUS)
    early, late = asked < answers.min(), asked > answers.max()
    inside = np.flatnonzero(~(early | late))
    ends = int(np.count_nonzero(early)), int(np.count_nonzero(late))
    if rises(asked) and rises(answers):
        rows = inside[~are_among(asked[inside], answers)]
        causes, count, surplus = _causes(leg, rows), len(inside) - len(rows), _NO_SURPLUS
    else:
        stamps = stamp_counts(asked[inside], answers)
        rows, causes = _unanswered(leg, inside, stamps)
        count, surplus = int(stamps.second.sum()), _surplus(answers, stamps)
    return Answering(ends[0], len(inside), ends[1], count, rows, causes, surplus)


def repeated(stamps: Times) -> Surplus:
    """Return which answers share a stamp, for a run without the questions."""
    return (
        _NO_SURPLUS if rises(stamps) else _surplus(stamps, stamp_counts(np.unique(stamps), stamps))
    )


def asked_angles(leg: LegRecording) -> tuple[RowIndices, Floats]:
    """
    Return for which poses the run tells the crank angle that was asked, and these angles [rad].

    It does where one input alone has the pose's stamp; and if the run does not tell direction and
    phase of the leg, only if most poses are for the crank's own angles.
    """
    rows = alone(leg.cranks.stamps)
    known, of_cranks = many_to_one(leg.poses.stamps, leg.cranks.stamps[rows])
    asked = _turned(leg, leg.cranks.values[rows[of_cranks], 0])
    if not leg.solver.nodes and 2 * np.count_nonzero(leg.poses.values[known, 0] != asked) > len(
        known
    ):
        return known[:0], asked[:0]
    return known, asked


def _turned(leg: LegRecording, alphas: Floats) -> Floats:
    """Return the leg's crank angles for those of the crank, as solver_node computes them."""
    return leg.solver.direction * alphas + leg.solver.phase


def _unanswered(
    leg: LegRecording, inside: RowIndices, stamps: StampCounts
) -> tuple[RowIndices, RowIndices]:
    """
    Return which inputs have no answer, and why.

    Where a stamp has fewer answers than questions, those are meant that cannot be answered, or
    else the last.
    """
    lacking = stamps.first - stamps.second
    rows = np.flatnonzero(lacking[stamps.of_first] > 0)
    causes, groups = _causes(leg, inside[rows]), stamps.of_first[rows]
    order = np.lexsort([-rows, causes == Cause.UNKNOWN, groups])
    rows, causes, groups = rows[order], causes[order], groups[order]
    place = np.arange(len(rows)) - np.searchsorted(groups, groups)
    kept = np.flatnonzero((place < lacking[groups]) | (causes != Cause.UNKNOWN))
    kept = kept[np.argsort(rows[kept])]
    found: RowIndices = inside[rows[kept]]
    return found, causes[kept]


def _surplus(answers: Times, stamps: StampCounts) -> Surplus:
    """Return which answers are to questions that have more than one."""
    many = stamps.second > stamps.first
    if not many.any():
        return _NO_SURPLUS
    places = np.searchsorted(stamps.stamps, answers)
    np.minimum(places, len(stamps.stamps) - 1, out=places)
    rows = np.flatnonzero(many[places] & (stamps.stamps[places] == answers))
    first, last = np.flatnonzero(many)[[0, -1]]
    share = np.count_nonzero(many) / (last + 1 - first)
    each = stamps.second[many] / stamps.first[many]
    is_steady = np.count_nonzero(many) >= _LEAST and share >= 0.5
    solvers = max(2, round(float(np.median(each)))) if is_steady else 1
    return Surplus(rows, places[rows], stamps.first[places[rows]] == 1, solvers)


def _causes(leg: LegRecording, rows: RowIndices) -> RowIndices:
    """Return why a solver would not answer some inputs."""
    if not rows.size:
        return rows
    alphas, solved = _turned(leg, leg.cranks.values[rows, 0]), leg.solver.leg
    if solved is None or not (leg.solver.nodes or len(asked_angles(leg)[0])):
        # Nobody knows which angle the leg had; but none of this one's can be any.
        is_angle = np.abs(alphas) <= MAX_CRANK_ANGLE
        return np.where(is_angle, Cause.UNKNOWN, Cause.NO_ANGLE).astype(np.intp)
    reasons = linkage_poses(solved, alphas).reason
    known = [reasons == Reason.CRANK_ANGLE, reasons != Reason.SOLVED]
    return np.select(known, [Cause.NO_ANGLE, Cause.OUT_OF_REACH], Cause.UNKNOWN)
