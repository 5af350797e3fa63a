"""
MCAP records: their layout, their place in a file, and their content.

A file is a magic, records of an opcode (1 byte), a length (8 bytes) and a content, and the magic.
A record may be longer than its fields, as later versions may add some, but not shorter. No length
is trusted before it was compared with the bytes that are there. Damage raises a DamagedError.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import io
import struct
from typing import Any, BinaryIO, cast, Protocol, TypeVar
import zlib

from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Attachment
from klann_ros.sanitize.files import is_hollow
from klann_ros.sanitize.text import printable
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment as AttachmentRecord,
    ChunkIndex,
    Footer as FooterRecord,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

MAGIC = MCAP0_MAGIC
"""The first and the last 8 bytes of a file."""

RECORD_HEAD = struct.Struct('<BQ')
"""Opcode and length of the content, before each content."""

DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
SUMMARY_KINDS = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)
"""Records of a summary beside the statistics, in the order of the file."""

INDEX_HEAD = struct.Struct('<HI')
"""Channel and size of the entries of a message index, before them."""

INDEX_ENTRY = 16
"""Size of an entry of a message index: log time and offset [bytes]."""

# Numbers of 1 (B), 2 (H), 4 (I) and 8 (Q) bytes; fields behind their length of 4 (s: a text, a map
# or a list) or 8 bytes (L).
_LAYOUTS: dict[int, str] = {
    Opcode.HEADER: 'ss',
    Opcode.FOOTER: 'QQI',
    Opcode.SCHEMA: 'Hsss',
    Opcode.CHANNEL: 'HHsss',
    Opcode.MESSAGE: 'HIQQ',
    Opcode.CHUNK: 'QQQIsL',
    Opcode.MESSAGE_INDEX: 'Hs',
    Opcode.CHUNK_INDEX: 'QQQQsQsQQ',
    Opcode.ATTACHMENT: 'QQssLI',
    Opcode.METADATA: 'ss',
    Opcode.DATA_END: 'I',
    Opcode.ATTACHMENT_INDEX: 'QQQQQss',
    Opcode.METADATA_INDEX: 'QQs',
    Opcode.STATISTICS: 'QHIIIIQQs',
    Opcode.SUMMARY_OFFSET: 'BQQ',
}
# The specification rules out more fields in these.
_FINAL = (Opcode.DATA_END, Opcode.FOOTER)
_SIZES = {'B': 1, 'H': 2, 'I': 4, 'Q': 8}
_PREFIXES = {'s': 4, 'L': 8}
_MIN_SIZES = {
    opcode: sum((_SIZES | _PREFIXES)[field] for field in layout)
    for opcode, layout in _LAYOUTS.items()
}
_FOOTER = struct.Struct('<BQQQI')
_CHUNK_HEAD = struct.Struct('<QQQII')
_CRC_BLOCK_SIZE = 1024 * 1024
# Only these may be longer than MAX_RECORD_SIZE.
_LARGE = {Opcode.ATTACHMENT, Opcode.CHUNK, Opcode.MESSAGE}
_MAX_RECORD_SIZE = 64 * 1024 * 1024
_TEXT_ENCODINGS = ('ros2msg', 'ros2idl', 'ros1msg')

Parsed = TypeVar('Parsed', bound=McapRecord)


@dataclass(frozen=True, slots=True)
class RecordSpan:
    """Place of a record: opcode, offset of the record, length of its content [bytes]."""

    opcode: int
    offset: int
    length: int

    @property
    def start(self) -> int:
        """Return the offset of the content."""
        return self.offset + RECORD_HEAD.size

    @property
    def end(self) -> int:
        """Return the offset of the next record."""
        return self.offset + RECORD_HEAD.size + self.length


@dataclass(frozen=True, slots=True)
class Footer:
    """Footer of a closed file: its offset, the summary's, and the CRC of both; 0 for none."""

    offset: int
    summary_start: int
    crc: int


