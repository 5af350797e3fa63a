"""How the messages of each topic came: when, how late, and what is missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
import re

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import LOSS_RECORD, topic_counts, TopicCount
from klann_ros.review.model.times import Hole, LAST_TIME, nanoseconds, overlap, RowIndices, Times
from klann_ros.review.model.topics import TopicRecording
import numpy as np
from numpy.typing import NDArray

from .columns import GrowingArray
from .order import clock_steps
from .solvers import Metadata

# As words or, until Humble, as a number of rmw.
_LATCHED = re.compile('durability: *(transient_local|1)\\b')


@dataclass
class _Seen:
    times: GrowingArray = field(default_factory=partial(GrowingArray, np.int64))
    latencies: GrowingArray = field(default_factory=partial(GrowingArray, np.float32))
    back: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    end: int = 0
    published_end: int = 0
    publishers: int = 0
    latched: bool = False
    # On a latched topic, since when its publisher is heard.
    heard_since: int = 0
    # By the sequence numbers, which begin at 1; 0 is what recorders write that know none.
    last: int = 0
    numbered: int = 0
    missing: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    steps_back: int = 0
    restarts: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 2))
    early: int = 0

    def add(self, heads: NDArray[np.void], rows: RowIndices) -> None:
        """Add some messages by what stands before their bytes."""
        # Of each what is needed: whole heads take thrice the time.
        times, published = (nanoseconds(heads[key][rows]) for key in ('log_time', 'publish_time'))
        numbers = heads['sequence'][rows].astype(np.int64)
        # Who knows no such time should write the log time; some write nothing.
        unknown = (published == 0) | (published == times)
        published = np.where(published > 0, published, times)
        if not self.times:
            self.end, self.published_end, self.heard_since = times[0], published[0], times[0]
        before = np.concatenate([[self.end], times[:-1]])
        back = np.flatnonzero(times < before)
        published_before = np.concatenate([[self.published_end], published[:-1]])
        by = before[back] - times[back], published_before[back] - published[back]
        self.back.add(np.column_stack([len(self.times) + back, *by]))
        latencies = np.where(unknown, np.nan, (times - published) / 1e9)
        if self.latched:
            latencies[published < self._heard_since(times, numbers)] = np.nan
        self.end, self.published_end = int(times[-1]), int(published[-1])
        self.times.add(times)
        self.latencies.add(latencies)
        self._count(numbers, before, times)

    def _heard_since(self, times: Times, numbers: NDArray[np.int64]) -> Times:
        """Return since when the publisher of each message is heard [ns]."""
        before = np.concatenate([[self.last], numbers[:-1]])
        # Whose numbers do not go on is another one, who may have published long before.
        first = np.where(
            (before > 0) & (numbers > 0) & (numbers <= before), np.arange(len(times)), -1
        )
        first = np.maximum.accumulate(first)
        since: Times = np.where(first < 0, self.heard_since, times[first])
        self.heard_since = int(since[-1])
        return since

    def _count(self, numbers: NDArray[np.int64], befores: Times, times: Times) -> None:
        """Note what is missing between the numbers of messages."""
        before = np.concatenate([[self.last], numbers[:-1]])
        self.last = int(numbers[-1])
        self.numbered += int(np.count_nonzero(numbers))
        known = (before > 0) & (numbers > 0)
        steps = np.where(known, numbers - before, 1)
        back = steps <= 0
        self.early += int((numbers[back] - 1).sum())
        self.steps_back += int(np.count_nonzero(back))
        # A new publisher starts at 1, about; else messages are out of order.
        disordered = back & (2 * numbers > before)
        self.steps_back += int(np.count_nonzero(disordered))
        new = np.flatnonzero(back & ~disordered)
        self.restarts.add(np.column_stack([befores[new], times[new]]))
        rows = np.flatnonzero(steps > 1)
        self.missing.add(np.column_stack([befores[rows], times[rows], steps[rows] - 1]))

    @property
    def is_numbered(self) -> bool:
        """Return whether the numbers are one publisher's, so that they tell what is missing."""
        return bool(self.numbered) and not self.is_shared

    @property
    def is_shared(self) -> bool:
        """Return whether there were several publishers at once."""
        # A publisher that starts anew goes back once, the numbers of two at a time do so for ever.
        return self.steps_back > 1 or self.publishers > 1


