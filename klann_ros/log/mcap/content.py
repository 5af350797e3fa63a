"""
The records inside a chunk, or of messages outside of chunks: located once, read when needed.

Work spent on undecodable bytes is bounded: see
:class:`~klann_ros.log.mcap.decompression.DecompressionBudget`.
"""

from array import array
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
import struct
import sys

from klann_ros.log.errors import DamagedError
from klann_ros.log.read.storage import HEAD, MessageBlock
from klann_ros.log.records import Topic
from mcap.opcode import Opcode
from mcap.records import Chunk
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .decompression import decompress, DecompressionBudget, DecompressionError
from .records import DEFINITIONS, min_size, parse, RECORD_HEAD, without_unknown_fields

# Size of the fields before a message's data [bytes].
_MESSAGE_SIZE = min_size(Opcode.MESSAGE)

# Messages behind a row of them that make it sound.
_FOLLOWING = 3

# Cost of a record that is skipped, and of a definition, and credit for each message beside them
# [bytes that could be unpacked in that time].
_RECORD_COST, _DEFINITION_COST, _MESSAGE_CREDIT = 256, 1024, 4096


@dataclass(frozen=True, slots=True)
class Content:
    """The intact records in some bytes, as offsets: 8 bytes a message."""

    # The unpacked bytes.
    data: memoryview
    # Offsets of the message records, and of the schema and channel records [bytes].
    starts: 'array[int]'
    definition_starts: 'array[int]'
    # Whether a CRC matched.
    verified: bool
    # Why the remaining bytes could not be read; '' if all could.
    broken: str = ''
    # Cost of the bytes that are no messages, as the budget counts them.
    wasted: int = 0
    # Number of records of unknown kinds.
    unknown: int = 0

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.starts)

    def definitions(self) -> Iterator[tuple[int, bytes]]:
        """Yield opcode and content of each schema and channel, without unknown fields."""
        for position in self.definition_starts:
            opcode, length = RECORD_HEAD.unpack_from(self.data, position)
            start = position + RECORD_HEAD.size
            end = start + length
            yield opcode, without_unknown_fields(opcode, self.data[start:end].tobytes())

    def block(self, topics: Mapping[int, Topic]) -> MessageBlock:
        """Return the messages as arrays, with the topics of known channels."""
        if not len(self):
            no_starts = np.empty(0, dtype=np.int64)
            return MessageBlock(self.data, np.empty(0, HEAD), no_starts, topics)
        starts = np.frombuffer(self.starts, dtype=np.uint64).astype(np.int64)
        windows = sliding_window_view(np.frombuffer(self.data, np.uint8), HEAD.itemsize)
        heads = windows[starts].view(HEAD)[:, 0]
        return MessageBlock(self.data, heads, starts + HEAD.itemsize, topics)


def chunk_content(record: bytes, offset: int, budget: DecompressionBudget) -> Content:
    """Return the content of a chunk record; the offset is for the error's message."""
    chunk = parse(Chunk, record, offset)
    packed_size = len(chunk.data)
    try:
        data = decompress(
            chunk.data, chunk.compression, chunk.uncompressed_size, chunk.uncompressed_crc, budget
        )
    except DecompressionError as error:
        refused = error.is_refusal
        raise DamagedError(str(error), offset, Opcode.CHUNK, is_refusal=refused) from None
    verified = chunk.uncompressed_crc != 0
    content = content_of(data, verified=verified, allowed=budget.allowed(packed_size))
    budget.charge(content.wasted, packed_size)
    return content


def content_of(data: bytes | bytearray, *, verified: bool, allowed: int = sys.maxsize) -> Content:
    """
    Locate the records in a chunk's unpacked data, up to the first malformed one.

    `verified` says whether a CRC matched. `allowed` is the maximum cost of the other records, less
    the credit of the messages [bytes that could be unpacked in that time].
    """
    starts = array('Q')
    definitions = array('Q')
    size = len(data)
    position = 0
    cost = 0
    unknown = 0
    broken = ''
    while position < size:
        position = _append_messages(data, position, starts)
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
            # `_append_messages` left it, although it ends within the chunk.
            broken = 'a message in it is too short'
            break
        if not opcode:
            broken = 'what stands in it is no record'
            break
        cost += length + (_DEFINITION_COST if opcode in DEFINITIONS else _RECORD_COST)
        if cost > allowed + _MESSAGE_CREDIT * len(starts):
            broken = 'there are more records in it that are no messages than a file may have'
            break
        if opcode in DEFINITIONS:
            definitions.append(position)
        else:
            unknown += 1
        position = end
    wasted = max(0, cost - _MESSAGE_CREDIT * len(starts)) + size - position
    return Content(memoryview(data), starts, definitions, verified, broken, wasted, unknown)


def _append_messages(data: bytes | bytearray, position: int, starts: 'array[int]') -> int:
    """Append the offsets of consecutive messages; return the end of the last one."""
    # The inner loop of reading a log.
    unpack = RECORD_HEAD.unpack_from
    append = starts.append
    data_size = len(data)
    head_size = RECORD_HEAD.size
    min_length = _MESSAGE_SIZE
    message = int(Opcode.MESSAGE)
    with suppress(struct.error):
        while True:
            opcode, length = unpack(data, position)
            end = position + head_size + length
            if opcode != message or length < min_length or end > data_size:
                break
            append(position)
            position = end
    return position


def message_content(content: bytes, offset: int) -> Content:
    """Return the content of a message record outside of chunks."""
    if len(content) < _MESSAGE_SIZE:
        raise DamagedError('the message is too short', offset, Opcode.MESSAGE)
    return content_of(RECORD_HEAD.pack(Opcode.MESSAGE, len(content)) + content, verified=False)


def row_of_messages(data: bytes) -> tuple[Content, int]:
    """
    Return the messages at the start of bytes outside of chunks, and their end [bytes].

    A row of messages is sound because others follow, which are left to the caller; judging each by
    itself takes twenty times as long.
    """
    starts = array('Q')
    _append_messages(data, 0, starts)
    row = starts[: max(0, len(starts) - _FOLLOWING)]
    end = starts[len(row)] if row else 0
    return Content(memoryview(data)[:end], row, array('Q'), verified=False), end