def is_known(opcode: int) -> bool:
    """Return whether the specification defines the opcode; others are private, or newer."""
    return opcode in _LAYOUTS


def min_size(opcode: int) -> int:
    """Return the minimum size of the content of a record of a known kind [bytes]."""
    return _MIN_SIZES[opcode]


def name_of(opcode: int) -> str:
    """Return the name of a kind of record for a message to the user."""
    if not is_known(opcode):
        return f'record of unknown kind {opcode}'
    return Opcode(opcode).name.lower().replace('_', ' ')


def fields_end(file: BinaryIO, span: RecordSpan) -> int | None:
    """Return the end of a record's fields [bytes], or of the record; None if they do not fit."""
    end, _ = _fields(file, span.opcode, span.start, span.end)
    return end


def has_no_content(file: BinaryIO, span: RecordSpan) -> bool:
    """Return whether a chunk or an attachment has no data, or a metadata record no fields."""
    end, size = _fields(file, span.opcode, span.start, span.end)
    is_minimal = end is not None and end - span.start == min_size(span.opcode)
    return size == 0 and (is_minimal or span.opcode != Opcode.METADATA)


def without_unknown_fields(opcode: int, content: bytes) -> bytes:
    """Return a record's content up to the end of its fields; all of it if they do not fit."""
    end, _ = _fields(io.BytesIO(content), opcode, 0, len(content))
    return content if end is None else content[:end]


def _fields(file: BinaryIO, opcode: int, start: int, end: int) -> tuple[int | None, int]:
    """Return the end of the fields, None if they do not fit, and the size of the last one."""
    position = start
    length = 0
    for field in _LAYOUTS.get(opcode, ''):
        if field in _SIZES:
            position += _SIZES[field]
            continue
        prefix_size = _PREFIXES[field]
        if position + prefix_size > end:
            return None, 0
        file.seek(position)
        length = int.from_bytes(file.read(prefix_size), 'little')
        position += prefix_size + length
    if position > end or (opcode in _FINAL and position < end):
        return None, 0
    return end if opcode == Opcode.MESSAGE else position, length


def spans(file: BinaryIO, start: int, end: int) -> Iterator[RecordSpan]:
    """Yield the places of the records between two offsets."""
    offset = start
    while offset != end:
        span = span_at(file, offset, end)
        yield span
        offset = span.end


def span_at(file: BinaryIO, offset: int, end: int) -> RecordSpan:
    """Return the place of the record at an offset; it must not reach beyond ``end``."""
    if offset > end:
        # An index may name offsets that no file can seek.
        raise DamagedError('it would be behind the end of the file', offset)
    file.seek(offset)
    head = file.read(RECORD_HEAD.size)
    size_left = end - offset - RECORD_HEAD.size
    if not any(head[:1]):
        raise DamagedError('what stands there is no record', offset)
    if size_left < 0 or len(head) < RECORD_HEAD.size:
        raise DamagedError('a record is cut off within its first 9 bytes', offset, head[0])
    opcode, length = RECORD_HEAD.unpack(head)
    if length > size_left:
        reason = f'the {name_of(opcode)} should be {length} bytes long, {size_left} are left'
        raise DamagedError(reason, offset, opcode)
    return RecordSpan(opcode, offset, length)


def contradiction(span: RecordSpan) -> str:
    """Return the text for a record whose fields do not fit into it."""
    return f'the lengths in the {name_of(span.opcode)} contradict each other'


def read(file: BinaryIO, span: RecordSpan) -> bytes:
    """Return a record's content without unknown fields."""
    name = name_of(span.opcode)
    end = fields_end(file, span)
    if end is None:
        raise DamagedError(contradiction(span), span.offset, span.opcode)
    size = end - span.start
    if size > _MAX_RECORD_SIZE and span.opcode not in _LARGE:
        reason = f'the {name} is {size} bytes long, the limit for one is {_MAX_RECORD_SIZE}'
        raise DamagedError(reason, span.offset, span.opcode)
    _check_written(file, span.start, span.end, name)
    file.seek(span.start)
    content = file.read(size)
    if len(content) < size:
        raise DamagedError('the file has become shorter', span.offset, span.opcode)
    return content


