"""
The layout of each kind of record: where in it the fields end that the specification names.

A record may be longer: later versions may add fields, and readers ignore what they do not know.
It may not be shorter. Most records have no checksum, so that the lengths within one fit into its
own, best of all exactly, is what tells it from bytes of chance.
"""

from collections.abc import Callable
from dataclasses import dataclass
import struct
from typing import BinaryIO

from mcap.opcode import Opcode

RECORD_HEAD = struct.Struct('<BQ')
"""What every record begins with: opcode, and length of the content."""

# Numbers of 1 (B), 2 (H), 4 (I) and 8 (Q) bytes; what has its length before it, in 4 bytes (s: a
# text, a map, a list) or in 8 (L).
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
# These will never have more fields, says the specification.
_FINAL = (Opcode.DATA_END, Opcode.FOOTER)
_SIZES = {'B': 1, 'H': 2, 'I': 4, 'Q': 8}
_PREFIXES = {'s': 4, 'L': 8}
_LEAST = {
    opcode: sum((_SIZES | _PREFIXES)[field] for field in layout)
    for opcode, layout in _LAYOUTS.items()
}


@dataclass(frozen=True, slots=True)
class RecordSpan:
    """Where a record stands: opcode, offset of the record, length of its content [bytes]."""

    opcode: int
    offset: int
    length: int

    @property
    def start(self) -> int:
        """Return where the content starts."""
        return self.offset + RECORD_HEAD.size

    @property
    def end(self) -> int:
        """Return where the next record starts."""
        return self.offset + RECORD_HEAD.size + self.length


def least(opcode: int) -> int:
    """Return how long the content of a record of this kind is at least [bytes]."""
    return _LEAST[opcode]


def is_known(opcode: int) -> bool:
    """Return whether the specification names this kind; others are private, or of the future."""
    return opcode in _LAYOUTS


def fields_end(file: BinaryIO, span: RecordSpan) -> int | None:
    """
    Return where the fields of a record in a file end [bytes]: at its end, or before it.

    None if they do not fit into the record. A message's data go on to its end, and of a kind that
    is not known there are no fields to look at.
    """
    end, _ = _fields(span.opcode, _numbers_in(file), span.start, span.end)
    return end


def holds_nothing(file: BinaryIO, span: RecordSpan) -> bool:
    """Return whether the data of a chunk or an attachment, or all of a metadata record, are ''."""
    end, held = _fields(span.opcode, _numbers_in(file), span.start, span.end)
    all_of_it = end is not None and end - span.start == least(span.opcode)
    return held == 0 and (all_of_it or span.opcode != Opcode.METADATA)


def without_more(opcode: int, content: bytes) -> bytes:
    """Return a record's content up to the end of its fields; all of it if they do not fit."""

    def number(position: int, size: int) -> int:
        end = position + size
        return int.from_bytes(content[position:end], 'little')

    end, _ = _fields(opcode, number, 0, len(content))
    return content if end is None else content[:end]


def _numbers_in(file: BinaryIO) -> Callable[[int, int], int]:
    def number(position: int, size: int) -> int:
        file.seek(position)
        return int.from_bytes(file.read(size), 'little')

    return number


def _fields(
    opcode: int, number: Callable[[int, int], int], start: int, end: int
) -> tuple[int | None, int]:
    """Return where the fields end, None if they do not fit, and how long the last one is."""
    position, length = start, 0
    for field in _LAYOUTS.get(opcode, ''):
        if field in _SIZES:
            position += _SIZES[field]
            continue
        prefix = _PREFIXES[field]
        if position + prefix > end:
            return None, 0
        length = number(position, prefix)
        position += prefix + length
    if position > end or (opcode in _FINAL and position < end):
        return None, 0
    return end if opcode == Opcode.MESSAGE else position, length
