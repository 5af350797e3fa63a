"""
Drop counters of a recording: received = skipped + dropped + written, for each topic.

*Skipped* messages came during a pause, *dropped* ones found a full queue (overrun) or a file that
refused them (unwritten). *Missed* messages were lost before reception: see `klann_ros.log.loss`.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from klann_ros.log.loss import LossCounter
from klann_ros.log.run_parameters import TopicCount

# Counts by topic name.
Counts = Mapping[str, TopicCount]
_NO_MESSAGES = TopicCount(0, 0)


@dataclass(slots=True)
class TopicCounters:
    """
    Counters of a topic's messages before they are written.

    Each one is incremented by one thread only, so none needs a lock.
    """

    received: int = 0
    # Messages lost before reception.
    loss: LossCounter = field(default_factory=LossCounter)
    # Messages received during a pause.
    skipped: int = 0
    # Dropped by back-pressure: the queue was full, or writing had ended.
    overrun: int = 0
    # Dropped after the queue: the file refused them.
    unwritten: int = 0

    def count(self) -> TopicCount:
        """Return the present count, of messages before they are written."""
        loss = self.loss
        return TopicCount(
            self.received,
            written=0,
            dropped=self.overrun + self.unwritten,
            skipped=self.skipped,
            missed=loss.lost,
            before_discovery=loss.before_discovery,
            departed=loss.departed,
        )


@dataclass(frozen=True)
class StoredCounts:
    """Messages that were passed to a run, by topic name."""

    # In the run.
    written: Counter[str]
    # Written, but no longer in the run, or not known to be.
    dropped: Counter[str]


class DropCounters:
    """
    Counters of all topics of a recording to a run.

    Every message outside the queue is in exactly one place: for each topic
    received = skipped + dropped + written.
    """

    def __init__(self, stored_counts: Callable[[], StoredCounts]) -> None:
        self._stored_counts = stored_counts
        self._topics: dict[str, TopicCounters] = {}

    def __getitem__(self, topic: str) -> TopicCounters:
        """Return the counters of a topic, new ones at the first call."""
        counters = self._topics.get(topic)
        # Two threads may call this at the same time.
        return self._topics.setdefault(topic, TopicCounters()) if counters is None else counters

    def skipped(self) -> Counter[str]:
        """Return the messages of each topic skipped in all pauses so far."""
        return Counter({name: counters.skipped for name, counters in self._items()})

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic so far; thread-safe."""
        stored = self._stored_counts()
        return {
            name: replace(
                count,
                written=stored.written[name],
                dropped=count.dropped + stored.dropped[name],
                missed=count.missed if self[name].loss.is_known else None,
            )
            for name, count in self.snapshot().items()
        }

    def snapshot(self) -> Counts:
        """Return the present counts of messages before they are written."""
        return {name: counters.count() for name, counters in self._items()}

    def counts_between(
        self, begin: Counts, end: Counts, stored: Counts, pretrigger: Mapping[str, int]
    ) -> dict[str, TopicCount]:
        """
        Return what became of the messages of each topic between two snapshots.

        `stored` are the counts of the run to which they were written, and `pretrigger` messages
        received before `begin` that were written to that run as well.
        """
        counts = {}
        for name, counters in self._items():
            first = begin.get(name, _NO_MESSAGES)
            last = end.get(name, _NO_MESSAGES)
            run_count = stored.get(name, _NO_MESSAGES)
            missed = (last.missed or 0) - (first.missed or 0)
            counts[name] = TopicCount(
                received=last.received - first.received + pretrigger.get(name, 0),
                written=run_count.written,
                dropped=run_count.dropped,
                skipped=last.skipped - first.skipped,
                missed=missed if counters.loss.is_known else None,
                before_discovery=last.before_discovery - first.before_discovery,
                departed=last.departed - first.departed,
            )
        return counts

    def _items(self) -> list[tuple[str, TopicCounters]]:
        # Another thread may add a topic meanwhile.
        return list(self._topics.items())
