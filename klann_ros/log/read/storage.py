"""The interface of all files of a log, whatever their format: sources and blocks of messages."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
import shutil
import tempfile
from typing import NamedTuple, Protocol, TypeAlias
import weakref

from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable, printable_line
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

# Names of topics; None for all.
Topics: TypeAlias = Collection[str] | None

_PREFIX = 'klann_ros-unpacked-'
# Space that stays free for others [bytes].
_MIN_FREE = 200 * 1024 * 1024

HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
"""Fields of an MCAP message record before its data."""

# Size of the fields that the record's length includes: all but opcode and length [bytes].
_HEAD_LENGTH = HEAD.itemsize - 9
# Differences of two times fit in 64 bits with a sign; this one is in the year 2116.
LAST_TIME = 2**62
# Millions of small messages would take more memory as Python's numbers than they have.
_MAX_BATCH = 4096


@dataclass(frozen=True, eq=False)
class MessageBlock:
    """Consecutive messages of a log, in the order of the file."""

    # The bytes that contain them.
    data: memoryview
    # Channel, sequence, log time and publish time [ns] of each; dtype HEAD.
    heads: NDArray[np.void]
    # Offset of each message's data in ``data``; shape (n,).
    starts: NDArray[np.int64]
    # The topics of the known channels.
    topics: Mapping[int, Topic]

    def __len__(self) -> int:
        return len(self.starts)

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """Return the size of each message's data [bytes], shape (n,)."""
        return self.heads['length'].astype(np.int64) - _HEAD_LENGTH

    @cached_property
    def log_times(self) -> NDArray[np.int64]:
        """Return the log times as signed integers [ns], shape (n,): a log may hold any 64 bits."""
        return self._signed('log_time')

    @cached_property
    def publish_times(self) -> NDArray[np.int64]:
        """Return the publish times as signed integers [ns], shape (n,)."""
        return self._signed('publish_time')

    def _signed(self, name: str) -> NDArray[np.int64]:
        return np.asarray(np.minimum(self.heads[name], np.uint64(LAST_TIME)).astype('i8'))

    def message(self, row: int) -> bytes:
        """Return the data of one message."""
        begin = int(self.starts[row])
        end = begin + int(self.heads['length'][row]) - _HEAD_LENGTH
        return self.data[begin:end].tobytes()

    @property
    def times(self) -> tuple[int, int] | None:
        """Return the earliest and the latest log time [ns]; None without a message."""
        times = self.heads['log_time']
        return (int(times.min()), int(times.max())) if len(times) else None

    @property
    def channels(self) -> set[int]:
        """Return the channels of the messages."""
        return set(np.flatnonzero(np.bincount(self.heads['channel'])).tolist())

    def messages(
        self, names: Collection[str] | None = None, *, by_time: bool = False
    ) -> Iterator[Message]:
        """Yield the messages of known topics, of some names or all, by log time if wanted."""
        order = np.argsort(self.heads['log_time'], kind='stable') if by_time else None
        topics = self.topics
        data = self.data
        for first in range(0, len(self), _MAX_BATCH):
            batch = slice(first, first + _MAX_BATCH)
            indices = batch if order is None else order[batch]
            starts = self.starts[indices].tolist()
            for start, head in zip(starts, self.heads[indices].tolist(), strict=True):
                _, length, channel, sequence, log_time, publish_time = head
                topic = topics.get(channel)
                if topic is not None and (names is None or topic.name in names):
                    end = start + length - _HEAD_LENGTH
                    yield Message(
                        topic, data[start:end].tobytes(), log_time, publish_time, sequence
                    )

    def rows(self, indices: NDArray[np.bool_] | NDArray[np.intp], size: int) -> NDArray[np.uint8]:
        """Return the data of some messages of the same size, shape (number, size)."""
        windows = sliding_window_view(np.frombuffer(self.data, np.uint8), size)
        return np.asarray(windows[self.starts[indices]])


def block_of_messages(
    heads: NDArray[np.void], messages: Sequence[bytes], topics: Mapping[int, Topic]
) -> MessageBlock:
    """Return separate messages as a block; the heads get their lengths."""
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    heads['length'] = sizes + _HEAD_LENGTH
    return MessageBlock(memoryview(b''.join(messages)), heads, np.cumsum(sizes) - sizes, topics)


@dataclass(frozen=True)
class Source:
    """Messages that are read together: a chunk of an index, or a whole file without one."""

    # Log time of the earliest and the latest message [ns].
    start: int
    end: int
    # Yields the messages of some topics ordered by log time.
    read: Callable[[Topics], Iterator[Message]]


@dataclass(frozen=True)
class LogProblem:
    """A fault of a file: its offset [bytes], negative for the whole file, and one line."""

    offset: int
    text: str
    # Whether a part of the content is lost.
    is_loss: bool = False
    # Whether it is not damage, but beyond a limit of this machine.
    is_refusal: bool = False

    @property
    def place(self) -> str:
        """Return the place, to follow the file's name; '' for the whole file."""
        return f' at byte {self.offset}' if self.offset >= 0 else ''


class Problems(dict[int, LogProblem]):
    """The problems of a file so far, one at each offset: the first loss, or else the first."""

    def note(
        self, offset: int, text: str, *, is_loss: bool = False, is_refusal: bool = False
    ) -> None:
        """Add a problem at an offset [bytes]."""
        if offset not in self or (is_loss and not self[offset].is_loss):
            self[offset] = LogProblem(offset, printable_line(text), is_loss, is_refusal)

    def note_whole(self, text: str, *, is_loss: bool = False, is_refusal: bool = False) -> None:
        """Add a problem of the whole file, once."""
        line = printable_line(text)
        if all(problem.text != line for problem in self.values()):
            self.note(-1 - len(self), line, is_loss=is_loss, is_refusal=is_refusal)

    def lines(self, name: str, *, losses: bool | None = None) -> list[str]:
        """Return the problems of a file with a name, all or the losses or not, one line each."""
        return [
            f'{name}{problem.place}: {problem.text}'
            for problem in list(self.values())
            if losses in (None, problem.is_loss)
        ]


class Overview(NamedTuple):
    """The topics of a file, and its first and last log time [ns]; None without a message."""

    topics: list[Topic]
    times: tuple[int, int] | None


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
        """Return an overview of the content."""

    def sources(self) -> Iterator[Source]:
        """Yield the parts that can be read separately."""

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large blocks in the order of the file, with their offsets."""

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the name and content of each metadata record."""

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments."""

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
        """Remove the temporary file with all files beside it."""
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
            # A buffer would fail again when it is closed, without a remedy.
            file = self.path.with_name(self.path.name + suffix).open('wb', buffering=0)
        with file:
            for piece in pieces:
                room -= len(piece)
                self._check_room(0, room)
                with self._disk():
                    self._check_room(len(piece), file.write(piece))

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
