"""
The layout of each kind of record: which lengths in it must add up to its own.

Most records have no checksum. That their inner lengths agree with the one in their head is what
tells a record from bytes of chance, and a right length from a wrong one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.opcode import Opcode

if TYPE_CHECKING:
    from typing import BinaryIO

    from .container import Span

# Numbers of 1 (B), 2 (H), 4 (I) and 8 (Q) bytes; what has its length before it, in 4 bytes (s: a
# text, a map, a list) or in 8 (L). Messages are the only records without any length inside.
_LAYOUTS = {
    Opcode.HEADER: 'ss',
    Opcode.FOOTER: 'QQI',
    Opcode.SCHEMA: 'Hsss',
    Opcode.CHANNEL: 'HHsss',
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
_SIZES = {'B': 1, 'H': 2, 'I': 4, 'Q': 8}
_PREFIXES = {'s': 4, 'L': 8}


def lengths_agree(file: BinaryIO, span: Span) -> bool:
    """Return whether the lengths within a record add up to its length; False for a message."""
    layout = _LAYOUTS.get(Opcode(span.opcode)) if span.opcode in _KNOWN else None
    if layout is None:
        return False
    position = span.start
    for field in layout:
        if field in _SIZES:
            position += _SIZES[field]
            continue
        prefix = _PREFIXES[field]
        if position + prefix > span.end:
            return False
        file.seek(position)
        position += prefix + int.from_bytes(file.read(prefix), 'little')
    return position == span.end


_KNOWN = frozenset(int(opcode) for opcode in Opcode)
