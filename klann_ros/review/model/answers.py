"""Crank inputs and their answers: refused, unanswered and duplicate."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from klann_ros.kinematics import Reason
from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray, IntArray
from klann_ros.sanitize.text import counted
import numpy as np

from .poses import poses_at
from .recording import LegRecording, RunRecording
from .times import (
    alone,
    count_stamps,
    Interval,
    is_monotonic,
    isin,
    match_stamps,
    merge_intervals,
    overlaps,
    StampCounts,
)
from .topics import exclude_intervals, Gap


class Cause(IntEnum):
    """Why an input has no answer."""

    NO_ANGLE = 0  # not finite, or out of range
    OUT_OF_REACH = 1
    UNKNOWN = 2  # an answer is missing


class Duplicates(NamedTuple):
    """Inputs with several answers: n poses."""

    rows: IndexArray  # indices of the poses
    inputs: IndexArray  # the input of each, from 0
    alone: BoolArray  # whether the stamp belongs to one input only
    solvers: int  # their number, if most inputs have equally many answers; else 1

    def answered_rightly(self, wrong: BoolArray) -> IndexArray:
        """Return the wrong poses whose input has a right answer, too."""
        is_wrong = wrong[self.rows]
        has_right_answer = np.zeros(int(self.inputs.max(initial=-1)) + 1, dtype=bool)
        has_right_answer[self.inputs[~is_wrong]] = True
        return np.asarray(self.rows[is_wrong & has_right_answer[self.inputs]])


@dataclass(frozen=True, eq=False)
class Answers:
    """The crank inputs of a leg, and their answers."""

    # Number of inputs before the first answer, up to the last, and after it: the edges of a run
    # are no fault.
    early: int
    asked: int
    late: int
    count: int  # of the answers in between
    rows: IndexArray  # indices of the inputs without answer
    causes: IndexArray  # the Cause of each
    duplicates: Duplicates
    # Indices of the poses between two inputs whose own input is missing; none where most are.
    unasked: IndexArray

    def of(self, cause: Cause) -> IndexArray:
        """Return the inputs without answer for a cause."""
        return np.asarray(self.rows[self.causes == cause])


_NO_ROWS = np.empty(0, dtype=np.intp)
_NO_DUPLICATES = Duplicates(_NO_ROWS, _NO_ROWS, np.empty(0, dtype=bool), 1)
# Inputs with several answers that make a second solver.
_MIN_DUPLICATES = 5


def match_answers(leg: LegRecording) -> Answers:
    """Match the crank inputs of a leg with its poses."""
    inputs = leg.cranks.stamps
    answers = leg.poses.stamps
    if not len(answers):
        return Answers(len(inputs), 0, 0, 0, _NO_ROWS, _NO_ROWS, _NO_DUPLICATES, _NO_ROWS)
    is_early = inputs < answers.min()
    is_late = inputs > answers.max()
    inside = np.flatnonzero(~(is_early | is_late))
    if is_monotonic(inputs) and is_monotonic(answers):
        rows = inside[~isin(inputs[inside], answers)]
        causes = _causes(leg, rows)
        count = len(inside) - len(rows)
        duplicates = _NO_DUPLICATES
    else:
        stamps = count_stamps(inputs[inside], answers)
        rows, causes = _unanswered(leg, inside, stamps)
        count = int(stamps.second.sum())
        duplicates = _duplicates(answers, stamps)
    early = int(np.count_nonzero(is_early))
    late = int(np.count_nonzero(is_late))
    unasked = _unasked(inputs, answers)
    return Answers(early, len(inside), late, count, rows, causes, duplicates, unasked)


def find_duplicates(stamps: IntArray) -> Duplicates:
    """Return the answers with equal stamps, for a run without inputs."""
    if is_monotonic(stamps):
        return _NO_DUPLICATES
    return _duplicates(stamps, count_stamps(np.unique(stamps), stamps))


def requested_angles(leg: LegRecording) -> tuple[IndexArray, FloatArray]:
    """
    Return the poses with a unique input, and the leg angle that it requests [rad].

    Without direction and phase in the run, only if most poses have the angle of the crank itself.
    """
    rows = alone(leg.cranks.stamps)
    poses, of_cranks = match_stamps(leg.poses.stamps, leg.cranks.stamps[rows])
    alphas = _leg_angles(leg, leg.cranks.values[rows[of_cranks], 0])
    different_count = np.count_nonzero(leg.poses.values[poses, 0] != alphas)
    if not leg.solver.nodes and 2 * different_count > len(poses):
        return poses[:0], alphas[:0]
    return poses, alphas


def _leg_angles(leg: LegRecording, alphas: FloatArray) -> FloatArray:
    """Return direction * angle + phase, as solver_node computes it."""
    return leg.solver.direction * alphas + leg.solver.phase


def _unanswered(
    leg: LegRecording, inside: IndexArray, stamps: StampCounts
) -> tuple[IndexArray, IndexArray]:
    """
    Return the inputs without answer, and their causes.

    Where a stamp has fewer answers than inputs, the unsolvable ones lack theirs, or else the last.
    """
    lacking = stamps.first - stamps.second
    rows = np.flatnonzero(lacking[stamps.of_first] > 0)
    causes = _causes(leg, inside[rows])
    groups = stamps.of_first[rows]
    order = np.lexsort([-rows, causes == Cause.UNKNOWN, groups])
    rows = rows[order]
    causes = causes[order]
    groups = groups[order]
    index_in_group = np.arange(len(rows)) - np.searchsorted(groups, groups)
    missing = np.flatnonzero((index_in_group < lacking[groups]) | (causes != Cause.UNKNOWN))
    missing = missing[np.argsort(rows[missing])]
    inputs: IndexArray = inside[rows[missing]]
    return inputs, causes[missing]


def _duplicates(answers: IntArray, stamps: StampCounts) -> Duplicates:
    has_duplicates = stamps.second > stamps.first
    if not has_duplicates.any():
        return _NO_DUPLICATES
    inputs = np.searchsorted(stamps.stamps, answers)
    np.minimum(inputs, len(stamps.stamps) - 1, out=inputs)
    rows = np.flatnonzero(has_duplicates[inputs] & (stamps.stamps[inputs] == answers))
    duplicated = np.flatnonzero(has_duplicates)
    share = len(duplicated) / (duplicated[-1] + 1 - duplicated[0])
    solvers = 1
    if len(duplicated) >= _MIN_DUPLICATES and share >= 0.5:
        ratios = stamps.second[duplicated] / stamps.first[duplicated]
        solvers = max(2, round(float(np.median(ratios))))
    return Duplicates(rows, inputs[rows], stamps.first[inputs[rows]] == 1, solvers)


def _unasked(inputs: IntArray, answers: IntArray) -> IndexArray:
    """Return the answers between two inputs that belong to none, unless most are such."""
    if not len(inputs):
        return _NO_ROWS
    inside = np.flatnonzero((answers > inputs.min()) & (answers < inputs.max()))
    rows: IndexArray = inside[~isin(answers[inside], inputs)]
    return rows if 2 * len(rows) <= len(inside) else _NO_ROWS


def _causes(leg: LegRecording, rows: IndexArray) -> IndexArray:
    if not rows.size:
        return rows
    alphas = _leg_angles(leg, leg.cranks.values[rows, 0])
    solved_leg = leg.solver.leg
    if solved_leg is None or not (leg.solver.nodes or len(requested_angles(leg)[0])):
        # The leg angle is unknown, but a crank angle out of range is invalid for any leg.
        is_angle = np.abs(alphas) <= MAX_CRANK_ANGLE
        return np.where(is_angle, Cause.UNKNOWN, Cause.NO_ANGLE).astype(np.intp)
    reasons = poses_at(solved_leg, alphas).reason
    conditions = [reasons == Reason.CRANK_ANGLE, reasons != Reason.SOLVED]
    return np.select(conditions, [Cause.NO_ANGLE, Cause.OUT_OF_REACH], Cause.UNKNOWN)


# Longest time from an input to its answer [ns].
MAX_RESPONSE_TIME = 200_000_000


@dataclass(frozen=True, eq=False)
class Unanswered:
    """Inputs without an expected answer, by their cause."""

    in_gaps: int  # inputs in gaps of the poses
    gaps: int  # these gaps
    unrecorded: int  # others at pauses of the recorder, or at damage of the log
    lost: int  # others whose answers were lost on the way into the log, at most
    other_rows: IndexArray  # indices of the others; `lost` of them are explained

    @property
    def count(self) -> int:
        """Return the total."""
        return self.in_gaps + self.unrecorded + len(self.other_rows)

    @property
    def unexplained(self) -> int:
        """Return the number without explanation."""
        return len(self.other_rows) - self.lost

    def __str__(self) -> str:
        """Return the parts in words, which add up to the total; nothing for a single part."""
        shares = (
            (self.in_gaps, f'in {counted(self.gaps, "gap")}'),
            (self.unrecorded, 'at pauses or damage of the log'),
            (self.lost, 'whose answers were lost on their way into the log'),
        )
        texts = [f'{count} {cause}' for count, cause in shares if count]
        return f': {", ".join(texts)}, {self.unexplained} unexplained' if texts else ''


def unanswered(
    recording: RunRecording, leg: LegRecording, answers: Answers, gaps: Sequence[Gap]
) -> Unanswered:
    """Return the inputs of the judged part of a leg without an expected answer."""
    rows = answers.of(Cause.UNKNOWN)
    times = leg.cranks.times[rows]
    begins = times - MAX_RESPONSE_TIME
    ends = times + MAX_RESPONSE_TIME
    is_unrecorded = overlaps(begins, ends, recording.unrecorded)
    leg_gaps = [gap for gap in gaps if not leg.pose_topics.isdisjoint(gap.topics)]
    explained = merge_intervals([*recording.unrecorded, *refused_intervals(leg, answers)])
    leg_gaps = [*exclude_intervals(leg_gaps, explained)]
    pose_gaps = merge_intervals((gap.begin, gap.end) for gap in leg_gaps)
    in_gaps = ~is_unrecorded & overlaps(times, times, pose_gaps)
    other_rows = rows[~is_unrecorded & ~in_gaps]
    gap_ends = np.array([end for _, end in pose_gaps], dtype=np.int64)
    gap_indices = np.searchsorted(gap_ends, times[in_gaps])
    return Unanswered(
        int(np.count_nonzero(in_gaps)),
        len(np.unique(gap_indices)),
        int(np.count_nonzero(is_unrecorded)),
        min(recording.lost_on(leg.pose_topics), len(other_rows)),
        other_rows,
    )


def refused_intervals(leg: LegRecording, answers: Answers) -> list[Interval]:
    """Return the intervals of unsolvable inputs, log times [ns]."""
    times = leg.cranks.times
    rows = answers.rows[answers.causes != Cause.UNKNOWN]
    begins = times[np.maximum(rows - 1, 0)]
    ends = times[np.minimum(rows + 1, len(times) - 1)]
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
