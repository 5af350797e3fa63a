"""
The records of an MCAP file, read without believing a length before it was compared with the file.

A file is a magic, records of an opcode (1 byte), a length (8 bytes) and a content, and the magic.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import TYPE_CHECKING
import zlib

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from .layout import lengths_agree

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

MAGIC = MCAP0_MAGIC
"""The first and the last 8 bytes of a file."""

MESSAGE_HEAD = 22
"""What a message record is at least [bytes]."""

_HEAD = struct.Struct('<BQ')
_FOOTER = struct.Struct('<BQQQI')
_PIECE = 1024 * 1024

# Schemas, channels, metadata and what the summary holds are small; a longer one is a wrong length.
_MAX_SMALL = 64 * 1024 * 1024
_CREDIBLE = 2**40
_KINDS = range(Opcode.HEADER, Opcode.DATA_END + 1)
_LARGE = {Opcode.ATTACHMENT, Opcode.CHUNK, Opcode.MESSAGE}


@dataclass(frozen=True, slots=True)
class Span:
    """Where a record stands: opcode, offset of the record, length of its content [bytes]."""

    opcode: int
    offset: int
    length: int

    @property
    def start(self) -> int:
        """Return where the content starts."""
        return self.offset + _HEAD.size

    @property
    def end(self) -> int:
        """Return where the next record starts."""
        return self.offset + _HEAD.size + self.length


@dataclass(frozen=True, slots=True)
class Footer:
    """
    What the footer of a closed file says.

    Its own offset, where the summary starts, and the CRC of both; 0 for none.
    """

    offset: int
    summary_start: int
    crc: int


def spans(file: BinaryIO, start: int, end: int) -> Iterator[Span]:
    """
    Yield the records between two offsets, without reading their contents.

    Raises
    ------
    DamagedError
        A record is cut off, or what stands there is no record.

    """
    offset = start
    while offset != end:
        span = span_at(file, offset, end)
        yield span
        offset = span.end


def span_at(file: BinaryIO, offset: int, end: int) -> Span:
    """
    Return the record at an offset, which ends at ``end`` at the latest.

    Raises
    ------
    DamagedError
        As :func:`spans`.

    """
    if offset > end:
        # An index may say anything, also what no file can be asked for.
        raise DamagedError('it would be behind the end of the file', offset)
    file.seek(offset)
    head = file.read(_HEAD.size)
    left = end - offset - _HEAD.size
    if not any(head[:1]):
        raise DamagedError('what stands there is no record', offset)
    if left < 0 or len(head) < _HEAD.size:
        raise DamagedError('a record is cut off within its first 9 bytes', offset, head[0])
    opcode, length = _HEAD.unpack(head)
    if length > left:
        reason = f'the {name_of(opcode)} should be {length} bytes long, {left} are left'
        raise DamagedError(reason, offset, opcode)
    if length > _MAX_SMALL and opcode not in _LARGE:
        reason = f'a {name_of(opcode)} of {length} bytes cannot be'
        raise DamagedError(reason, offset, opcode)
    return Span(opcode, offset, length)


def starts(file: BinaryIO, offset: int, end: int) -> bool:
    """Return whether a record whose lengths agree, or the end, is at an offset."""
    if offset == end:
        return True
    try:
        span = span_at(file, offset, end)
    except DamagedError:
        return False
    if span.opcode == Opcode.MESSAGE:
        return span.length >= MESSAGE_HEAD
    return lengths_agree(file, span)


def is_kind(file: BinaryIO, offset: int) -> bool:
    """Return whether the byte at an offset is the opcode of a record."""
    file.seek(offset)
    head = file.read(1)
    return len(head) == 1 and head[0] in _KINDS


def may_start(file: BinaryIO, offset: int, end: int) -> bool:
    """
    Return whether an offset is where a record was, or was to be.

    As :func:`starts`, or a record that is cut off, or the zeros that a power cut leaves.
    """
    if offset >= end:
        return offset == end
    file.seek(offset)
    head = file.read(min(_HEAD.size, end - offset))
    if not any(head):
        return True
    short = len(head) < _HEAD.size
    return head[0] in _KINDS and (short or _HEAD.unpack(head)[1] < _CREDIBLE)


def read(file: BinaryIO, span: Span) -> bytes:
    """
    Return a record's content.

    Raises
    ------
    DamagedError
        The file has become shorter, or a chunk's own lengths contradict the record's.

    """
    if span.opcode == Opcode.CHUNK and not lengths_agree(file, span):
        reason = 'the lengths in the chunk contradict each other'
        raise DamagedError(reason, span.offset, span.opcode)
    file.seek(span.start)
    content = file.read(span.length)
    if len(content) < span.length:
        raise DamagedError('the file has become shorter', span.offset, span.opcode)
    return content


def find_footer(file: BinaryIO, size: int) -> Footer | None:
    """Return the footer of a file of this size [bytes], or None if it was not closed."""
    offset = size - len(MAGIC) - _FOOTER.size
    if offset < len(MAGIC):
        return None
    file.seek(offset)
    tail = file.read(_FOOTER.size + len(MAGIC))
    if len(tail) < _FOOTER.size + len(MAGIC) or not tail.endswith(MAGIC):
        return None
    opcode, length, summary_start, _, crc = _FOOTER.unpack_from(tail)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size:
        return None
    return Footer(offset, summary_start, crc)


def check_summary(file: BinaryIO, footer: Footer) -> None:
    """
    Check the CRC of the summary and the footer, where there is one.

    Raises
    ------
    DamagedError
        The CRC is another one, or the summary would start outside of the file.

    """
    if not len(MAGIC) <= footer.summary_start <= footer.offset:
        raise DamagedError('the summary would start outside of the file', footer.offset)
    file.seek(footer.summary_start)
    crc, left = 0, footer.offset + _FOOTER.size - 4 - footer.summary_start
    while left > 0:
        piece = file.read(min(left, _PIECE))
        if not piece:
            raise DamagedError('the file has become shorter', footer.offset)
        crc = zlib.crc32(piece, crc)
        left -= len(piece)
    if footer.crc not in (0, crc):
        reason = f'the CRC of the summary is {crc:08x}, {footer.crc:08x} is recorded'
        raise DamagedError(reason, footer.summary_start)


def name_of(opcode: int) -> str:
    """Return how to call a record in a message to people."""
    try:
        return Opcode(opcode).name.lower().replace('_', ' ')
    except ValueError:
        return f'record of unknown kind {opcode}'
