"""
What a chunk, or messages outside of chunks, hold: found once, read out as it is needed.

Work spent on undecodable bytes is bounded: see
:class:`~klann_ros.log.mcap.decompression.DecompressionBudget`.
"""

from array import array
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
import struct
import sys
from typing import BinaryIO, TypeAlias

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode
from mcap.records import Chunk
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .decompression import decompress, DecompressionBudget, DecompressionError
from .layout import is_known, RECORD_HEAD, without_more
from .parsing import parse

Row: TypeAlias = tuple[int, int, int, int, bytes]

_MESSAGE = struct.Struct('<HIQQ')
_WHOLE = struct.Struct('<QHIQQ')
# Where in a message record its log time stands [bytes].
_LOG_TIME_AT = RECORD_HEAD.size + 6
_DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)

# What stands one behind the other outside of chunks is read so much at once [bytes].
_FIRST, _LAST = 4096, 1024 * 1024
# An unknown record there that is longer could be one whose opcode is damaged.
_MAX_UNKNOWN = 32
# So many of the last ones are left.
_LEFT = 3

# What a record costs that is stepped over, one that describes something, and what each message
# pays for those around it [bytes that could be unpacked in that time].
_RECORD_COST, _DEFINITION_COST, _MESSAGE_PAYS = 256, 1024, 4096


@dataclass(frozen=True, slots=True)
class Content:
    """
    The records in some bytes, as far as they are whole.

    Only places are kept, 8 bytes a message: a chunk may hold a million of them.
    """

    # The unpacked bytes.
    data: memoryview
    # Where each message record starts [bytes].
    starts: 'array[int]'
    # Where each schema and each channel record starts [bytes].
    definition_starts: 'array[int]'
    # Whether there was a CRC that held.
    verified: bool
    # Why not all of the bytes could be read; '' if all could.
    broken: str = ''
    # How much was looked at that is of no message.
    wasted: int = 0
    # How many records are of kinds that are private or of a later version.
    unknown: int = 0

    def __len__(self) -> int:
        """Return how many messages there are."""
        return len(self.starts)

    def times(self) -> 'array[int]':
        """Return the log time of each message [ns]."""
        times = array('Q')
        if self.starts:
            windows = sliding_window_view(np.frombuffer(self.data, np.uint8), 8)
            found = windows[np.frombuffer(self.starts, np.uint64) + _LOG_TIME_AT].view('<u8')
            times.frombytes(found.astype(np.uint64).tobytes())
        return times

    def rows(self, *, by_time: bool = False) -> Iterator[Row]:
        """Yield of each message: channel, sequence, log time, publish time [ns] and its bytes."""
        data = self.data
        for position in self._by_time() if by_time else self.starts:
            length, channel, sequence, logged, published = _WHOLE.unpack_from(data, position + 1)
            start = position + RECORD_HEAD.size + _MESSAGE.size
            end = position + RECORD_HEAD.size + length
            yield channel, sequence, logged, published, data[start:end].tobytes()

    def definitions(self) -> Iterator[tuple[int, bytes]]:
        """Yield of each schema and channel: opcode and content, without unknown fields."""
        for position in self.definition_starts:
            opcode, length = RECORD_HEAD.unpack_from(self.data, position)
            start = position + RECORD_HEAD.size
            end = start + length
            yield opcode, without_more(opcode, self.data[start:end].tobytes())

    def _by_time(self) -> Iterable[int]:
        times = self.times()
        if all(times[n - 1] <= times[n] for n in range(1, len(times))):
            return self.starts
        return (self.starts[n] for n in sorted(range(len(times)), key=times.__getitem__))


def chunk_content(record: bytes, offset: int, budget: DecompressionBudget) -> Content:
    """Return the content of a chunk record; the offset is for the error's message."""
    chunk = parse(Chunk, record, offset)
    packed = len(chunk.data)
    try:
        data = decompress(
            chunk.data, chunk.compression, chunk.uncompressed_size, chunk.uncompressed_crc, budget
        )
    except DecompressionError as error:
        raise DamagedError(str(error), offset, Opcode.CHUNK) from None
    verified = chunk.uncompressed_crc != 0
    content = content_of(data, verified=verified, allowed=budget.allowed(packed))
    budget.charge(content.wasted, packed)
    return content


