"""Where a topic that has a period says nothing for long, and which questions have no answer."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from klann_ros.sanitize.text import counted
import numpy as np

from .answering import Answering, Cause
from .limits import Limits
from .recording import LegRecording, RunRecording
from .times import covered, Floats, Hole, intervals, median, merged, overlap, RowIndices
from .topics import TopicRecording

# Fewer messages tell no period.
_LEAST = 10
# Of a periodic topic so many intervals in a hundred are no longer than usual, whatever is allowed.
_REGULAR = 90.0
_USUAL = Limits()
# Topics that come in bursts have no rate: regular intervals are less than this part of their time,
# and no longer than this between two silences, in the mean [s].
_PRESENT, _STRETCH = 0.25, 0.5
# A silence is a loss if so many of the messages that it could have held are known to be missing.
_MOSTLY = 0.5
# An answer comes so long after its question, at most [ns].
SOON = 200_000_000


class Silence(NamedTuple):
    """
    When nothing came [ns], on which topics, and how long one may be without being one [s].

    A restart is a silence between two publishers, the first of which left in order.
    """

    begin: int
    end: int
    topics: tuple[str, ...]
    longest: float = 0.0
    is_restart: bool = False

    @property
    def length(self) -> float:
        """Return how long it is [s]."""
        return (self.end - self.begin) / 1e9


def silences(topic: TopicRecording, limits: Limits, resolution: float = 0.0) -> Iterator[Silence]:
    """
    Yield the silences of a topic, but for those in which what came is known to be lost.

    Parameters
    ----------
    topic : TopicRecording
        How its messages came.
    limits : Limits
        What is still all right.
    resolution : float
        By how much log times advance at once [s].

    """
    if len(topic.times) < _LEAST or not topic.is_periodic:
        return
    steps = intervals(topic.times)
    period = max(median(steps), resolution)
    longest = _longest(period, limits)
    rows = np.flatnonzero(steps > longest)
    if not rows.size or not _has_rate(topic, steps, period):
        return
    # Nodes that start hold each other up.
    starts = np.array([topic.first or topic.times[0], *topic.restarts[:, 1]])
    last_start = starts[np.searchsorted(starts, topic.times[rows], side='right') - 1]
    rows = rows[topic.times[rows] - last_start >= limits.start_time * 1e9]
    restarts = {begin for begin, _ in topic.restarts.tolist()}
    lost = {begin: count for begin, _, count in topic.missing.tolist()}
    for begin, end in zip(topic.times[rows].tolist(), topic.times[rows + 1].tolist(), strict=True):
        silence = Silence(begin, end, (topic.name,), longest, begin in restarts)
        if lost.get(begin, 0) * period < _MOSTLY * silence.length:
            yield silence


def _has_rate(topic: TopicRecording, steps: Floats, period: float) -> bool:
    """Return whether intervals [s] are regular, but for silences."""
    usual = _longest(period, _USUAL)
    if float(np.percentile(steps, _REGULAR)) > usual:
        return False
    if topic.is_stream:
        return True
    regular, silent = float(steps[steps <= usual].sum()), steps[steps > usual]
    is_present = regular >= _PRESENT * float(steps.sum())
    return is_present or regular >= _STRETCH * (len(silent) + 1)


def without_holes(found: Sequence[Silence], holes: Sequence[Hole]) -> list[Silence]:
    """Return the silences that are too long even without the holes in them; holes joined."""
    begins, ends = (np.array([one[i] for one in found], dtype=np.int64) for i in (0, 1))
    rest = (ends - begins) / 1e9 - covered(begins, ends, holes) / 1e9
    return [one for one, left in zip(found, rest.tolist(), strict=True) if left > one.longest]


def _longest(period: float, limits: Limits) -> float:
    """Return the longest interval that is no silence [s]."""
    return max(limits.gap_periods * period, limits.gap_time)


@dataclass(frozen=True, eq=False)
class Unanswered:
    """Questions that should have an answer and have none, by what is known about that."""

    # How many in silences of all that answers, which are gaps, and how many such silences.
    in_silences: int
    silences: int
    # How many others at pauses of the recorder, or where the log is damaged.
    at_holes: int
    # How many others at most for answers that are known to be lost on the way into the log.
    lost: int
    # Which crank inputs are the others; `lost` of them are explained.
    elsewhere: RowIndices

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


def unanswered(
    recording: RunRecording,
    leg: LegRecording,
    answering: Answering,
    silences_: Sequence[Silence],
) -> Unanswered:
    """
    Return the questions of a leg that should have an answer and have none.

    Parameters
    ----------
    recording : RunRecording
        The run.
    leg : LegRecording
        The part of it that is evaluated.
    answering : Answering
        What the leg was asked in that part.
    silences_ : sequence of Silence
        Those of all topics.

    """
    rows = answering.of(Cause.UNKNOWN)
    times = leg.cranks.times[rows]
    at_holes = overlap(times - SOON, times + SOON, recording.holes)
    # Silences of its poses are gaps, if it could have been answered in them.
    own = [silence for silence in silences_ if not leg.pose_topics.isdisjoint(silence.topics)]
    holes = merged([*recording.holes, *refusals(leg, answering)])
    silent = merged((silence.begin, silence.end) for silence in without_holes(own, holes))
    in_silences = ~at_holes & overlap(times, times, silent)
    elsewhere = rows[~at_holes & ~in_silences]
    ends = np.array([end for _, end in silent], dtype=np.int64)
    which = np.searchsorted(ends, times[in_silences])
    return Unanswered(
        int(np.count_nonzero(in_silences)),
        len(np.unique(which)),
        int(np.count_nonzero(at_holes)),
        min(recording.lost_on(leg.pose_topics), len(elsewhere)),
        elsewhere,
    )


def refusals(leg: LegRecording, answering: Answering) -> list[Hole]:
    """Return from when to when a leg was asked what it cannot answer, log times [ns]."""
    times = leg.cranks.times
    rows = answering.rows[answering.causes != Cause.UNKNOWN]
    begins = times[np.maximum(rows - 1, 0)]
    ends = times[np.minimum(rows + 1, len(times) - 1)]
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
