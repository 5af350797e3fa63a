"""From when to when a damaged log misses messages, as far as something of it tells."""

from __future__ import annotations

from bisect import bisect_left
import struct
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import BinaryIO

    from mcap.records import ChunkIndex

    from .damage import Loss

    Hole = tuple[int, int]

# Of a chunk: what it is, how long it is, and its messages' first and last log time.
_HEAD = struct.Struct('<BQQQ')


def holes(file: BinaryIO, losses: Iterable[Loss], chunks: Iterable[ChunkIndex]) -> Iterator[Hole]:
    """
    Yield the first and last log times of the chunks that were stepped over [ns].

    Parameters
    ----------
    file
        The open log.
    losses
        What was stepped over.
    chunks
        What the summary says about chunks; nothing if it has no say.

    """
    indexed = sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)
    offsets = [chunk.chunk_start_offset for chunk in indexed]
    for loss in losses:
        first = bisect_left(offsets, loss.offset)
        last = bisect_left(offsets, loss.offset + loss.length)
        for chunk in indexed[first:last]:
            yield chunk.message_start_time, chunk.message_end_time
        if first == last:
            # The index has a CRC of its own; without it the damaged chunk has to be believed.
            yield from _told(file, loss.offset)


def _told(file: BinaryIO, offset: int) -> Iterator[Hole]:
    file.seek(offset)
    head = file.read(_HEAD.size)
    if len(head) == _HEAD.size:
        opcode, _, begin, end = _HEAD.unpack(head)
        if opcode == Opcode.CHUNK and begin <= end:
            yield begin, end
