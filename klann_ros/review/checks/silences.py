"""When a topic that has a period says nothing for long."""

from collections.abc import Sequence
from typing import NamedTuple

from klann_ros.review.limits import Limits
from klann_ros.review.loading.holes import covered, Hole
from klann_ros.review.recording import TopicRecording
from klann_ros.review.topic_figures import intervals
import numpy as np

# What is for viewers is published when there is something to see, and somebody who looks.
_PICTURES = 'visualization_msgs/'
# Fewer messages tell no period.
_LEAST = 10
# Of a periodic topic so many intervals in a hundred are no longer than usual, whatever is allowed.
_REGULAR = 90.0
_USUAL = Limits()
# A silence is a loss if so many of the messages that it could have held are known to be missing.
_MOSTLY = 0.5


class Silence(NamedTuple):
    """When nothing came [ns], and on which topics."""

    begin: int
    end: int
    topics: tuple[str, ...]

    @property
    def length(self) -> float:
        """Return how long it is [s]."""
        return (self.end - self.begin) / 1e9


def silences(topic: TopicRecording, holes: Sequence[Hole], limits: Limits) -> list[Silence]:
    """Return the silences of a topic, but for those in holes, where there is nothing to say."""
    if len(topic.times) < _LEAST or topic.type.startswith(_PICTURES):
        return []
    steps = intervals(topic.times)
    period = float(np.median(steps))
    if float(np.percentile(steps, _REGULAR)) > _longest(period, _USUAL):
        return []
    limit = _longest(period, limits)
    rows = np.flatnonzero(steps > limit)
    begins, ends = topic.times[rows], topic.times[rows + 1]
    rows = rows[steps[rows] - covered(begins, ends, holes) / 1e9 > limit]
    lost = {begin: count for begin, _, count in topic.missing.tolist()}
    both = zip(topic.times[rows].tolist(), topic.times[rows + 1].tolist(), strict=True)
    found = (Silence(begin, end, (topic.name,)) for begin, end in both)
    return [
        silence
        for silence in found
        if lost.get(silence.begin, 0) * period < _MOSTLY * silence.length
    ]


def _longest(period: float, limits: Limits) -> float:
    """Return the longest interval that is no silence [s]."""
    return max(limits.gap_periods * period, limits.gap_time)
