"""
What speaks for a record of a damaged file, and where the next sound one is.

Nothing is certain but a CRC that matches. Everything else is judged by a record's payload and by
its successor; `VERDICTS` has all cases.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from enum import IntEnum
from functools import cache, partial
from operator import attrgetter
import re
import struct
from typing import BinaryIO

from klann_ros.log.errors import DamagedError
from klann_ros.sanitize.files import next_data
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from . import records
from .content import chunk_content
from .decompression import COMPRESSIONS, DecompressionBudget


class Payload(IntEnum):
    """What the content of a record says for it."""

    INVALID = 0  # the fields do not fit or cannot be read, or the kind is unknown
    FITTING = 1  # fields that can be read with more behind them; or a message
    EXACT = 2  # fields that can be read and fill the record
    PROVEN = 3  # a CRC that matches; or a chunk that unpacks to its declared size


class Successor(IntEnum):
    """What stands where a record ends."""

    NONE = 0  # neither a record nor the end
    POSSIBLE = 1  # a damaged or truncated record, or zeros as after a power failure
    SOUND = 2  # a record whose lengths agree, several plausible ones, or the end


class RecordVerdict(IntEnum):
    """Whether a record ends where its length says."""

    REJECT = 0
    ALONE = 1  # accepted unless a sound chunk starts inside of it
    ACCEPT = 2


_REJECT, _ALONE, _ACCEPT = RecordVerdict
# By payload and successor (NONE, POSSIBLE, SOUND): the verdict on a record that follows a sound
# one, and whether it is sound if it was found by searching behind damage.
VERDICTS = {
    Payload.INVALID: ((_REJECT, _ALONE, _ACCEPT), (False, False, False)),
    Payload.FITTING: ((_REJECT, _ALONE, _ACCEPT), (False, False, True)),
    Payload.EXACT: ((_ALONE, _ALONE, _ACCEPT), (False, True, True)),
    Payload.PROVEN: ((_ALONE, _ALONE, _ACCEPT), (True, True, True)),
}
CHECKED_KINDS = (Opcode.CHUNK, Opcode.ATTACHMENT)
"""Kinds with a CRC of their own."""

_PARSERS: dict[int, Callable[[bytes], object]] = {
    Opcode.METADATA: partial(records.parse, Metadata),
    Opcode.SCHEMA: records.parse_schema,
    Opcode.CHANNEL: partial(records.parse, Channel),
}
# Kinds to resynchronise at. The others also occur in fragments of a chunk, so they count only in a
# file without chunks.
_TOP_LEVEL = (
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
)
_UNCHUNKED = (*_TOP_LEVEL, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
# Consecutive plausible records that count as sound, and that are no unknown fields.
_MIN_ROW, _FIELD_ROW = 3, 16
_MAX_KNOWN_LENGTH = 2**40
_LENGTH = struct.Struct('<Q')
# A length of less than 2^40 bytes.
_LENGTH_PATTERN = rb'[\s\S]{5}\0\0\0'
# The fields of a chunk: its length, times, size and CRC, its compression, the length of its data.
_NAMES = b'|'.join(re.escape(struct.pack('<I', len(name)) + name) for name in COMPRESSIONS)
_CHUNK_PATTERN = _LENGTH_PATTERN + rb'[\s\S]{28}(?:' + _NAMES + rb')' + _LENGTH_PATTERN
_MAX_PATTERN_SIZE = 64
_MIN_SEARCH_BLOCK, _SEARCH_BLOCK_SIZE = 4096, 1024 * 1024


class RecordCheck:
    """
    Judges and finds records of an open file of a size [bytes].

    The work is bounded by the size: nested heads that each claim the rest of the file do not make
    it read the file again for each.
    """

    def __init__(self, file: BinaryIO, size: int, budget: DecompressionBudget) -> None:
        self._file = file
        self._size = size
        self._budget = budget
        # Bytes that may still be read to judge payloads.
        self._left = 4 * size
        self._last: tuple[records.RecordSpan, Payload] | None = None
        # The sound chunks in a range of the file, each searched once.
        self._begin = self._until = 0
        self._chunks: list[records.RecordSpan] = []

    def payload(self, span: records.RecordSpan) -> Payload:
        """Return what the content of a record says for it."""
        if self._last is None or self._last[0] != span:
            self._last = span, self._payload(span)
        return self._last[1]

    def _payload(self, span: records.RecordSpan) -> Payload:
        """Return how well the content of a record fits its opcode and length."""
        end = records.fields_end(self._file, span)
        if end is None or not records.is_known(span.opcode):
            return Payload.INVALID
        if span.opcode == Opcode.MESSAGE:
            return Payload.FITTING
        self._left -= end - span.start
        try:
            if self._left <= 0:
                return Payload.INVALID
            if self._is_proven(span.opcode, records.read(self._file, span)):
                return Payload.PROVEN
        except DamagedError:
            return Payload.INVALID
        return Payload.EXACT if end == span.end else Payload.FITTING

    def _is_proven(self, opcode: int, content: bytes) -> bool:
        """Return whether a content has a matching CRC; raise if it is malformed."""
        if opcode == Opcode.CHUNK:
            chunk = chunk_content(content, 0, self._budget)
            if not len(chunk.data) or chunk.broken:
                raise DamagedError(chunk.broken)
            return True
        if opcode == Opcode.ATTACHMENT:
            records.parse_attachment(content)
            return records.attachment_crc(content) != 0
        if opcode == Opcode.MESSAGE_INDEX:
            size = len(content) - records.INDEX_HEAD.size
            if size <= 0 or size % records.INDEX_ENTRY:
                raise DamagedError('it has no entries')
        elif opcode in _PARSERS:
            _PARSERS[opcode](content)
        return False

    def proven_kind(self, span: records.RecordSpan) -> Opcode | None:
        """Return the kind that a CRC in a record proves, if its opcode is another one."""
        for kind in CHECKED_KINDS:
            candidate = records.RecordSpan(kind, span.offset, span.length)
            fits = kind != span.opcode and records.fields_end(self._file, candidate) == span.end
            if fits and self.payload(candidate) is Payload.PROVEN:
                return kind
        return None

    def successor(self, offset: int) -> Successor:
        """Return what stands at an offset where a record ends."""
        # One record of a known kind without unknown fields is enough, else a row of them.
        end = offset
        for _ in range(_MIN_ROW):
            if end == self._size:
                return Successor.SOUND
            try:
                span = records.span_at(self._file, end, self._size)
            except DamagedError:
                return self._damaged_successor(offset)
            fields_end = records.fields_end(self._file, span)
            if fields_end is None:
                return self._damaged_successor(offset)
            if fields_end == span.end and records.is_known(span.opcode):
                return Successor.SOUND
            end = span.end
        return Successor.SOUND

    def _damaged_successor(self, offset: int) -> Successor:
        """Return whether a record may have been at an offset."""
        if offset >= self._size:
            return Successor.NONE
        self._file.seek(offset)
        head = self._file.read(min(records.RECORD_HEAD.size, self._size - offset))
        if not any(head):
            return Successor.POSSIBLE
        if len(head) < records.RECORD_HEAD.size:
            return Successor.POSSIBLE if records.is_known(head[0]) else Successor.NONE
        opcode, length = records.RECORD_HEAD.unpack(head)
        size_left = self._size - offset - records.RECORD_HEAD.size
        limit = _MAX_KNOWN_LENGTH if records.is_known(opcode) else size_left
        return Successor.POSSIBLE if opcode and length <= limit else Successor.NONE

    def are_records(self, start: int, end: int) -> bool:
        """Return whether records of known kinds fill the range between two offsets."""
        for _ in range(_FIELD_ROW):
            if start == end:
                return True
            try:
                span = records.span_at(self._file, start, end)
            except DamagedError:
                return False
            if not records.is_known(span.opcode) or records.fields_end(self._file, span) is None:
                return False
            start = span.end
        return True

    def is_zero(self, start: int, end: int) -> bool:
        """Return whether there are only zeros between two offsets."""
        offset = next_data(self._file, start)
        while offset < end:
            self._file.seek(offset)
            if self._file.read(min(_SEARCH_BLOCK_SIZE, end - offset)).strip(b'\0'):
                return False
            offset = next_data(self._file, offset + _SEARCH_BLOCK_SIZE)
        return True

    def find_record(self, start: int, *, chunked: bool) -> int | None:
        """Return the offset of the next sound record; None if there is none."""
        kinds = _TOP_LEVEL if chunked else _UNCHUNKED
        span = next(self._sound(start, self._size, kinds), None)
        return None if span is None else span.offset

    def find_chunk(self, start: int, stop: int, *, beyond: int = 0) -> int | None:
        """
        Return the offset of the first sound chunk that starts between two offsets.

        Only chunks that end behind the offset ``beyond`` count, where the record around them may
        hold a log of its own, such as an attachment.
        """
        if not self._begin <= start <= self._until:
            self._begin = self._until = start
            self._chunks.clear()
        number = bisect_left(self._chunks, start, key=attrgetter('offset'))
        while number < len(self._chunks) or self._find_next_chunk(stop):
            span = self._chunks[number]
            if span.offset >= stop:
                return None
            if span.end > beyond:
                return span.offset
            number += 1
        return None

    def _find_next_chunk(self, stop: int) -> bool:
        if self._until >= stop:
            return False
        span = next(self._sound(self._until, stop, (Opcode.CHUNK,)), None)
        if span is None:
            self._until = stop
            return False
        self._until = span.offset + 1
        self._chunks.append(span)
        return True

    def _sound(
        self, start: int, stop: int, kinds: tuple[Opcode, ...]
    ) -> Iterator[records.RecordSpan]:
        """Yield the sound records of some kinds that start between two offsets."""
        pattern = _head_pattern(kinds)
        # Holes of a sparse file have no records.
        offset = next_data(self._file, start)
        size = _MIN_SEARCH_BLOCK
        while offset < stop:
            size = min(size, stop - offset)
            self._file.seek(offset)
            block = self._file.read(size + _MAX_PATTERN_SIZE)
            for match in pattern.finditer(block):
                if match.start() >= size:
                    break
                (length,) = _LENGTH.unpack_from(block, match.end())
                span = records.RecordSpan(block[match.start()], offset + match.start(), length)
                fits = span.end <= self._size and length >= records.min_size(span.opcode)
                if fits and self._is_sound(span):
                    yield span
            offset = next_data(self._file, offset + size)
            size = min(2 * size, _SEARCH_BLOCK_SIZE)

    def _is_sound(self, span: records.RecordSpan) -> bool:
        if span.opcode == Opcode.MESSAGE:
            return self._is_row(span.offset)
        payload = self.payload(span)
        return payload > Payload.INVALID and VERDICTS[payload][1][self.successor(span.end)]

    def _is_row(self, offset: int) -> bool:
        """Return whether a message is followed by more records, up to the end if that is near."""
        for _ in range(_MIN_ROW):
            try:
                span = records.span_at(self._file, offset, self._size)
            except DamagedError:
                # The end, or a truncated record.
                return True
            if records.is_known(span.opcode) and span.opcode not in _UNCHUNKED:
                return False
            if span.opcode == Opcode.MESSAGE and self.payload(span) is Payload.INVALID:
                return False
            if self.successor(span.end) is Successor.NONE:
                return False
            offset = span.end
        return True


@cache
def _head_pattern(kinds: tuple[Opcode, ...]) -> re.Pattern[bytes]:
    """Return the pattern of the first bytes of these kinds, a chunk among them."""
    plain_kinds = bytes(opcode for opcode in kinds if opcode != Opcode.CHUNK)
    patterns = [b'%c(?=%s)' % (Opcode.CHUNK, _CHUNK_PATTERN)]
    if plain_kinds:
        patterns.append(rb'[%s](?=%s)' % (re.escape(plain_kinds), _LENGTH_PATTERN))
    return re.compile(b'|'.join(patterns))
