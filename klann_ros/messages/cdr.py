"""
CDR (Common Data Representation), the encoding of ROS 2 messages: read and written by position.

A message begins with four bytes, the second of which is the byte order. All else is aligned from
there on: a number begins at a multiple of its size, strings and sequences begin with their length.
Bytes behind the end of a message are ignored, as by rclpy: `serialize_message()` leaves some.
"""

from collections.abc import Sequence
import struct
from typing import Any

# Sizes of the encapsulation header, behind which most messages have their stamp [bytes].
HEADER_SIZE = 4
STAMP_SIZE = 8
# The last time of a stamp, whose seconds are an int32 [ns]: in 2038.
MAX_STAMP = 2**31 * 10**9 - 1
# Byte orders of plain CDR; topics use no other encoding (parameter lists, XCDR2).
ORDERS = {b'\0\1': '<', b'\0\0': '>'}


class CdrCursor:
    """
    A position in a message with its encapsulation header, which each read advances.

    A ValueError refuses a message that is not CDR, or ends too early.
    """

    def __init__(self, data: bytes) -> None:
        if data[:2] not in ORDERS:
            raise ValueError(f'{data[:2]!r} is not how a message begins')
        # The byte order in struct's notation, and the position [bytes].
        self.order = ORDERS[data[:2]]
        self.position = HEADER_SIZE
        # The ranges of lengths and texts, which define the message's layout [bytes].
        self.structure: list[slice] = []
        self._data = data
        self.skip(0)

    def skip(self, size: int) -> int:
        """Skip `size` bytes; return the offset of the first."""
        begin = self.position
        self.position += size
        if self.position > len(self._data):
            raise ValueError('the message ends too early')
        return begin

    def length(self) -> int:
        """Read the length of a sequence or a string."""
        self._align(4)
        (length,) = struct.unpack_from(f'{self.order}I', self._data, self._skip_structure(4))
        return int(length)

    def string(self) -> bytes:
        """Read a string; it ends at its first zero."""
        begin = self._skip_structure(self.length())
        return self._data[slice(begin, self.position)].partition(b'\0')[0]

    def skip_numbers(self, code: str, count: int) -> int:
        """Skip numbers of one type, in struct's notation; return the offset of the first."""
        size = struct.calcsize(code)
        if count:
            self._align(size)
        return self.skip(count * size)

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Read numbers of one type, in struct's notation."""
        begin = self.skip_numbers(code, count)
        return struct.unpack_from(f'{self.order}{count}{code}', self._data, begin)

    def _align(self, size: int) -> None:
        self.position += -(self.position - HEADER_SIZE) % size

    def _skip_structure(self, size: int) -> int:
        begin = self.skip(size)
        self.structure.append(slice(begin, self.position))
        return begin


class CdrWriter:
    """A message that grows; little-endian, as on every machine that ROS 2 supports."""

    def __init__(self) -> None:
        self.data = bytearray(b'\0\1\0\0')

    def string(self, text: str) -> None:
        """Append a string."""
        encoded = text.encode() + b'\0'
        self.numbers('I', [len(encoded)])
        self.data += encoded

    def numbers(self, code: str, numbers: Sequence[float]) -> None:
        """Append numbers of one type, in struct's notation."""
        if numbers:
            self.data += bytes(-(len(self.data) - HEADER_SIZE) % struct.calcsize(code))
            self.data += struct.pack(f'<{len(numbers)}{code}', *numbers)