def find_footer(file: BinaryIO, size: int) -> Footer | None:
    """Return the footer of a file of this size [bytes]; None if it was not closed."""
    offset = size - len(MAGIC) - _FOOTER.size
    if offset < len(MAGIC):
        return None
    file.seek(offset)
    tail = file.read(_FOOTER.size + len(MAGIC))
    if len(tail) < _FOOTER.size + len(MAGIC) or not tail.endswith(MAGIC):
        return None
    opcode, length, summary_start, _, crc = _FOOTER.unpack_from(tail)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD_HEAD.size:
        return None
    return Footer(offset, summary_start, crc)


def check_summary(file: BinaryIO, footer: Footer) -> None:
    """Check the CRC, if any, of the summary and the footer."""
    if not len(MAGIC) <= footer.summary_start <= footer.offset:
        raise DamagedError('the summary would start outside of the file', footer.offset)
    end = footer.offset + _FOOTER.size - 4
    _check_crc(file, footer.summary_start, end, footer.crc, 'summary')


def check_data(file: BinaryIO, end: RecordSpan) -> bool:
    """Check the CRC of all data before the DataEnd record; return whether it has one."""
    crc = int.from_bytes(read(file, end), 'little')
    if crc:
        _check_crc(file, 0, end.offset, crc, 'data')
    return crc != 0


def _check_crc(file: BinaryIO, start: int, end: int, declared: int, name: str) -> None:
    """Raise a DamagedError if a part of the file has another CRC than the declared one."""
    _check_written(file, start, end, name)
    if not declared:
        return
    file.seek(start)
    crc = 0
    size_left = end - start
    while size_left > 0:
        block = file.read(min(size_left, _CRC_BLOCK_SIZE))
        if not block:
            raise DamagedError('the file has become shorter', start)
        crc = zlib.crc32(block, crc)
        size_left -= len(block)
    if crc != declared:
        raise DamagedError(f'the CRC of the {name} does not match its content', start)


def _check_written(file: BinaryIO, start: int, end: int, name: str) -> None:
    """Refuse to read a large range that is mostly a hole of a sparse file."""
    if end - start > _MAX_RECORD_SIZE and is_hollow(file, start, end):
        raise DamagedError(f'the {name} of {end - start} bytes was never written', start)


class _Content(ReadDataStream):
    """A record's content; unlike the library's stream it returns all bytes or raises."""

    def __init__(self, content: bytes) -> None:
        # Slicing the bytes instead of reading the stream saves a third of the time.
        super().__init__(io.BytesIO())
        self._content = content
        self._position = 0

    @property
    def count(self) -> int:
        return self._position

    def read(self, length: int) -> bytes:
        begin = self._position
        end = begin + length
        if end > len(self._content):
            raise EndOfFile
        self._position = end
        return self._content[begin:end]


def parse(kind: type[Parsed], content: bytes, offset: int = 0) -> Parsed:
    """Return a record of one of the library's classes; the offset is for the error's message."""
    try:
        # Each class has a `read`, though their base has none.
        parsed: Parsed = cast('Any', kind).read(_Content(content))
    except (McapError, struct.error, ValueError) as error:
        raise DamagedError(f'the {kind.__name__.lower()} cannot be understood', offset) from error
    return parsed


def parse_schema(content: bytes, offset: int = 0) -> Schema:
    """Return a schema; the offset is for the error's message."""
    schema = parse(Schema, content, offset)
    if schema.encoding in _TEXT_ENCODINGS:
        try:
            schema.data.decode()
        except UnicodeDecodeError:
            reason = f"the definition of '{printable(schema.name)}' is no text"
            raise DamagedError(reason, offset) from None
    return schema


