"""
Drop counters of a recording: received = skipped + dropped + written, for each topic.

*Skipped* messages came during a pause, *dropped* ones found a full queue (overrun) or a file that
refused them (unwritten). *Missed* messages were lost before reception: see `klann_ros.log.loss`.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

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

    def count(self, written: int, dropped: int, missed: int | None) -> TopicCount:
        """Return the counts, given those of the file and of messages lost before reception."""
        return TopicCount(
            self.received,
            written,
            dropped,
            self.skipped,
            missed,
            self.loss.before_discovery,
            self.loss.departed,
        )


@dataclass(frozen=True)
class StoredCounts:
    """Messages that were passed to a run, by topic name."""

    # In the run.
    written: Counter[str]
    # Written, but no longer in the run, or not known to be.
    dropped: Counter[str]


class CountedRun(Protocol):
    """A run that is being written."""

    def stored_counts(self) -> StoredCounts:
        """Return what became of the messages that were passed to the run."""


class DropCounters:
    """
    Counters of all topics of a recording to a run.

    Every message outside the queue is in exactly one place: for each topic
    received = skipped + dropped + written.
    """

    def __init__(self, run: CountedRun) -> None:
        self._run = run
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
        stored = self._run.stored_counts()
        return {
            name: counters.count(
                written=stored.written[name],
                dropped=counters.overrun + counters.unwritten + stored.dropped[name],
                missed=counters.loss.lost if counters.loss.is_known else None,
            )
            for name, counters in self._items()
        }

    def snapshot(self) -> Counts:
        """Return the present counters of messages before they are written."""
        return {
            name: counters.count(written=0, dropped=0, missed=counters.loss.lost)
            for name, counters in self._items()
        }

    def counts_between(
        self, begin: Counts, end: Counts, stored: Counts, pretrigger: Mapping[str, int]
    ) -> dict[str, TopicCount]:
        """
        Return what became of the messages of each topic between two snapshots.

        Parameters
        ----------
        begin, end
            The snapshots.
        stored
            The counts of the run to which these messages were written.
        pretrigger
            Messages received before `begin` that were written to that run as well.

        """
        counts = {}
        for name, counters in self._items():
            first, last = begin.get(name, _NO_MESSAGES), end.get(name, _NO_MESSAGES)
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
