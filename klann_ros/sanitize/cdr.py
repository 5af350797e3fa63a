"""Sequential reading of CDR (Common Data Representation), the encoding of ROS 2 messages."""

import struct

HEADER_SIZE, STAMP_SIZE = 4, 8
# Byte orders of plain CDR; topics use no other encoding (parameter lists, XCDR2).
ORDERS = {b'\0\1': '<', b'\0\0': '>'}


class CdrCursor:
    """
    A position in a message, which each read advances.

    Every read raises a ValueError if the message ends too early.

    Parameters
    ----------
    data : bytes
        The message, with its encapsulation header.
    at : int
        The start [bytes].

    Attributes
    ----------
    order : str
        The byte order, in struct's notation.
    at : int
        The position [bytes].
    structure : list of slice
        The ranges of lengths and texts, which define the message's layout [bytes].

    Raises
    ------
    ValueError
        The message is not CDR.

    """

    def __init__(self, data: bytes, at: int = HEADER_SIZE) -> None:
        if data[:2] not in ORDERS:
            raise ValueError(f'{data[:2]!r} is not how a message begins')
        self.order = ORDERS[data[:2]]
        self.at = at
        self.structure: list[slice] = []
        self._data = data
        self.skip(0)

    def skip(self, size: int) -> int:
        """Skip `size` bytes; return the offset of the first."""
        begin, self.at = self.at, self.at + size
        if self.at > len(self._data):
            raise ValueError('the message ends too early')
        return begin

    def align(self, size: int) -> None:
        """Advance to the alignment of a value of `size` bytes."""
        self.at += -(self.at - HEADER_SIZE) % size

    def length(self) -> int:
        """Read the length of a sequence or a string."""
        self.align(4)
        begin = self._structural(4)
        (length,) = struct.unpack_from(f'{self.order}I', self._data, begin)
        return int(length)

    def string(self) -> bytes:
        """Read a string; it ends at its first zero."""
        begin = self._structural(self.length())
        return self._data[slice(begin, self.at)].partition(b'\0')[0]

    def strings(self) -> list[bytes]:
        """Read a sequence of strings."""
        return [self.string() for _ in range(self.length())]

    def doubles(self) -> tuple[int, int]:
        """Skip a sequence of doubles; return its offset [bytes] and its length."""
        count = self.length()
        if count:
            self.align(8)
        return self.skip(8 * count), count

    def _structural(self, size: int) -> int:
        begin = self.skip(size)
        self.structure.append(slice(begin, self.at))
        return begin


def read_joint_state(cursor: CdrCursor) -> tuple[list[bytes], list[tuple[int, int]]]:
    """Read a sensor_msgs/JointState: its names, and the `doubles` of its three sequences."""
    cursor.skip(STAMP_SIZE)
    cursor.string()
    return cursor.strings(), [cursor.doubles() for _ in range(3)]
