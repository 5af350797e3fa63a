"""What in a file cannot be used: which messages and times that concerns, and what is no loss."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
import struct
from typing import BinaryIO

from klann_ros.log.bag_metadata import RECORD_NAME
from klann_ros.sanitize.text import counted
from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from .container import MAGIC

Hole = tuple[int, int]

_MAX_LOSSES = 1000
# Of a chunk: what it is, how long it is, and its messages' first and last log time.
_HEAD = struct.Struct('<BQQQ')
# Of what may be cut off.
_INDEX_HEAD = 6
_CUT_INDEX = struct.Struct('<QHI')
_CUT_HEAD = 8 + 4 + len(RECORD_NAME)
_DATA_END_LENGTH = 4


@dataclass
class Loss:
    """Something in a file that cannot be used."""

    # Where it is [bytes].
    offset: int
    length: int
    # What is wrong with it, in one line.
    reason: str
    # How many messages it held; None if nothing says so.
    messages: int | None = None
    # Whether there may not have been more.
    exact: bool = True

    def __str__(self) -> str:
        """Return it in one line, without the place."""
        least = '' if self.exact else 'at least '
        held = f' with {least}{counted(self.messages, "message")}' if self.messages else ''
        return f'{counted(self.length, "byte")}{held}: {self.reason}'


class Losses:
    """The losses in a file by their offset; from the thousandth on they are one."""

    def __init__(self) -> None:
        self._losses: list[Loss] = []

    def __iter__(self) -> Iterator[Loss]:
        return iter(self._losses)

    def __len__(self) -> int:
        return len(self._losses)

    def add(self, offset: int, length: int, reason: str, *, exact: bool = True) -> Loss:
        """Note a loss; the return value is to be told how many messages it held."""
        if len(self._losses) < _MAX_LOSSES:
            self._losses.append(Loss(offset, length, reason, exact=exact))
        else:
            last = self._losses[-1]
            last.length += length
            last.reason = 'this and all other damage behind it'
            last.exact = False
        return self._losses[-1]


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
            yield from _times_in_chunk_head(file, loss.offset)


def _times_in_chunk_head(file: BinaryIO, offset: int) -> Iterator[Hole]:
    file.seek(offset)
    head = file.read(_HEAD.size)
    if len(head) == _HEAD.size:
        opcode, _, begin, end = _HEAD.unpack(head)
        if opcode == Opcode.CHUNK and begin <= end:
            yield begin, end


def is_made_anew(file: BinaryIO, offset: int, opcode: int, left: int) -> bool:
    """Tell whether what is cut off at an offset is what a recovery makes anew anyway."""
    file.seek(offset + 1)
    head = file.read(_CUT_HEAD)
    if opcode == Opcode.MESSAGE_INDEX:
        if len(head) < _CUT_INDEX.size:
            return True
        length, _, size = _CUT_INDEX.unpack_from(head)
        return bool(length >= size + _INDEX_HEAD > left - 9)
    if opcode == Opcode.METADATA:
        return head[8:] == struct.pack('<I', len(RECORD_NAME)) + RECORD_NAME.encode()
    return opcode == Opcode.DATA_END and left < len(MAGIC) + 1 + _DATA_END_LENGTH