def parse_attachment(content: bytes, offset: int = 0) -> Attachment:
    """Return an attachment, its CRC checked if it has one; the offset is for the error."""
    record = parse(AttachmentRecord, content, offset)
    if attachment_crc(content) not in (0, zlib.crc32(content[:-4])):
        reason = f"the CRC of the attachment '{printable(record.name)}' is wrong"
        raise DamagedError(reason, offset)
    return Attachment(
        record.name, record.media_type, record.data, record.log_time, record.create_time
    )


def attachment_crc(content: bytes) -> int:
    """Return the recorded CRC of an attachment; 0 for none."""
    return int.from_bytes(content[-4:], 'little')


def encoded(record: McapRecord) -> bytes:
    """Return a record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call] # theirs


def encoded_chunk(
    start: int,
    data: bytes | bytearray | memoryview,
    compression: tuple[str, bytes],
    times: tuple[int, int],
    entries: Mapping[int, bytes],
) -> tuple[bytes, bytes, ChunkIndex]:
    """
    Return a chunk at an offset [bytes], its message indexes, and its entry in the summary.

    The compression is a name with the compressed data, the times are the first and the last log
    time [ns]. The entries are by channel: log time and offset of each message in turn, as 8 bytes.
    """
    name, packed = compression
    first, last = times
    fields = _CHUNK_HEAD.pack(first, last, len(data), zlib.crc32(data), len(name)) + name.encode()
    # Joined once: the library's encoder copies the bytes three times.
    fields += len(packed).to_bytes(8, 'little')
    chunk = b''.join([RECORD_HEAD.pack(Opcode.CHUNK, len(fields) + len(packed)), fields, packed])
    indexes = bytearray()
    offsets = {}
    for channel, channel_entries in entries.items():
        offsets[channel] = start + len(chunk) + len(indexes)
        indexes += RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, INDEX_HEAD.size + len(channel_entries))
        indexes += INDEX_HEAD.pack(channel, len(channel_entries)) + channel_entries
    index = ChunkIndex(
        chunk_start_offset=start,
        chunk_length=len(chunk),
        compression=name,
        compressed_size=len(packed),
        message_start_time=first,
        message_end_time=last,
        message_index_offsets=offsets,
        message_index_length=len(indexes),
        uncompressed_size=len(data),
    )
    return chunk, bytes(indexes), index


class Records(Protocol):
    """Encoded records of one kind; the bytes may hold several at once."""

    def __len__(self) -> int:
        """Return the number of records."""

    def __iter__(self) -> Iterator[bytes]:
        """Yield the bytes."""


def encoded_end(
    start: int, groups: Mapping[int, Records], counts: Mapping[int, int], times: tuple[int, int]
) -> bytes:
    """
    Return the end of a file from the summary on, which starts at an offset [bytes].

    The groups are the other records of the summary by opcode, the counts those of messages by
    channel, and the times the first and the last log time [ns].
    """
    statistics = Statistics(
        attachment_count=len(groups[Opcode.ATTACHMENT_INDEX]),
        channel_count=len(groups[Opcode.CHANNEL]),
        channel_message_counts=dict(counts),
        chunk_count=len(groups[Opcode.CHUNK_INDEX]),
        message_count=sum(counts.values()),
        message_start_time=times[0],
        message_end_time=times[1],
        metadata_count=len(groups[Opcode.METADATA_INDEX]),
        schema_count=len(groups[Opcode.SCHEMA]),
    )
    summary = b''
    offsets = b''
    for opcode, records in {**groups, Opcode.STATISTICS: [encoded(statistics)]}.items():
        if records:
            group = b''.join(records)
            offsets += encoded(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
    footer = encoded(FooterRecord(start, start + len(summary), 0))
    end = summary + offsets + footer[:-4]
    return end + zlib.crc32(end).to_bytes(4, 'little') + MAGIC
