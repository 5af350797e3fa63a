"""A recording as a whole: its run, its pauses, and what became of every message."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from klann_ros.log.run_parameters import (
    LOSS_RECORD,
    loss_record,
    PAUSE_RECORD,
    pause_record,
    TopicCount,
)

from .background_writer import BackgroundWriter
from .free_space import free_space
from .pauses import Pauses
from .writer import RunWriter


class Heard(Protocol):
    """A topic that is listened to: what was received, and what was lost before [messages]."""

    received: int

    @property
    def unheard(self) -> int | None:
        """Return how many messages were lost before they came; None if nobody can tell."""


@dataclass(frozen=True)
class RecordingState:
    """
    A recording at a moment.

    Attributes
    ----------
    counts : dict of str to TopicCount
        What became of the messages of each topic so far.
    queued : int
        Messages that wait for the disk.
    file : str
        The file that is being written.
    size, free : int
        Its size, and the free space on its disk [bytes].
    paused : bool
        Whether messages are left out now.
    failure : str
        What ended the writing; empty while there is nothing.

    """

    counts: Mapping[str, TopicCount]
    queued: int
    file: str
    size: int
    free: int
    paused: bool
    failure: str = ''

    @property
    def lost(self) -> int:
        """Return how many messages were lost, of those topics where that can be told."""
        return sum(count.lost or 0 for count in self.counts.values())


class Recording:
    """
    What a recorder does with what it hears.

    Parameters
    ----------
    writer
        The run.
    background
        Writes to it.
    topics
        What is heard, by name; it grows.
    pauses
        What is left out.

    """

    def __init__(
        self,
        writer: RunWriter,
        background: BackgroundWriter,
        topics: Mapping[str, Heard],
        pauses: Pauses,
    ) -> None:
        self._pauses = pauses
        self._writer, self._background, self._topics = writer, background, topics

    def split(self) -> tuple[bool, str]:
        """Go on in a new file; return whether that was done, and its name or why not."""
        if self._writer.file_is_empty:
            return False, f'there is no message in {self._writer.file_path.name} yet'
        return True, self._background.split()

    def describe_pause(self) -> None:
        """Write of a pause to the run, when all that was received in it was taken."""
        record = pause_record(self._pauses.last())
        self._background.put_entry(lambda run: run.add_metadata(PAUSE_RECORD, record))

    def state(self) -> RecordingState:
        """Return how it stands."""
        failure = self._background.failure
        written = self._writer.counts
        return RecordingState(
            counts={
                name: self._count(name, written.get(name, 0), self._background.dropped(name))
                for name in self._topics
            },
            queued=self._background.queued,
            file=str(self._writer.file_path),
            size=self._writer.file_size,
            free=free_space(self._writer.path),
            paused=self._pauses.paused,
            failure='' if failure is None else str(failure),
        )

    def finish(self) -> tuple[bool, str]:
        """Finish the run, when all was put; return whether all went well, and what to say."""
        failure = self._background.close(
            lambda run: run.add_metadata(LOSS_RECORD, loss_record(self._final_counts()))
        )
        counts = self._final_counts().values()
        path, written = self._writer.path, sum(count.written for count in counts)
        lost = sum(count.lost or 0 for count in counts)
        said = f'{written} messages of {len(counts)} topics are in {path}; {lost} were lost'
        if failure is None:
            return True, said
        is_whole = self._writer.failure is None
        what_to_do = '' if is_whole else f'; `recover {path}` finishes the run'
        return False, f'the recording stopped early: {failure}; {said}{what_to_do}'

    def _final_counts(self) -> dict[str, TopicCount]:
        """Return what became of every message when nothing is queued any more."""
        counts = {}
        for name, topic in self._topics.items():
            written = self._writer.counts.get(name, 0)
            dropped = topic.received - self._pauses.left_out[name] - written
            counts[name] = self._count(name, written, dropped)
        return counts

    def _count(self, name: str, written: int, dropped: int) -> TopicCount:
        topic = self._topics[name]
        return TopicCount(
            topic.received, written, dropped, self._pauses.left_out[name], topic.unheard
        )
