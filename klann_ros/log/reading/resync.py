"""
Find the next sound record behind damage whose end is not known.

A place is believed when what stands there is whole: a chunk when it unpacks and its CRC holds, any
other record when its lengths agree and another record may follow it.
"""

from __future__ import annotations

from functools import partial
import re
import struct
from typing import TYPE_CHECKING

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from .chunks import chunk_content
from .container import may_start, MESSAGE_HEAD, read, span_at
from .layout import lengths_agree
from .parsing import parse, parse_attachment, parse_schema

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import BinaryIO

    from .container import Span

_PIECE = 1024 * 1024
_LENGTH = struct.Struct('<Q')
_INDEX_HEAD, _INDEX_ENTRY = 6, 16

# Records that may stand anywhere; those that are found in pieces of a chunk as well, which is why
# they count only in a file without chunks.
_ANYWHERE = (
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
)
_OUTSIDE = (*_ANYWHERE, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
_PARSERS: dict[int, Callable[[bytes], object]] = {
    Opcode.METADATA: partial(parse, Metadata),
    Opcode.SCHEMA: parse_schema,
    Opcode.CHANNEL: partial(parse, Channel),
    Opcode.ATTACHMENT: parse_attachment,
}
# How many records in a row make a message believable, which has nothing else to be known by.
_ROW = 3


class Search:
    """
    Looks for sound records in an open file of a size [bytes].

    What it reads in vain is limited by the size, so that heads laid one into the other, each of
    which claims the rest of the file, do not make it read the file again for each.
    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self._patience = 4 * size

    def record(self, start: int, *, chunked: bool) -> int | None:
        """Return where the next sound record is, from an offset on; None if there is none."""
        return self._first(start, self._size, _ANYWHERE if chunked else _OUTSIDE)

    def chunk(self, start: int, end: int, *, over: int = 0) -> int | None:
        """
        Return where the first sound chunk is that starts between two offsets.

        One that ends behind the offset ``over``, where the record around it may hold a log of its
        own, such as an attachment.
        """
        return self._first(start, end, (Opcode.CHUNK,), over)

    def is_whole(self, span: Span) -> bool:
        """Return whether a record whose lengths agree holds what it should."""
        self._patience -= span.length
        try:
            return self._patience > 0 and self._is_whole(span)
        except DamagedError:
            return False

    def _first(
        self, start: int, stop: int, opcodes: tuple[Opcode, ...], over: int = 0
    ) -> int | None:
        places = (at for at in self._heads(start, stop, opcodes) if self._holds(at, over))
        return next(places, None)

    def _heads(self, start: int, stop: int, opcodes: tuple[Opcode, ...]) -> Iterator[int]:
        """Yield where a record of these kinds, of less than 2^40 bytes, may stand."""
        pattern = re.compile(b'[' + re.escape(bytes(opcodes)) + rb'](?=[\s\S]{5}\0\0\0)')
        for offset in range(start, stop, _PIECE):
            self._file.seek(offset)
            size = min(_PIECE, stop - offset)
            piece = self._file.read(size + _LENGTH.size)
            for match in pattern.finditer(piece):
                if match.start() >= size or match.end() + _LENGTH.size > len(piece):
                    break
                (length,) = _LENGTH.unpack_from(piece, match.end())
                if offset + match.end() + _LENGTH.size + length <= self._size:
                    yield offset + match.start()

    def _holds(self, offset: int, over: int) -> bool:
        try:
            span = span_at(self._file, offset, self._size)
            if span.end <= over:
                return False
            if span.opcode == Opcode.MESSAGE:
                return self._is_row(span)
            follows = span.opcode == Opcode.CHUNK or may_start(self._file, span.end, self._size)
            return follows and lengths_agree(self._file, span) and self.is_whole(span)
        except DamagedError:
            return False

    def _is_whole(self, span: Span) -> bool:
        content = read(self._file, span)
        if span.opcode == Opcode.CHUNK:
            found = chunk_content(content, span.offset)
            return len(found.data) > 0 and not found.broken
        if span.opcode in _PARSERS:
            _PARSERS[span.opcode](content)
        elif span.opcode == Opcode.MESSAGE_INDEX:
            return span.length > _INDEX_HEAD and (span.length - _INDEX_HEAD) % _INDEX_ENTRY == 0
        return True

    def _is_row(self, span: Span) -> bool:
        """Return whether a message is followed by more records, up to the end if that is near."""
        for _ in range(_ROW):
            if span.opcode not in _OUTSIDE or not may_start(self._file, span.end, self._size):
                return False
            if span.opcode == Opcode.MESSAGE and span.length < MESSAGE_HEAD:
                return False
            try:
                span = span_at(self._file, span.end, self._size)
            except DamagedError:
                # The end, or a record that is cut off.
                return True
        return True
