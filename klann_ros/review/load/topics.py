"""Reception of each topic: times, latencies, sequence numbers and clock steps."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
import re
from typing import Any

from klann_ros.kinematics.arrays import BoolArray, IndexArray, IntArray
from klann_ros.log import LOSS_RECORD, MessageBlock, Topic, topic_counts, TopicCount
from klann_ros.review.model.times import Interval, LAST_TIME, nanoseconds, overlaps
from klann_ros.review.model.topics import TopicRecording
import numpy as np
from numpy.typing import NDArray

from .geometry import Metadata
from .series import GrowingArray

# As words or, until Humble, as a number of rmw.
_LATCHED = re.compile('durability: *(transient_local|1)\\b')


@dataclass
class _TopicState:
    times: GrowingArray = field(default_factory=partial(GrowingArray, np.int64))
    latencies: GrowingArray = field(default_factory=partial(GrowingArray, np.float32))
    back: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    end: int = 0
    published_end: int = 0
    publishers: int = 0
    latched: bool = False
    discovered: int = 0  # on a latched topic, when its publisher was
    last: int = 0  # last sequence number; they begin at 1, and 0 means unknown
    numbered: int = 0
    missing: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    steps_back: int = 0
    restarts: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 2))
    early: int = 0

    def add(self, heads: NDArray[np.void], rows: IndexArray) -> None:
        """Add messages by their headers."""
        # Column by column: whole headers take three times as long.
        times, published = (nanoseconds(heads[key][rows]) for key in ('log_time', 'publish_time'))
        numbers = heads['sequence'][rows].astype(np.int64)
        # Without a publish time, recorders write the log time or 0.
        unknown = (published == 0) | (published == times)
        published = np.where(published > 0, published, times)
        if not self.times:
            self.end, self.published_end, self.discovered = times[0], published[0], times[0]
        before = np.concatenate([[self.end], times[:-1]])
        back = np.flatnonzero(times < before)
        published_before = np.concatenate([[self.published_end], published[:-1]])
        by = before[back] - times[back], published_before[back] - published[back]
        self.back.add(np.column_stack([len(self.times) + back, *by]))
        latencies = np.where(unknown, np.nan, (times - published) / 1e9)
        if self.latched:
            latencies[published < self._discovery_times(times, numbers)] = np.nan
        self.end, self.published_end = int(times[-1]), int(published[-1])
        self.times.add(times)
        self.latencies.add(latencies)
        self._count(numbers, before, times)

    def _discovery_times(self, times: IntArray, numbers: NDArray[np.int64]) -> IntArray:
        """Return when the publisher of each message was discovered [ns]."""
        before = np.concatenate([[self.last], numbers[:-1]])
        # A restart of the numbers is another publisher, maybe an older one.
        restarts = (before > 0) & (numbers > 0) & (numbers <= before)
        first = np.maximum.accumulate(np.where(restarts, np.arange(len(times)), -1))
        since: IntArray = np.where(first < 0, self.discovered, times[first])
        self.discovered = int(since[-1])
        return since

    def _count(self, numbers: NDArray[np.int64], befores: IntArray, times: IntArray) -> None:
        """Count missing sequence numbers and restarts."""
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
    def is_shared(self) -> bool:
        """Return whether there were several publishers at once."""
        # A restarted publisher steps back once; those of two publishers do so repeatedly.
        return self.steps_back > 1 or self.publishers > 1

    @property
    def is_numbered(self) -> bool:
        """Return whether the sequence numbers are those of one publisher."""
        return bool(self.numbered) and not self.is_shared


class TopicCollector:
    """Collects times and sequence numbers of every topic."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], _TopicState] = {}

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Count a topic's messages in a block."""
        seen = self._seen.setdefault((topic.name, topic.type), _TopicState())
        # The files of a split run may have different profiles of a topic.
        publishers, latched = _offer(topic.qos)
        seen.publishers = max(seen.publishers, publishers)
        seen.latched = seen.latched or latched
        seen.add(block.heads, rows)

    def topics(
        self, recorded: Mapping[str, TopicCount], unrecorded: Sequence[Interval]
    ) -> tuple[TopicRecording, ...]:
        """Return all topics, with the losses that the recorder counted."""
        found = [
            _topic(name, kind, seen, recorded.get(name), unrecorded)
            for (name, kind), seen in self._seen.items()
        ]
        self._seen.clear()
        names = {topic.name for topic in found}
        # A topic without any received message is lost, too.
        for name, c in recorded.items():
            if (c.lost or c.before_discovery or c.departed > 1) and name not in names:
                nothing, none = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.float32)
                counts = c.lost, c.before_discovery, c.departed
                found.append(TopicRecording(name, '', nothing, none, *counts, dropped=c.dropped))
        return tuple(found)


@lru_cache(maxsize=64)
def _offer(qos: str) -> tuple[int, bool]:
    """Return the number of publishers in a QoS text, and whether one is latched."""
    return qos.count('history:'), _LATCHED.search(qos) is not None


