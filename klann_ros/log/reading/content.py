"""What a chunk, or a message outside of chunks, holds: found once, read out as it is needed."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
import struct
import sys
from typing import TYPE_CHECKING

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode

from .layout import without_more
from .patience import DEFINITION, MESSAGE, RECORD

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import TypeAlias

    Row: TypeAlias = tuple[int, int, int, int, bytes]

_HEAD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<HIQQ')
_WHOLE = struct.Struct('<QHIQQ')
_LOG_TIME = struct.Struct('<6xQ')
_DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)


@dataclass(frozen=True, slots=True)
class Content:
    """
    The records in some bytes, as far as they are whole.

    Only places and times are kept, 16 bytes a message: a chunk may hold a million of them.

    Parameters
    ----------
    data
        The unpacked bytes.
    starts, times
        Where each message record starts [bytes], and its log time [ns].
    definition_starts
        Where each schema and each channel record starts [bytes].
    verified
        Whether there was a CRC that held.
    broken
        Why not all of the bytes could be read; '' if all could.
    wasted
        How much was looked at that is of no message (see :mod:`klann_ros.log.reading.patience`).
    unknown
        How many records are of kinds that are private or of a later version.

    """

    data: memoryview
    starts: array[int]
    times: array[int]
    definition_starts: array[int]
    verified: bool
    broken: str = ''
    wasted: int = 0
    unknown: int = 0

    def __len__(self) -> int:
        """Return how many messages there are."""
        return len(self.starts)

    def rows(self, *, by_time: bool = False) -> Iterator[Row]:
        """Yield of each message: channel, sequence, log time, publish time [ns] and its bytes."""
        data = self.data
        for position in self._by_time() if by_time else self.starts:
            length, channel, sequence, logged, published = _WHOLE.unpack_from(data, position + 1)
            start = position + _HEAD.size + _MESSAGE.size
            end = position + _HEAD.size + length
            yield channel, sequence, logged, published, data[start:end].tobytes()

    def definitions(self) -> Iterator[tuple[int, bytes]]:
        """Yield of each schema and channel: opcode and content, without unknown fields."""
        for position in self.definition_starts:
            opcode, length = _HEAD.unpack_from(self.data, position)
            start = position + _HEAD.size
            end = start + length
            yield opcode, without_more(opcode, self.data[start:end].tobytes())

    def _by_time(self) -> Iterable[int]:
        times = self.times
        if all(times[n - 1] <= times[n] for n in range(1, len(times))):
            return self.starts
        return (self.starts[n] for n in sorted(range(len(times)), key=times.__getitem__))


def content_of(data: bytes | bytearray, *, verified: bool, allowed: int = sys.maxsize) -> Content:
    """
    Find the records in a chunk's data, up to the first that cannot be.

    Parameters
    ----------
    data, verified
        The unpacked bytes, and whether there was a CRC that held.
    allowed
        How much of them may be of no message, as :class:`Patience` counts.

    """
    starts, times, definitions = array('Q'), array('Q'), array('Q')
    position, size, broken, others, unknown = 0, len(data), '', 0, 0
    while position < size:
        start = position + _HEAD.size
        if start > size:
            broken = 'its last record is cut off'
            break
        opcode, length = _HEAD.unpack_from(data, position)
        end = start + length
        if end > size:
            broken = 'a record in it is longer than the chunk'
            break
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                broken = 'a message in it is too short'
                break
            starts.append(position)
            times.append(_LOG_TIME.unpack_from(data, start)[0])
        elif not opcode:
            broken = 'what stands in it is no record'
            break
        else:
            others += length + (DEFINITION if opcode in _DEFINITIONS else RECORD)
            if others > allowed + MESSAGE * len(starts):
                broken = 'there are more records in it that are no messages than a file may have'
                break
            if opcode in _DEFINITIONS:
                definitions.append(position)
            else:
                unknown += 1
        position = end
    wasted = max(0, others - MESSAGE * len(starts)) + size - position
    places = starts, times, definitions
    return Content(memoryview(data), *places, verified, broken, wasted, unknown)


def message_content(content: bytes, offset: int) -> Content:
    """
    Return what a message record holds that stands outside of chunks.

    Raises
    ------
    DamagedError
        It is too short.

    """
    if len(content) < _MESSAGE.size:
        raise DamagedError('the message is too short', offset, Opcode.MESSAGE)
    return content_of(_HEAD.pack(Opcode.MESSAGE, len(content)) + content, verified=False)