def content_of(data: bytes | bytearray, *, verified: bool, allowed: int = sys.maxsize) -> Content:
    """
    Find the records in a chunk's data, up to the first that cannot be.

    Parameters
    ----------
    data, verified
        The unpacked bytes, and whether there was a CRC that held.
    allowed
        How much of them may be of no message, as the budget counts them.

    """
    starts, definitions = array('Q'), array('Q')
    position, size, broken, others, unknown = 0, len(data), '', 0, 0
    while position < size:
        position = _behind_messages(data, position, starts)
        if position == size:
            break
        start = position + RECORD_HEAD.size
        if start > size:
            broken = 'its last record is cut off'
            break
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        end = start + length
        if end > size:
            broken = 'a record in it is longer than the chunk'
            break
        if opcode == Opcode.MESSAGE:
            broken = 'a message in it is too short'
            break
        if not opcode:
            broken = 'what stands in it is no record'
            break
        others += length + (_DEFINITION_COST if opcode in _DEFINITIONS else _RECORD_COST)
        if others > allowed + _MESSAGE_PAYS * len(starts):
            broken = 'there are more records in it that are no messages than a file may have'
            break
        if opcode in _DEFINITIONS:
            definitions.append(position)
        else:
            unknown += 1
        position = end
    wasted = max(0, others - _MESSAGE_PAYS * len(starts)) + size - position
    return Content(memoryview(data), starts, definitions, verified, broken, wasted, unknown)


def _behind_messages(data: bytes | bytearray, position: int, starts: 'array[int]') -> int:
    """Append where the messages start that follow each other; return where the last one ends."""
    # Of nearly all records of a log: what is done here for each is what reading it costs.
    unpack, found = RECORD_HEAD.unpack_from, starts.append
    size, head, least, message = len(data), RECORD_HEAD.size, _MESSAGE.size, int(Opcode.MESSAGE)
    with suppress(struct.error):
        while True:
            kind, length = unpack(data, position)
            end = position + head + length
            if kind != message or length < least or end > size:
                break
            found(position)
            position = end
    return position


def message_content(content: bytes, offset: int) -> Content:
    """Return what a message record holds that stands outside of chunks."""
    if len(content) < _MESSAGE.size:
        raise DamagedError('the message is too short', offset, Opcode.MESSAGE)
    return content_of(RECORD_HEAD.pack(Opcode.MESSAGE, len(content)) + content, verified=False)


class Stretches:
    """
    Reads messages outside of chunks from an open file, as much at once as was of use before.

    What stands one behind the other in a file without chunks are messages, hundreds of thousands
    of them, and now and then a small record of a kind that nobody knows. As long as it is nothing
    else, each is believed since sound ones follow it, and to look at each by itself takes twenty
    times as long. The last of them are left to whoever does.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = _FIRST

    def at(self, offset: int, until: int) -> tuple[Content, int] | None:
        """
        Return the messages that stand between two offsets, and where they end [bytes].

        None if these are too few.
        """
        self._file.seek(offset)
        data = self._file.read(max(0, min(self._size, until - offset)))
        found = _records(data)
        taken = found[: max(0, len(found) - _LEFT)]
        position = found[len(taken)] if taken else 0
        of_use = 2 * position > len(data)
        self._size = min(4 * self._size, _LAST) if of_use else _FIRST
        if not taken:
            return None
        starts = array('Q', (start for start in taken if data[start] == Opcode.MESSAGE))
        content = Content(
            memoryview(data),
            starts,
            array('Q'),
            verified=False,
            unknown=len(taken) - len(starts),
        )
        return content, offset + position


def _records(data: bytes) -> list[int]:
    """Return where the messages and the small unknown records start that are whole in the data."""
    found = []
    position, last = 0, len(data) - RECORD_HEAD.size
    while position <= last:
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        end = position + RECORD_HEAD.size + length
        if end > len(data):
            break
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                break
        elif not opcode or is_known(opcode) or length > _MAX_UNKNOWN:
            break
        found.append(position)
        position = end
    return found