class TopicTally:
    """Keeps the times and numbers of every topic's messages."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], _Seen] = {}
        self._offers: dict[str, tuple[int, bool]] = {}

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> None:
        """Count a topic's messages in a block."""
        seen = self._seen.setdefault((topic.name, topic.type), _Seen())
        # The files of a split run may know a topic by different profiles.
        publishers, latched = self._offer(topic.qos)
        seen.publishers = max(seen.publishers, publishers)
        seen.latched = seen.latched or latched
        seen.add(block.heads, rows)

    def _offer(self, qos: str) -> tuple[int, bool]:
        """Return how many publishers a text tells of, and whether one is latched."""
        if qos not in self._offers:
            is_latched = _LATCHED.search(qos) is not None
            self._offers[qos] = qos.count('history:'), is_latched
        return self._offers[qos]

    def topics(
        self, recorded: Mapping[str, TopicCount], holes: Sequence[Hole]
    ) -> tuple[TopicRecording, ...]:
        """Return every topic, with the losses that the recorder itself has counted."""
        found = [
            _topic(name, kind, seen, recorded.get(name), holes)
            for (name, kind), seen in self._seen.items()
        ]
        self._seen.clear()
        names = {topic.name for topic in found}
        # A topic of which nothing at all arrived is lost as well.
        nothing, none = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.float32)
        missing = [
            TopicRecording(
                name, '', nothing, none, count.lost, count.early, count.left, dropped=count.dropped
            )
            for name, count in recorded.items()
            if (count.lost or count.early or count.left > 1) and name not in names
        ]
        return (*found, *missing)


def _topic(
    name: str, kind: str, seen: _Seen, recorded: TopicCount | None, holes: Sequence[Hole]
) -> TopicRecording:
    times, latencies = seen.times.array(), seen.latencies.array()
    back = seen.back.array()
    # Numbers of two publishers may look like those of one: the recorder knows better.
    is_alone = seen.is_numbered and (recorded is None or recorded.unheard is not None)
    set_back = back[clock_steps(latencies, back, alone=is_alone)]
    set_back = np.column_stack([times[set_back[:, 0]], set_back[:, 1]])
    if len(back):
        order = np.argsort(times, kind='stable')
        times, latencies = times[order], latencies[order]
    missing = seen.missing.array()
    if seen.is_numbered:
        # What is missing where the log has a hole never was on its way, or is damaged.
        missing = missing[~overlap(missing[:, 0], missing[:, 1], holes)]
    else:
        missing = missing[:0]
    lost, early, left, shared = _losses(seen, recorded, int(missing[:, 2].sum()))
    if seen.latched and not seen.numbered:
        # Publishers repeat what they sent before they were heard, and no number tells which.
        latencies = np.full_like(latencies, np.nan)
    return TopicRecording(
        name=name,
        type=kind,
        times=times,
        latencies=latencies,
        lost=lost,
        early=early,
        left=left,
        shared=shared,
        missing=missing,
        restarts=seen.restarts.array()[: 0 if shared else None],
        set_back=set_back,
        overtaken=len(back) - len(set_back),
        dropped=0 if recorded is None else recorded.dropped,
    )


def _losses(
    seen: _Seen, recorded: TopicCount | None, missing: int
) -> tuple[int | None, int, int, bool]:
    """Return what was lost, what was early, who left, and whether there were several at once."""
    if recorded is not None:
        unknown = recorded.unheard is None
        return recorded.lost, recorded.early, recorded.left, unknown
    if not seen.is_numbered:
        return None, 0, 0, seen.is_shared
    # Who starts anew has left before.
    return missing, 0 if seen.latched else seen.early, seen.steps_back, False


def recorded_losses(metadata: Metadata) -> dict[str, TopicCount]:
    """Return what the recorder says about lost messages, by topic."""
    known: dict[str, TopicCount] = {}
    for record in metadata.get(LOSS_RECORD, ()):
        known.update(_counts(record))
    return known


def _counts(record: Mapping[str, str]) -> dict[str, TopicCount]:
    try:
        counts = topic_counts(record)
    except ValueError:
        return {}
    numbers = {name: (c.lost or 0, c.dropped, c.early, c.left) for name, c in counts.items()}
    # Less than none is no count, and nobody counts so far.
    return {
        name: count
        for name, count in counts.items()
        if min(numbers[name]) >= 0 and max(numbers[name]) <= LAST_TIME
    }
