"""The interface of all files of a log, whatever their format, and their temporary copies."""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import shutil
import tempfile
from typing import Protocol, TypeAlias
import weakref

from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable, printable_line

from .block import MessageBlock

# Names of topics; None for all.
Topics: TypeAlias = Collection[str] | None

_PREFIX = 'klann_ros-unpacked-'
# Space that stays free for others [bytes].
_MIN_FREE = 200 * 1024 * 1024


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
        line = printable_line(text)
        if all(problem.text != line for problem in self.values()):
            self.note(-1 - len(self), line, is_loss=is_loss)

    def lines(self, name: str, *, losses: bool | None = None) -> list[str]:
        """Return the problems of a file with a name, all or the losses or not, one line each."""
        return [
            f'{name}{problem.place}: {problem.text}'
            for problem in list(self.values())
            if losses in (None, problem.is_loss)
        ]


@dataclass(frozen=True)
class Overview:
    """Content of a file: topics, first and last log time [ns], offsets of other records."""

    topics: list[Topic]
    times: tuple[int, int] | None
    metadata: list[int]
    attachments: list[int]


def spanned_time(times: Iterable[tuple[int, int] | None]) -> tuple[int, int] | None:
    """Return the first and the last of many times [ns]; None if none of them is known."""
    spans = [span for span in times if span is not None]
    if not spans:
        return None
    return min(start for start, _ in spans), max(end for _, end in spans)


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


class TemporaryFile:
    """
    An unpacked or copied log below TMPDIR, removed with this object or at the end of the process.

    All errors of its disk are a NotALogError of the source, the log that it is made from.
    """

    def __init__(self, source: AnyPath, name: str) -> None:
        self._source = source
        with self._disk():
            folder = tempfile.mkdtemp(prefix=_PREFIX)
        self.path = Path(folder, name)
        self._remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def close(self) -> None:
        """Remove it with all files beside it."""
        self._remove()

    def write(self, pieces: Iterable[bytes], suffix: str = '', size: int = 0) -> None:
        """
        Write the file, or one beside it whose name has a suffix.

        Nothing is written if the disk has no room for a known size [bytes]. An OSError means that
        the pieces cannot be read.
        """
        with self._disk():
            room = shutil.disk_usage(self.path.parent).free - _MIN_FREE
            self._check_room(size, room)
            file = self.path.with_name(self.path.name + suffix).open('wb')
        with file:
            for piece in pieces:
                room -= len(piece)
                self._check_room(0, room)
                with self._disk():
                    file.write(piece)
                    file.flush()

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Convert an error of this disk; reading the source may raise its own."""
        try:
            yield
        except OSError as error:
            raise self._refusal(error.strerror or str(error)) from None

    def _check_room(self, size: int, room: int) -> None:
        if size > room:
            raise self._refusal('there is no room for it')

    def _refusal(self, reason: str) -> NotALogError:
        folder = tempfile.gettempdir()
        return NotALogError(
            self._source,
            f'it has to be unpacked, or copied, to {folder} to be read: {reason}; '
            'let TMPDIR name a folder with room',
        )


def storage_name(path: Path, unpacked: TemporaryFile | None) -> str:
    """Return the name of a file in messages."""
    return printable(path.name) + (' (unpacked)' if unpacked else '')
