"""Drop counters of a recording: what became of every message, for each topic."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
import stat
from typing import Protocol

from klann_ros.log.bag_metadata import FileSummary
from klann_ros.log.loss import LossCounter
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import TopicCount

from .durable_file import NOT_FOUND
from .mcap_file import McapFile


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


@dataclass(frozen=True)
class CountSnapshot:
    """The counters of a topic at a moment."""

    received: int = 0
    skipped: int = 0
    missed: int = 0
    before_discovery: int = 0
    departed: int = 0


# By topic name.
Snapshot = Mapping[str, CountSnapshot]
_ZERO = CountSnapshot()


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
    Counters of all topics of a recording.

    Every message outside the queue is in exactly one place: for each topic
    received = skipped + dropped + written.

    Parameters
    ----------
    run : CountedRun
        Where messages are written.

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
            name: TopicCount(
                received=counters.received,
                written=stored.written[name],
                dropped=counters.overrun + counters.unwritten + stored.dropped[name],
                skipped=counters.skipped,
                missed=counters.loss.lost if counters.loss.is_known else None,
                before_discovery=counters.loss.before_discovery,
                departed=counters.loss.departed,
            )
            for name, counters in self._items()
        }

    def snapshot(self) -> Snapshot:
        """Return the present counters of messages before they are written."""
        return {
            name: CountSnapshot(
                counters.received,
                counters.skipped,
                counters.loss.lost,
                counters.loss.before_discovery,
                counters.loss.departed,
            )
            for name, counters in self._items()
        }

    def counts_between(
        self,
        begin: Snapshot,
        end: Snapshot,
        stored: Mapping[str, TopicCount],
        pretrigger: Mapping[str, int],
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
            first, last = begin.get(name, _ZERO), end.get(name, _ZERO)
            run_count = stored.get(name, TopicCount(0, 0))
            counts[name] = TopicCount(
                received=last.received - first.received + pretrigger.get(name, 0),
                written=run_count.written,
                dropped=run_count.dropped,
                skipped=last.skipped - first.skipped,
                missed=last.missed - first.missed if counters.loss.is_known else None,
                before_discovery=last.before_discovery - first.before_discovery,
                departed=last.departed - first.departed,
            )
        return counts

    def _items(self) -> list[tuple[str, TopicCounters]]:
        # Another thread may add a topic meanwhile.
        return list(self._topics.items())


@dataclass(frozen=True)
class FinishedFile:
    """A finished file of a run."""

    summary: FileSummary
    size: int

    def is_intact(self, folder: Path) -> bool:
        """Return whether it is in the folder with its size, as far as that is visible."""
        try:
            status = (folder / self.summary.name).stat()
        except OSError as error:
            return error.errno not in NOT_FOUND
        return stat.S_ISREG(status.st_mode) and status.st_size == self.size


@dataclass(frozen=True)
class WrittenFiles:
    """
    The files of a run at a moment.

    Immutable: other threads read the counts, and each message is in one place at any time.
    """

    # The file in progress; None after the last.
    current: McapFile | None
    finished: tuple[FinishedFile, ...] = ()
    # Messages of the finished files, by topic name.
    written: Counter[str] = field(default_factory=Counter)
    # Messages of files that are gone or changed.
    dropped: Counter[str] = field(default_factory=Counter)

    def stored_counts(self) -> StoredCounts:
        """Return what became of all messages so far."""
        if self.current is None:
            return StoredCounts(self.written, self.dropped)
        summary, dropped = self.current.durable_summary()
        return StoredCounts(
            self.written + _by_name(summary.counts), self.dropped + _by_name(dropped)
        )

    def summaries(self) -> list[FileSummary]:
        """Return the content of each file."""
        finished = [file.summary for file in self.finished]
        return finished if self.current is None else [*finished, self.current.summary()]

    def finish_current(self, file: McapFile) -> 'WrittenFiles':
        """Return the files after the one in progress was finished."""
        summary = file.summary()
        finished = (*self.finished, FinishedFile(summary, file.size))
        written = self.written + _by_name(summary.counts)
        return replace(self, current=None, finished=finished, written=written)

    def drop_current(self, file: McapFile) -> 'WrittenFiles':
        """Return the files without the one in progress."""
        summary, unwritten = file.durable_summary()
        dropped = self.dropped + _by_name(summary.counts) + _by_name(unwritten)
        return replace(self, current=None, dropped=dropped)

    def drop_finished(self, files: Sequence[FinishedFile]) -> 'WrittenFiles':
        """Return the files without some of the finished ones."""
        lost = sum((_by_name(file.summary.counts) for file in files), Counter[str]())
        finished = tuple(file for file in self.finished if file not in files)
        written, dropped = self.written - lost, self.dropped + lost
        return replace(self, finished=finished, written=written, dropped=dropped)


def _by_name(counts: Mapping[Topic, int]) -> Counter[str]:
    named = Counter[str]()
    for topic, count in counts.items():
        named[topic.name] += count
    return named
