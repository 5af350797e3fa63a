"""An MCAP file that is being written, read as it grows."""

from collections.abc import Iterator
from dataclasses import replace
import os
from pathlib import Path

from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Message
from klann_ros.sanitize.files import open_regular
from mcap.opcode import Opcode
from mcap.records import Metadata

from .content import chunk_content, Content, message_content
from .decompression import DecompressionBudget
from .records import DEFINITIONS, is_known, MAGIC, min_size, parse, read, RECORD_HEAD, RecordSpan
from .summary import Channels

# Recorders write no longer records [bytes]; a larger length is damaged.
_MAX_RECORD_SIZE = 256 * 1024 * 1024

NamedRecord = tuple[str, dict[str, str]]


class GrowingFile:
    """Reads whole records as they appear, each byte once; an OSError if it cannot be read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        # Whether the end of its data was reached.
        self.is_finished = False
        # Why nothing more can be read; '' while it can.
        self.problem = ''
        self._file = open_regular(path)
        # Offset of the next record [bytes].
        self._next = 0
        self._channels = Channels()
        self._budget = DecompressionBudget()

    def close(self) -> None:
        """Close it."""
        self._file.close()

    @property
    def is_gone(self) -> bool:
        """Return whether it was removed."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    def read(self) -> Iterator[Message | NamedRecord]:
        """Yield the messages and metadata records that were added since the last call."""
        try:
            while not self.is_finished and (span := self._next_span()) is not None:
                self._next = span.end
                yield from self._read_record(span)
        except DamagedError as damage:
            self.problem = f'{damage.reason} at byte {damage.offset}'

    def _next_span(self) -> RecordSpan | None:
        """Return the place of the next record; None while it is incomplete."""
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
        too_short = is_known(opcode) and length < min_size(opcode)
        if not opcode or length > _MAX_RECORD_SIZE or too_short:
            raise DamagedError('what stands there is no record', self._next)
        span = RecordSpan(opcode, self._next, length)
        return span if span.end <= size else None

    def _read_record(self, span: RecordSpan) -> Iterator[Message | NamedRecord]:
        if span.opcode == Opcode.CHUNK:
            content = chunk_content(read(self._file, span), span.offset, self._budget)
            self._channels.add_all(content, span.offset)
            yield from self._messages(content)
        elif span.opcode == Opcode.MESSAGE:
            yield from self._messages(message_content(read(self._file, span), span.offset))
        elif span.opcode in DEFINITIONS:
            self._channels.add(span.opcode, read(self._file, span), span.offset)
        elif span.opcode == Opcode.METADATA:
            record = parse(Metadata, read(self._file, span), span.offset)
            yield record.name, record.metadata
        elif span.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            self.is_finished = True

    def _messages(self, content: Content) -> Iterator[Message]:
        block = content.block({})
        topics = {}
        for number in block.channels:
            topic = self._channels.topic(number)
            if topic is not None:
                topics[number] = topic
        yield from replace(block, topics=topics).messages()
        if content.broken:
            raise DamagedError(f'a chunk can be read in part only: {content.broken}', self._next)
