"""
The records of an MCAP file, read without believing a length before it was compared with the file.

A file is a magic, records of an opcode (1 byte), a length (8 bytes) and a content, and the magic.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import struct
from typing import BinaryIO
import zlib

from klann_ros.log.errors import DamagedError
from klann_ros.sanitize.files import is_hollow
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from .layout import fields_end, is_known, RECORD_HEAD, RecordSpan

MAGIC = MCAP0_MAGIC
"""The first and the last 8 bytes of a file."""

_FOOTER = struct.Struct('<BQQQI')
_PIECE = 1024 * 1024

# Only these are read though they be longer than that.
_LARGE = {Opcode.ATTACHMENT, Opcode.CHUNK, Opcode.MESSAGE}
_MAX_SMALL = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class Footer:
    """
    What the footer of a closed file says.

    Its own offset, where the summary starts, and the CRC of both; 0 for none.
    """

    offset: int
    summary_start: int
    crc: int


def spans(file: BinaryIO, start: int, end: int) -> Iterator[RecordSpan]:
    """Yield the records between two offsets, without reading their contents."""
    offset = start
    while offset != end:
        span = span_at(file, offset, end)
        yield span
        offset = span.end


def span_at(file: BinaryIO, offset: int, end: int) -> RecordSpan:
    """Return the record at an offset, which ends at ``end`` at the latest."""
    if offset > end:
        # An index may say anything, also what no file can be asked for.
        raise DamagedError('it would be behind the end of the file', offset)
    file.seek(offset)
    head = file.read(RECORD_HEAD.size)
    left = end - offset - RECORD_HEAD.size
    if not any(head[:1]):
        raise DamagedError('what stands there is no record', offset)
    if left < 0 or len(head) < RECORD_HEAD.size:
        raise DamagedError('a record is cut off within its first 9 bytes', offset, head[0])
    opcode, length = RECORD_HEAD.unpack(head)
    if length > left:
        reason = f'the {name_of(opcode)} should be {length} bytes long, {left} are left'
        raise DamagedError(reason, offset, opcode)
    return RecordSpan(opcode, offset, length)


def read(file: BinaryIO, span: RecordSpan) -> bytes:
    """Return a record's content, as far as its fields are known."""
    name, end = name_of(span.opcode), fields_end(file, span)
    if end is None:
        raise DamagedError(contradiction(span), span.offset, span.opcode)
    size = end - span.start
    if size > _MAX_SMALL and span.opcode not in _LARGE:
        reason = f'the {name} is {size} bytes long, the limit for one is {_MAX_SMALL}'
        raise DamagedError(reason, span.offset, span.opcode)
    check_written(file, span.start, span.end, name_of(span.opcode))
    file.seek(span.start)
    content = file.read(size)
    if len(content) < size:
        raise DamagedError('the file has become shorter', span.offset, span.opcode)
    return content


def contradiction(span: RecordSpan) -> str:
    """Return how to say that the fields of a record do not fit into it."""
    return f'the lengths in the {name_of(span.opcode)} contradict each other'


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
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD_HEAD.size:
        return None
    return Footer(offset, summary_start, crc)


def check_summary(file: BinaryIO, footer: Footer) -> None:
    """Check the CRC of the summary and the footer, where there is one."""
    if not len(MAGIC) <= footer.summary_start <= footer.offset:
        raise DamagedError('the summary would start outside of the file', footer.offset)
    check_written(file, footer.summary_start, footer.offset, 'summary')
    if footer.crc:
        end = footer.offset + _FOOTER.size - 4
        _check_crc(file, footer.summary_start, end, footer.crc, 'summary')


def check_data(file: BinaryIO, end: RecordSpan) -> bool:
    """Check the CRC of all before the record at the end of the data; return whether it has one."""
    crc = int.from_bytes(read(file, end), 'little')
    if crc:
        check_written(file, 0, end.offset, 'data')
        _check_crc(file, 0, end.offset, crc, 'data')
    return crc != 0


def _check_crc(file: BinaryIO, start: int, end: int, said: int, name: str) -> None:
    file.seek(start)
    crc, left = 0, end - start
    while left > 0:
        piece = file.read(min(left, _PIECE))
        if not piece:
            raise DamagedError('the file has become shorter', start)
        crc = zlib.crc32(piece, crc)
        left -= len(piece)
    if crc != said:
        raise DamagedError(f'the CRC of the {name} is {crc:08x}, {said:08x} is recorded', start)


def check_written(file: BinaryIO, start: int, end: int, name: str) -> None:
    """Let a large stretch be read only if most of it was ever written."""
    if end - start > _MAX_SMALL and is_hollow(file, start, end):
        raise DamagedError(f'the {name} of {end - start} bytes was never written', start)


def name_of(opcode: int) -> str:
    """Return how to call a record in a message to people."""
    if not is_known(opcode):
        return f'record of unknown kind {opcode}'
    return Opcode(opcode).name.lower().replace('_', ' ')