def _topic(
    name: str,
    kind: str,
    seen: _TopicState,
    recorded: TopicCount | None,
    unrecorded: Sequence[Interval],
) -> TopicRecording:
    times, latencies = seen.times.array(), seen.latencies.array()
    back = seen.back.array()
    # Numbers of two publishers may look like those of one; the recorder counts publishers.
    is_alone = seen.is_numbered and (recorded is None or recorded.missed is not None)
    set_back = back[recorder_clock_steps(latencies, back, alone=is_alone)]
    set_back = np.column_stack([times[set_back[:, 0]], set_back[:, 1]])
    if len(back):
        order = np.argsort(times, kind='stable')
        times, latencies = times[order], latencies[order]
    missing = seen.missing.array() if seen.is_numbered else np.empty((0, 3), dtype=np.int64)
    # Numbers missing at a pause or at damage are no loss.
    missing = missing[~overlaps(missing[:, 0], missing[:, 1], unrecorded)]
    # Unknown; a restarted publisher has left before.
    lost, early, publishers_left, shared = None, 0, 0, seen.is_shared
    if recorded is not None:
        lost, shared = recorded.lost, recorded.missed is None
        early, publishers_left = recorded.before_discovery, recorded.departed
    elif seen.is_numbered:
        lost, publishers_left = int(missing[:, 2].sum()), seen.steps_back
        early = 0 if seen.latched else seen.early
    if seen.latched and not seen.numbered:
        # Latched messages from before the discovery are indistinguishable from later ones.
        latencies = np.full_like(latencies, np.nan)
    return TopicRecording(
        name=name,
        type=kind,
        times=times,
        latencies=latencies,
        lost=lost,
        early=early,
        publishers_left=publishers_left,
        shared=shared,
        missing=missing,
        restarts=seen.restarts.array()[: 0 if shared else None],
        set_back=set_back,
        reordered=len(back) - len(set_back),
        dropped=0 if recorded is None else recorded.dropped,
    )


def recorded_losses(metadata: Metadata) -> dict[str, TopicCount]:
    """Return the losses that the recorder counted, by topic; not those of invalid records."""
    known: dict[str, TopicCount] = {}
    for record in metadata.get(LOSS_RECORD, ()):
        with suppress(ValueError):
            for name, c in topic_counts(record).items():
                numbers = c.lost or 0, c.dropped, c.before_discovery, c.departed
                if min(numbers) >= 0 and max(numbers) <= LAST_TIME:
                    known[name] = c
    return known


# Recorders empty one queue after the other, and retransmissions come late: so messages are
# reordered without a clock step, by up to this [ns], or this with several publishers [ns].
_MAX_REORDERING, _MAX_SHARED_REORDERING = 5_000_000, 100_000_000
# Messages before and after a step whose smallest latency is compared, and steps of a topic.
_LATENCY_WINDOW, _MAX_STEPS = 1000, 10_000
# Percentile of the latency that is compared as well.
_LATENCY_PERCENTILE = 90.0
# Messages that a comparison needs.
_MIN_MESSAGES = 20


def recorder_clock_steps(
    latencies: NDArray[np.float32], steps: IntArray, *, alone: bool
) -> BoolArray:
    """
    Return which steps back of log times are steps of the recorder's clock, shape (k,).

    Either the publish times step back, too (same machine), or all later latencies are smaller.
    `latencies` are those of all messages in the order of the log [s], NaN for unknown; a row of
    `steps`, shape (k, 3), is a message logged earlier than its predecessor, the step of the log
    time, and that of the publish time, usually negative [ns]; `alone` says that there is a single
    publisher.
    """
    rows, back, published_back = steps.T
    likely: BoolArray = back >= _MAX_REORDERING
    if not likely.any():
        return likely
    both = (published_back >= back / 2) & (alone | (back > _MAX_SHARED_REORDERING))
    clocks: BoolArray = likely & (both | _latency_drops(latencies, rows, back))
    return clocks


def _latency_drops(latencies: NDArray[np.float32], rows: IntArray, back: IntArray) -> BoolArray:
    """Return the rows where the latency drops permanently by about `back` [ns]."""
    found = np.zeros(len(rows), dtype=bool)
    for i, (row, by) in enumerate(zip(rows[:_MAX_STEPS].tolist(), back.tolist(), strict=False)):
        before, since = latencies[:row][-_LATENCY_WINDOW:], latencies[row:][:_LATENCY_WINDOW]
        least = np.fmin.reduce(before, initial=np.inf)
        # A large clock offset leaves few digits of the float32 latency.
        is_coarse = float(np.spacing(np.abs(least))) * 1e9 > by / 8
        enough = min(len(before), len(since)) >= _MIN_MESSAGES
        if enough and not is_coarse and _is_about(least, np.fmin.reduce(since), by):
            # With two publishers one may start late, while the other goes on.
            high, low = (np.nanpercentile(part, _LATENCY_PERCENTILE) for part in (before, since))
            found[i] = _is_about(high, low, by)
    return found


def _is_about(before: Any, after: Any, by: Any) -> bool:
    return bool(np.abs((np.float64(before) - np.float64(after)) * 1e9 - by) <= by / 2)
