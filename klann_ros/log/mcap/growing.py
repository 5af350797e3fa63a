"""An MCAP file that is being written, read as it grows; each byte once."""

from collections.abc import Iterator
import os
from pathlib import Path

from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Message
from klann_ros.sanitize.files import open_regular
from mcap.opcode import Opcode
from mcap.records import Metadata

from .channels import Channels
from .container import MAGIC, read
from .content import chunk_content, Content, message_content
from .decompression import DecompressionBudget
from .layout import is_known, least, RECORD_HEAD, RecordSpan
from .parsing import parse

# A recorder writes records that are not longer [bytes]; what claims to be is damaged.
LONGEST = 256 * 1024 * 1024

NamedRecord = tuple[str, dict[str, str]]


class GrowingFile:
    """
    Reads whole records, as far as there are any.

    Parameters
    ----------
    path : Path
        The file.

    Attributes
    ----------
    is_finished : bool
        Whether the end of its data was met.
    problem : str
        Why nothing more can be read of it; '' while there may be more.

    Raises
    ------
    OSError
        It cannot be opened, or read.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_finished, self.problem = False, ''
        self._file = open_regular(path)
        self._next = 0
        self._channels, self._budget = Channels(), DecompressionBudget()

    def close(self) -> None:
        """Let go of it."""
        self._file.close()

    @property
    def is_gone(self) -> bool:
        """Return whether it was removed."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    def read(self) -> Iterator[Message | NamedRecord]:
        """Yield the messages and metadata records that were added since it was read last."""
        try:
            while not self.is_finished and (span := self._whole()) is not None:
                self._next = span.end
                yield from self._contents(span)
        except DamagedError as damage:
            self.problem = f'{damage.reason} at byte {damage.offset}'

    def _whole(self) -> RecordSpan | None:
        """Return the next record; None while it is not there as a whole."""
        size = os.fstat(self._file.fileno()).st_size
        if size < self._next:
            raise DamagedError('it was cut off', size)
        if not self._next:
            if size < len(MAGIC):
                return None
            self._file.seek(0)
            if self._file.read(len(MAGIC)) != MAGIC:
                raise DamagedError('it does not start as an MCAP file does', 0)
            self._next = len(MAGIC)
        if size < self._next + RECORD_HEAD.size:
            return None
        self._file.seek(self._next)
        opcode, length = RECORD_HEAD.unpack(self._file.read(RECORD_HEAD.size))
        if not opcode or length > LONGEST or (is_known(opcode) and length < least(opcode)):
            raise DamagedError('what stands there is no record', self._next)
        span = RecordSpan(opcode, self._next, length)
        return span if span.end <= size else None

    def _contents(self, span: RecordSpan) -> Iterator[Message | NamedRecord]:
        if span.opcode == Opcode.CHUNK:
            content = chunk_content(read(self._file, span), span.offset, self._budget)
            self._channels.add_all(content.definitions(), span.offset, verified=content.verified)
            yield from self._messages(content)
        elif span.opcode == Opcode.MESSAGE:
            yield from self._messages(message_content(read(self._file, span), span.offset))
        elif span.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._channels.add(span.opcode, read(self._file, span), span.offset)
        elif span.opcode == Opcode.METADATA:
            record = parse(Metadata, read(self._file, span), span.offset)
            yield record.name, record.metadata
        elif span.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            self.is_finished = True

    def _messages(self, content: Content) -> Iterator[Message]:
        for channel, sequence, logged, published, data in content.rows():
            topic = self._channels.topic(channel)
            if topic is not None:
                yield Message(topic, data, logged, published, sequence)
        if content.broken:
            raise DamagedError(f'a chunk can be read in part only: {content.broken}', self._next)
