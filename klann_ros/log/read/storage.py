"""What any file of a log can be asked, however it is stored."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable_line

from .block import MessageBlock
from .sources import Source


class Storage(Protocol):
    """
    A file of a log, open for reading; nothing that stands in it raises.

    What is damaged is left out, and a problem from then on. A new kind of file is a class like
    this, and a line in :mod:`klann_ros.log.read.opening`.
    """

    # The file that the user has, and how to call it in a line to people.
    path: Path
    name: str
    # How far the places go that blocks tell [bytes].
    size: int
    # The MCAP profile of its content, such as ``ros2``; '' if unknown.
    profile: str
    # Whether it ends as a file does that was closed.
    closed: bool
    # What was found to be wrong so far, by offset; it grows while it is read.
    problems: 'Problems'
    # From when to when messages stood in what is damaged [ns], as far as known; it grows, too.
    holes: set[tuple[int, int]]

    def overview(self) -> 'Overview':
        """Return what it holds."""

    def sources(self, overview: 'Overview') -> Iterator[Source]:
        """Yield what can be read by itself."""

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large pieces as they stand in it, and where each is [bytes]."""

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """Return the name and content of a metadata record of the overview."""

    def attachment_at(self, offset: int) -> Attachment | None:
        """Return an attachment of the overview."""

    def first_data(self) -> bytes:
        """Return the bytes of the message that stands first; b'' if there is none."""

    def salvage(self) -> 'Salvage':
        """Return a pass over all that is intact in it."""

    def close(self) -> None:
        """Let go of what was unpacked or copied to read it."""


class Salvage(Protocol):
    """All that is intact in a file, for a new run; messages first."""

    # What was left out so far, and where, one line each.
    lost: list[str]
    # What else is to be said, one line each.
    remarks: list[str]

    def messages(self) -> Iterator[Message]:
        """Yield all intact messages in the order in which they stand in it."""

    def attachments(self) -> Iterator[Attachment]:
        """Yield the intact attachments."""

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the names and contents of the intact metadata records."""


@dataclass(frozen=True)
class Problem:
    """Something wrong in a file: the offset [bytes], and what, in one line."""

    offset: int
    text: str

    @property
    def place(self) -> str:
        """Return where it is, to stand behind the file's name; '' if it is the file as a whole."""
        return f' at byte {self.offset}' if self.offset >= 0 else ''


class Problems(dict[int, Problem]):
    """What was found to be wrong in a file so far, the first at each offset."""

    def note(self, offset: int, text: str) -> None:
        """Remember that something is wrong at an offset [bytes]."""
        self.setdefault(offset, Problem(offset, printable_line(text)))

    def note_whole(self, text: str) -> None:
        """Remember that something is wrong that has no place, once."""
        shown = printable_line(text)
        if all(problem.text != shown for problem in self.values()):
            self.note(-1 - len(self), shown)


@dataclass(frozen=True)
class Overview:
    """What a file holds: topics, first and last log time [ns], offsets of other records."""

    topics: list[Topic]
    times: tuple[int, int] | None
    metadata: list[int]
    attachments: list[int]
