"""Questions that should have an answer and have none: where they are, and what is known of why."""

from dataclasses import dataclass

from klann_ros.log.wording import counted
from klann_ros.review.answering import Cause
from klann_ros.review.loading.holes import Hole, joined, overlap
from klann_ros.review.pairing import Rows
from klann_ros.review.reviewed import Review, ReviewedLeg
import numpy as np

from .silences import silences

# An answer comes so long after its question, at most [ns].
SOON = 200_000_000


@dataclass(frozen=True, eq=False)
class Unanswered:
    """
    Questions that should have an answer and have none, by what is known about that.

    Attributes
    ----------
    in_silences, silences : int
        How many in silences of all that answers, which are gaps, and how many such silences.
    at_holes : int
        How many others at pauses of the recorder, or where the log is damaged.
    lost : int
        How many others at most for answers that are known to be lost on the way into the log.
    elsewhere : numpy.ndarray
        Which crank inputs are the others; `lost` of them are explained.

    """

    in_silences: int
    silences: int
    at_holes: int
    lost: int
    elsewhere: Rows

    @property
    def count(self) -> int:
        """Return how many they are together."""
        return self.in_silences + self.at_holes + len(self.elsewhere)

    @property
    def unexplained(self) -> int:
        """Return how many have no explanation."""
        return len(self.elsewhere) - self.lost

    def __str__(self) -> str:
        """Return the parts in words, which add up to the whole; nothing for one part alone."""
        shares = (
            (self.in_silences, f'in {counted(self.silences, "silence")}'),
            (self.at_holes, 'at pauses or damage of the log'),
            (self.lost, 'whose answers were lost on their way into the log'),
        )
        told = [f'{count} {what}' for count, what in shares if count]
        return f': {", ".join(told)}, {self.unexplained} elsewhere' if told else ''


def unanswered(review: Review, leg: ReviewedLeg) -> Unanswered:
    """Return the questions of a leg that should have an answer and have none."""
    recording, judged = review.recording, leg.judged
    rows = leg.answering.of(Cause.UNKNOWN)
    times = judged.cranks.times[rows]
    at_holes = overlap(times - SOON, times + SOON, recording.holes)
    silent = _silent(review, leg)
    in_silences = ~at_holes & overlap(times, times, silent)
    elsewhere = rows[~at_holes & ~in_silences]
    ends = np.array([end for _, end in silent], dtype=np.int64)
    which = np.searchsorted(ends, times[in_silences])
    return Unanswered(
        int(np.count_nonzero(in_silences)),
        len(np.unique(which)),
        int(np.count_nonzero(at_holes)),
        min(recording.lost_on(judged.pose_topics), len(elsewhere)),
        elsewhere,
    )


def _silent(review: Review, leg: ReviewedLeg) -> tuple[Hole, ...]:
    """Return the silences of a leg's poses, which are gaps."""
    recording, judged = review.recording, leg.judged
    holes = joined([*recording.holes, *refused(leg)])
    return joined(
        (silence.begin, silence.end)
        for topic in recording.topics
        if topic.name in judged.pose_topics
        for silence in silences(topic, holes, review.limits)
    )


def refused(leg: ReviewedLeg) -> list[Hole]:
    """Return from when to when a leg was asked what it cannot answer, log times [ns]."""
    times = leg.judged.cranks.times
    rows = leg.answering.rows[leg.answering.causes != Cause.UNKNOWN]
    begins = times[np.maximum(rows - 1, 0)]
    ends = times[np.minimum(rows + 1, len(times) - 1)]
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
