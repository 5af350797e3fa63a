"""
CDR (Common Data Representation), the encoding of ROS 2 messages: reader and templates.

`Publisher.publish` takes the result of a template's `fill`, and a subscriber receives the bytes of
the published message. Only the padding between fields differs: a typed publish leaves any bytes
there, a template zeros.
"""

from collections.abc import Sequence
import struct
from typing import Any

HEADER_SIZE, STAMP_SIZE = 4, 8
# Byte orders of plain CDR; topics use no other encoding (parameter lists, XCDR2).
ORDERS = {b'\0\1': '<', b'\0\0': '>'}
# Written little-endian, as on every machine that ROS 2 supports.
CDR_HEADER = b'\0\1\0\0'


class CdrCursor:
    """
    A position in a message with its encapsulation header, which each read advances.

    A ValueError refuses a message that is not CDR, or ends too early.
    """

    def __init__(self, data: bytes) -> None:
        if data[:2] not in ORDERS:
            raise ValueError(f'{data[:2]!r} is not how a message begins')
        # The byte order in struct's notation.
        self.order = ORDERS[data[:2]]
        self.position = HEADER_SIZE  # [bytes]
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

    def align(self, size: int) -> None:
        """Advance to the alignment of a value of `size` bytes."""
        self.position += -(self.position - HEADER_SIZE) % size

    def length(self) -> int:
        """Read the length of a sequence or a string."""
        self.align(4)
        begin = self._structural(4)
        (length,) = struct.unpack_from(f'{self.order}I', self._data, begin)
        return int(length)

    def string(self) -> bytes:
        """Read a string; it ends at its first zero."""
        begin = self._structural(self.length())
        return self._data[slice(begin, self.position)].partition(b'\0')[0]

    def strings(self) -> list[bytes]:
        """Read a sequence of strings."""
        return [self.string() for _ in range(self.length())]

    def doubles(self) -> tuple[int, int]:
        """Skip a sequence of doubles; return its offset [bytes] and its length."""
        count = self.length()
        if count:
            self.align(8)
        return self.skip(8 * count), count

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Read numbers of one type, in struct's notation."""
        size = struct.calcsize(code)
        self.align(size)
        return struct.unpack_from(
            f'{self.order}{count}{code}', self._data, self.skip(count * size)
        )

    def header(self) -> tuple[int, int]:
        """Read a std_msgs/Header; return its stamp: seconds and nanoseconds."""
        self.align(4)
        sec, nanosec = struct.unpack_from(f'{self.order}iI', self._data, self.skip(STAMP_SIZE))
        self.string()
        return sec, nanosec

    def _structural(self, size: int) -> int:
        begin = self.skip(size)
        self.structure.append(slice(begin, self.position))
        return begin


def read_joint_state(cursor: CdrCursor) -> tuple[list[bytes], list[tuple[int, int]]]:
    """Read a sensor_msgs/JointState: its names, and the `doubles` of its three sequences."""
    cursor.header()
    return cursor.strings(), [cursor.doubles() for _ in range(3)]


class JointStateTemplate:
    """A sensor_msgs/JointState of which only stamp, positions and velocities change."""

    def __init__(self, names: Sequence[str], frame_id: str = '') -> None:
        count = len(names)
        head = aligned(append_string(b'', frame_id), 4) + struct.pack('<I', count)
        for name in names:
            head = append_string(head, name)
        self._head = aligned(aligned(head, 4) + struct.pack('<I', count), 8)
        self._middle = struct.pack('<I4x', count)
        layout = f'<4siI{len(self._head)}s{count}d'
        self._positions_layout = struct.Struct(f'{layout}8x')
        self._full_layout = struct.Struct(f'{layout}8s{count}d4x')

    def fill(
        self, sec: int, nanosec: int, positions: Sequence[float], velocities: Sequence[float] = ()
    ) -> bytes:
        """Return the message; there are as many velocities as names, or none."""
        if velocities:
            return self._full_layout.pack(
                CDR_HEADER, sec, nanosec, self._head, *positions, self._middle, *velocities
            )
        return self._positions_layout.pack(CDR_HEADER, sec, nanosec, self._head, *positions)


class PointTemplate:
    """A geometry_msgs/PointStamped of which only stamp, x and y change; z is 0."""

    _zeros_size = 8

    def __init__(self, frame_id: str) -> None:
        self._head = aligned(append_string(b'', frame_id), 8)
        self._layout = struct.Struct(f'<4siI{len(self._head)}s2d{self._zeros_size}x')

    def fill(self, sec: int, nanosec: int, x: float, y: float) -> bytes:
        """Return the message."""
        return self._layout.pack(CDR_HEADER, sec, nanosec, self._head, x, y)


class TwistTemplate(PointTemplate):
    """A geometry_msgs/TwistStamped of which only stamp, linear x and y change; the rest is 0."""

    _zeros_size = 32


def append_string(head: bytes, text: str) -> bytes:
    """Append a string to the head of a message."""
    encoded = text.encode() + b'\0'
    return aligned(head, 4) + struct.pack('<I', len(encoded)) + encoded


def aligned(head: bytes, size: int) -> bytes:
    """Pad to the alignment of a number of a size; the 8 bytes of the stamp come before."""
    return head + bytes(-len(head) % size)
