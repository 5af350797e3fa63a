"""
What speaks for a record: its own content, and what stands behind it.

Nothing in a damaged file is certain but a CRC that holds. Lengths that agree exactly come close;
a record with more behind its fields, or of a kind that nobody knows, is just as legal, but some
bytes of chance look like that.
"""

from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import BinaryIO

from klann_ros.log.errors import DamagedError
from klann_ros.sanitize.files import next_data
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from .container import read, span_at
from .content import chunk_content
from .decompression import DecompressionBudget
from .layout import fields_end, is_known, RECORD_HEAD, RecordSpan
from .parsing import crc_of_attachment, parse, parse_attachment, parse_schema

_PIECE = 1024 * 1024
_INDEX_HEAD, _INDEX_ENTRY = 6, 16
# No record of a kind that is known is longer.
_CREDIBLE = 2**40
# So many records in a row are believed, though none of them is by itself.
_ROW = 3
_PARSERS: dict[int, Callable[[bytes], object]] = {
    Opcode.METADATA: partial(parse, Metadata),
    Opcode.SCHEMA: parse_schema,
    Opcode.CHANNEL: partial(parse, Channel),
}


class Inside(IntEnum):
    """How much the content of a record says for it."""

    NONE = 0
    """Its fields do not fit into it or cannot be read, or it has none that are known."""
    FITTING = 1
    """They can be read, and there is something behind them; or it is a message."""
    EXACT = 2
    """They can be read, and fill it."""
    PROVEN = 3
    """They have a CRC, which holds; or it is a chunk that unpacks to the size that it should."""


class Behind(IntEnum):
    """What stands where a record ends."""

    NOTHING = 0
    """Neither a record nor the end."""
    PERHAPS = 1
    """A record whose content is damaged or that is cut off, or the zeros that a power cut left."""
    RECORD = 2
    """A record whose lengths agree, several that may be some, or the end."""


class Evidence:
    """
    Looks at the records of an open file of a size [bytes].

    How much of it is read is limited by the size, so that heads laid one into the other, each of
    which claims the rest of the file, do not make it read the file again for each.
    """

    def __init__(self, file: BinaryIO, size: int, budget: DecompressionBudget) -> None:
        self.file = file
        self.size = size
        self._budget = budget
        self._left = 4 * size
        self._last: tuple[RecordSpan, Inside] | None = None

    def inside(self, span: RecordSpan) -> Inside:
        """Return what the content of a record says for it."""
        if self._last is None or self._last[0] != span:
            self._last = span, self._inside(span)
        return self._last[1]

    def behind(self, offset: int) -> Behind:
        """Return what stands at an offset, where a record ends."""
        end = offset
        for _ in range(_ROW):
            if end == self.size:
                return Behind.RECORD
            try:
                span = span_at(self.file, end, self.size)
            except DamagedError:
                return self._may_start(offset)
            fields = fields_end(self.file, span)
            if fields is None:
                return self._may_start(offset)
            if fields == span.end and is_known(span.opcode):
                return Behind.RECORD
            end = span.end
        return Behind.RECORD

    def only_zeros(self, start: int, end: int) -> bool:
        """Return whether there are only zeros between two offsets."""
        offset = next_data(self.file, start)
        while offset < end:
            self.file.seek(offset)
            if self.file.read(min(_PIECE, end - offset)).strip(b'\0'):
                return False
            offset = next_data(self.file, offset + _PIECE)
        return True

    def _inside(self, span: RecordSpan) -> Inside:
        end = fields_end(self.file, span)
        if end is None or not is_known(span.opcode):
            return Inside.NONE
        if span.opcode == Opcode.MESSAGE:
            return Inside.FITTING
        self._left -= end - span.start
        try:
            if self._left <= 0:
                return Inside.NONE
            if self._is_proven(span.opcode, read(self.file, span)):
                return Inside.PROVEN
        except DamagedError:
            return Inside.NONE
        return Inside.EXACT if end == span.end else Inside.FITTING

    def _is_proven(self, opcode: int, content: bytes) -> bool:
        """Return whether a content has a CRC; raise if it is not what it should be."""
        if opcode == Opcode.CHUNK:
            chunk = chunk_content(content, 0, self._budget)
            if not len(chunk.data) or chunk.broken:
                raise DamagedError(chunk.broken)
            return True
        if opcode == Opcode.ATTACHMENT:
            parse_attachment(content)
            return crc_of_attachment(content) != 0
        if opcode == Opcode.MESSAGE_INDEX:
            size = len(content) - _INDEX_HEAD
            if size <= 0 or size % _INDEX_ENTRY:
                raise DamagedError('it has no entries')
        elif opcode in _PARSERS:
            _PARSERS[opcode](content)
        return False

    def _may_start(self, offset: int) -> Behind:
        """Return whether a record may have been at an offset, though there is none now."""
        if offset >= self.size:
            return Behind.NOTHING
        left = self.size - offset - RECORD_HEAD.size
        self.file.seek(offset)
        head = self.file.read(min(RECORD_HEAD.size, self.size - offset))
        if not any(head):
            return Behind.PERHAPS
        if len(head) < RECORD_HEAD.size:
            return Behind.PERHAPS if is_known(head[0]) else Behind.NOTHING
        opcode, length = RECORD_HEAD.unpack(head)
        longest = _CREDIBLE if is_known(opcode) else left
        return Behind.PERHAPS if opcode and length <= longest else Behind.NOTHING
