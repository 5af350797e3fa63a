"""What the files of a run hold while it is written, and what went with those that are gone."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from .ledger import Fate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from klann_ros.log.bag_metadata import FileSummary
    from klann_ros.log.records import Topic

    from .file_watch import Seal
    from .mcap_file import McapFile


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

    Attributes
    ----------
    current
        The file in progress; None between two, and after the last.
    finished
        Those that are finished, and where they were left.
    written
        How many messages are in the finished ones, by the topic's name.
    gone
        How many were in others.

    """

    current: McapFile | None = None
    finished: tuple[FinishedFile, ...] = ()
    written: Counter[str] = field(default_factory=Counter)
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

    def with_current(self, file: McapFile) -> WrittenFiles:
        """Return the same with a file in progress."""
        return replace(self, current=file)

    def with_current_finished(self) -> WrittenFiles:
        """Return the same when the file in progress is finished."""
        if self.current is None:
            return self
        summary = self.current.summary()
        file = FinishedFile(summary, self.current.watch.seal())
        written = self.written + _by_name(summary.counts)
        return replace(self, current=None, finished=(*self.finished, file), written=written)

    def without_current(self) -> WrittenFiles:
        """Return the same when the file in progress is gone."""
        if self.current is None:
            return self
        kept, lost = self.current.fate()
        gone = self.gone + _by_name(kept.counts) + _by_name(lost)
        return replace(self, current=None, gone=gone)

    def without(self, *files: FinishedFile) -> WrittenFiles:
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
