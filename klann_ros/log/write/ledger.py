"""What became of every message of a recording: an account for each topic, one sum for all."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from klann_ros.log.bag_metadata import FileSummary
from klann_ros.log.loss import LossCounter
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import TopicCount

from .file_watch import Seal
from .mcap_file import McapFile


@dataclass(slots=True)
class Account:
    """
    What became of a topic's messages before they were written.

    Each number is counted by one thread only, so none needs a lock.
    """

    # How many came.
    received: int = 0
    # How many were lost before they came.
    loss: LossCounter = field(default_factory=LossCounter)
    # How many came during a pause.
    left_out: int = 0
    # How many did not fit into the queue, or came when nothing was written any more.
    overrun: int = 0
    # How many were taken out of the queue, and could not be written.
    unwritten: int = 0


@dataclass(frozen=True)
class Tally:
    """What became of a topic's messages up to a moment."""

    received: int = 0
    left_out: int = 0
    lost: int = 0
    early: int = 0
    left: int = 0


# By the topic's name.
Mark = Mapping[str, Tally]
_NOTHING = Tally()


@dataclass(frozen=True)
class Fate:
    """What became of the messages that a run was given."""

    # How many are in it, by the topic's name.
    written: Counter[str]
    # How many were written and are not in it any more, or not known to be.
    gone: Counter[str]


class Run(Protocol):
    """A run that is being written."""

    def fate(self) -> Fate:
        """Return what became of the messages that it was given so far."""


class Ledger:
    """
    The accounts of a recording.

    What does not wait in the queue is in exactly one place: received = left out + dropped +
    written, for each topic.

    Parameters
    ----------
    run : Run
        Where messages are written.

    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._accounts: dict[str, Account] = {}

    def __getitem__(self, topic: str) -> Account:
        """Return the account of a topic, which is opened by asking."""
        account = self._accounts.get(topic)
        # Two threads may ask for the first time at once.
        return self._accounts.setdefault(topic, Account()) if account is None else account

    def left_out(self) -> Counter[str]:
        """Return how many messages of each topic were left out so far, in all pauses."""
        return Counter({name: account.left_out for name, account in self._items()})

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic so far; any thread may ask."""
        fate = self._run.fate()
        return {
            name: TopicCount(
                received=account.received,
                written=fate.written[name],
                dropped=account.overrun + account.unwritten + fate.gone[name],
                left_out=account.left_out,
                unheard=account.loss.lost if account.loss.is_known else None,
                early=account.loss.early,
                left=account.loss.left,
            )
            for name, account in self._items()
        }

    def mark(self) -> Mark:
        """Return what became of messages before they were written, up to now."""
        return {
            name: Tally(
                account.received,
                account.left_out,
                account.loss.lost,
                account.loss.early,
                account.loss.left,
            )
            for name, account in self._items()
        }

    def between(
        self, before: Mark, after: Mark, own: Mapping[str, TopicCount], again: Mapping[str, int]
    ) -> dict[str, TopicCount]:
        """
        Return what became of the messages of each topic between two moments.

        Parameters
        ----------
        before, after
            The two.
        own
            What became of those that were written somewhere of their own.
        again
            How many were given to that once more, though they came earlier.

        """
        counts = {}
        for name, account in self._items():
            first, last = before.get(name, _NOTHING), after.get(name, _NOTHING)
            written = own.get(name, TopicCount(0, 0))
            counts[name] = TopicCount(
                received=last.received - first.received + again.get(name, 0),
                written=written.written,
                dropped=written.dropped,
                left_out=last.left_out - first.left_out,
                unheard=last.lost - first.lost if account.loss.is_known else None,
                early=last.early - first.early,
                left=last.left - first.left,
            )
        return counts

    def _items(self) -> list[tuple[str, Account]]:
        # Another thread may open one meanwhile.
        return list(self._accounts.items())


@dataclass(frozen=True)
class FinishedFile:
    """A file of a run that is finished: what it holds, and by what it is known again."""

    summary: FileSummary
    seal: Seal


@dataclass(frozen=True)
class WrittenFiles:
    """
    The files of a run at a moment.

    It is never changed but replaced as a whole: other threads ask what became of the messages,
    and each of these is in one place at any time.
    """

    # The file in progress; None between two, and after the last.
    current: McapFile | None = None
    # Those that are finished, and where they were left.
    finished: tuple[FinishedFile, ...] = ()
    # How many messages are in the finished ones, by the topic's name.
    written: Counter[str] = field(default_factory=Counter)
    # How many were in others.
    gone: Counter[str] = field(default_factory=Counter)

    def fate(self) -> Fate:
        """Return what became of all messages so far."""
        if self.current is None:
            return Fate(self.written, self.gone)
        kept, lost = self.current.fate()
        return Fate(self.written + _by_name(kept.counts), self.gone + _by_name(lost))

    def summaries(self) -> list[FileSummary]:
        """Return what each file holds."""
        finished = [file.summary for file in self.finished]
        return finished if self.current is None else [*finished, self.current.summary()]

    def with_current(self, file: McapFile) -> 'WrittenFiles':
        """Return the same with a file in progress."""
        return replace(self, current=file)

    def with_current_finished(self) -> 'WrittenFiles':
        """Return the same when the file in progress is finished."""
        if self.current is None:
            return self
        summary = self.current.summary()
        file = FinishedFile(summary, self.current.watch.seal())
        written = self.written + _by_name(summary.counts)
        return replace(self, current=None, finished=(*self.finished, file), written=written)

    def without_current(self) -> 'WrittenFiles':
        """Return the same when the file in progress is gone."""
        if self.current is None:
            return self
        kept, lost = self.current.fate()
        gone = self.gone + _by_name(kept.counts) + _by_name(lost)
        return replace(self, current=None, gone=gone)

    def without(self, *files: FinishedFile) -> 'WrittenFiles':
        """Return the same when some of those that were finished are gone."""
        lost, names = Counter[str](), {file.seal.name for file in files}
        for file in files:
            lost += _by_name(file.summary.counts)
        finished = tuple(file for file in self.finished if file.seal.name not in names)
        written, gone = self.written - lost, self.gone + lost
        return replace(self, finished=finished, written=written, gone=gone)


def _by_name(counts: Mapping[Topic, int]) -> Counter[str]:
    named = Counter[str]()
    for topic, count in counts.items():
        named[topic.name] += count
    return named
