"""The interface of all files of a log, whatever their format."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias

from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable_line

from .block import MessageBlock

# Names of topics; None for all.
Topics: TypeAlias = Collection[str] | None


@dataclass(frozen=True)
class Source:
    """Messages that are read together: a chunk of an index, or a whole file without one."""

    # Log time of the earliest and the latest message [ns].
    start: int
    end: int
    # Yields the messages of some topics ordered by log time.
    read: Callable[[Topics], Iterator[Message]]


@dataclass(frozen=True)
class Problem:
    """A fault of a file: its offset [bytes], negative for the whole file, and one line."""

    offset: int
    text: str
    # Whether a part of the content is lost.
    is_loss: bool = False

    @property
    def place(self) -> str:
        """Return the place, to follow the file's name; '' for the whole file."""
        return f' at byte {self.offset}' if self.offset >= 0 else ''


class Problems(dict[int, Problem]):
    """The problems of a file so far, one at each offset: the first loss, or else the first."""

    def note(self, offset: int, text: str, *, is_loss: bool = False) -> None:
        """Add a problem at an offset [bytes]."""
        if offset not in self or (is_loss and not self[offset].is_loss):
            self[offset] = Problem(offset, printable_line(text), is_loss)

    def note_whole(self, text: str, *, is_loss: bool = False) -> None:
        """Add a problem of the whole file, once."""
        shown = printable_line(text)
        if all(problem.text != shown for problem in self.values()):
            self.note(-1 - len(self), shown, is_loss=is_loss)

    def lines(self, name: str, *, losses: bool = True, others: bool = True) -> list[str]:
        """Return the losses, the other problems or both of a file with a name, one line each."""
        return [
            f'{name}{problem.place}: {problem.text}'
            for problem in list(self.values())
            if (losses if problem.is_loss else others)
        ]


@dataclass(frozen=True)
class Overview:
    """Content of a file: topics, first and last log time [ns], offsets of other records."""

    topics: list[Topic]
    times: tuple[int, int] | None
    metadata: list[int]
    attachments: list[int]


class Storage(Protocol):
    """
    A file of a log, open for reading; its content never raises an error.

    Damaged parts are left out, and are a problem from then on. A new format is a class like this,
    and a line in :mod:`klann_ros.log.read.opening`.
    """

    # The user's file, and its name in messages.
    path: Path
    name: str
    # Upper bound of the offsets of blocks [bytes].
    size: int
    # Whether it has the end of a closed file.
    closed: bool
    # The faults found so far; reading may find more.
    problems: Problems
    # The log times [ns] of damaged parts, as far as known; reading may find more.
    gaps: set[tuple[int, int]]
    # What a recovery tells beside the problems, one line each; complete after all blocks.
    remarks: list[str]

    def overview(self) -> Overview:
        """Return its content."""

    def sources(self, overview: Overview) -> Iterator[Source]:
        """Yield the parts that can be read separately."""

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large blocks in the order of the file, with their offsets."""

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """Return the name and content of a metadata record of the overview."""

    def attachment_at(self, offset: int) -> Attachment | None:
        """Return an attachment of the overview."""

    def first_data(self) -> bytes:
        """Return the data of the first message in the file; b'' if there is none."""

    def close(self) -> None:
        """Remove its unpacked or copied files."""
