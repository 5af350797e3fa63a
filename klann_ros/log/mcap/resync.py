"""
Find the next sound record behind damage whose end is not known.

Any byte may be its opcode. Where one is, and a length behind it that ends in the file, what stands
there is believed as the table below says; a message, which has nothing to be known by, when it is
one of several records in a row.
"""

from bisect import bisect_left
from collections.abc import Iterator
from functools import cache
from operator import attrgetter
import re
import struct

from klann_ros.log.errors import DamagedError
from klann_ros.sanitize.files import next_data
from mcap.opcode import Opcode

from .container import span_at
from .decompression import COMPRESSIONS
from .evidence import Behind, Evidence, Inside
from .layout import is_known, least, RecordSpan

# What must stand behind a record that is found, at least; nothing makes up for no content.
_BELIEVED = {
    Inside.FITTING: Behind.RECORD,
    Inside.EXACT: Behind.PERHAPS,
    Inside.PROVEN: Behind.NOTHING,
}
# How many records in a row make a message believable.
_ROW = 3

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

_LENGTH = struct.Struct('<Q')
# A length of less than 2^40 bytes.
_LENGTH_PATTERN = rb'[\s\S]{5}\0\0\0'
# Of a chunk: its length, times, size and CRC, its compression, and the length of its data.
_NAMES = b'|'.join(re.escape(struct.pack('<I', len(name)) + name) for name in COMPRESSIONS)
_CHUNK_PATTERN = _LENGTH_PATTERN + rb'[\s\S]{28}(?:' + _NAMES + rb')' + _LENGTH_PATTERN
_LONGEST_PATTERN = 64
_FIRST_PIECE, _PIECE = 4096, 1024 * 1024


@cache
def _heads_pattern(opcodes: tuple[Opcode, ...]) -> re.Pattern[bytes]:
    """Return what the head of a record of these kinds looks like, with a chunk among them."""
    others = bytes(opcode for opcode in opcodes if opcode != Opcode.CHUNK)
    patterns = [b'%c(?=%s)' % (Opcode.CHUNK, _CHUNK_PATTERN)]
    if others:
        patterns.append(rb'[%s](?=%s)' % (re.escape(others), _LENGTH_PATTERN))
    return re.compile(b'|'.join(patterns))


class Search:
    """Looks for sound records in an open file."""

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self._file, self._size = evidence.file, evidence.size
        self._chunks = _Chunks(self)

    def record(self, start: int, *, chunked: bool) -> int | None:
        """Return where the next sound record is, from an offset on; None if there is none."""
        kinds = _ANYWHERE if chunked else _OUTSIDE
        span = next(self.sound(start, self._size, kinds), None)
        return None if span is None else span.offset

    def chunk(self, start: int, stop: int, *, over: int = 0) -> int | None:
        """
        Return where the first sound chunk is that starts between two offsets.

        One that ends behind the offset ``over``, where the record around it may hold a log of its
        own, such as an attachment.
        """
        return self._chunks.first(start, stop, over)

    def sound(self, start: int, stop: int, opcodes: tuple[Opcode, ...]) -> Iterator[RecordSpan]:
        """Yield the sound records of these kinds that start between two offsets."""
        return filter(self._is_sound, self._heads(start, stop, opcodes))

    def _heads(self, start: int, stop: int, opcodes: tuple[Opcode, ...]) -> Iterator[RecordSpan]:
        """Yield what may be a record of these kinds, and ends in the file."""
        pattern = _heads_pattern(opcodes)
        # No record begins where nothing was ever written.
        offset, size = next_data(self._file, start), _FIRST_PIECE
        while offset < stop:
            size = min(size, stop - offset)
            self._file.seek(offset)
            piece = self._file.read(size + _LONGEST_PATTERN)
            for match in pattern.finditer(piece):
                if match.start() >= size:
                    break
                (length,) = _LENGTH.unpack_from(piece, match.end())
                span = RecordSpan(piece[match.start()], offset + match.start(), length)
                if span.end <= self._size and length >= least(span.opcode):
                    yield span
            offset = next_data(self._file, offset + size)
            size = min(2 * size, _PIECE)

    def _is_sound(self, span: RecordSpan) -> bool:
        if span.opcode == Opcode.MESSAGE:
            return self._is_row(span.offset)
        inside = self._evidence.inside(span)
        return inside in _BELIEVED and self._evidence.behind(span.end) >= _BELIEVED[inside]

    def _is_row(self, offset: int) -> bool:
        """Return whether a message is followed by more records, up to the end if that is near."""
        for _ in range(_ROW):
            try:
                span = span_at(self._file, offset, self._size)
            except DamagedError:
                # The end, or a record that is cut off.
                return True
            if is_known(span.opcode) and span.opcode not in _OUTSIDE:
                return False
            if span.opcode == Opcode.MESSAGE and self._evidence.inside(span) == Inside.NONE:
                return False
            if self._evidence.behind(span.end) == Behind.NOTHING:
                return False
            offset = span.end
        return True


class _Chunks:
    """
    The sound chunks in a stretch of a file, each looked for once.

    Records that each claim the rest of the file ask for the same ones again and again.
    """

    def __init__(self, search: Search) -> None:
        self._search = search
        self._begin = self._until = 0
        self._spans: list[RecordSpan] = []

    def first(self, start: int, stop: int, over: int) -> int | None:
        """Return where the first chunk starts between two offsets that ends behind a third."""
        if not self._begin <= start <= self._until:
            self._begin = self._until = start
            self._spans.clear()
        number = bisect_left(self._spans, start, key=attrgetter('offset'))
        while number < len(self._spans) or self._find(stop):
            span = self._spans[number]
            if span.offset >= stop:
                return None
            if span.end > over:
                return span.offset
            number += 1
        return None

    def _find(self, stop: int) -> bool:
        """Look for one more, up to an offset; return whether there is one."""
        if self._until >= stop:
            return False
        span = next(self._search.sound(self._until, stop, (Opcode.CHUNK,)), None)
        if span is None:
            self._until = stop
            return False
        self._until = span.offset + 1
        self._spans.append(span)
        return True
