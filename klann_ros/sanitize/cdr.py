"""Reading the Common Data Representation, in which ROS 2 writes its messages, step by step."""

import struct

HEADER_SIZE, STAMP_SIZE = 4, 8
# The byte orders of plain CDR; all else (parameter lists, its second version) is no topic's.
ORDERS = {b'\0\1': '<', b'\0\0': '>'}


class CdrCursor:
    """
    A place in a message, which moves on with all that is read.

    Parameters
    ----------
    data
        The message, with its encapsulation header.
    at
        Where to begin [bytes].

    Attributes
    ----------
    order
        The byte order, as struct writes it.
    at
        The place [bytes].
    structure
        The stretches that say how the message is built: lengths and texts [bytes].

    Raises
    ------
    ValueError
        By everything that reads: the message ends too early, or is no CDR.

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
        """Pass over so many bytes; return where they begin."""
        begin, self.at = self.at, self.at + size
        if self.at > len(self._data):
            raise ValueError('the message ends too early')
        return begin

    def align(self, size: int) -> None:
        """Go on to where a value of this size can stand."""
        self.at += -(self.at - HEADER_SIZE) % size

    def length(self) -> int:
        """Read how long what follows is."""
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
        """Pass over a sequence of doubles; return where they begin, and how many they are."""
        count = self.length()
        if count:
            self.align(8)
        return self.skip(8 * count), count

    def _structural(self, size: int) -> int:
        begin = self.skip(size)
        self.structure.append(slice(begin, self.at))
        return begin


def read_joint_state(cursor: CdrCursor) -> tuple[list[bytes], list[tuple[int, int]]]:
    """
    Pass over a sensor_msgs/JointState.

    Returns
    -------
    list of bytes
        The names of the joints.
    list of tuple of int
        Of positions, velocities and efforts each where they begin [bytes], and how many they are.

    """
    cursor.skip(STAMP_SIZE)
    cursor.string()
    return cursor.strings(), [cursor.doubles() for _ in range(3)]
