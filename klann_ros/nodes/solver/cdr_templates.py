"""
Writing messages as they are on the wire (CDR): what stays is made once, numbers are packed in.

To make bytes of a Python message costs more than to solve a pose, and so does the message itself.
What `fill` returns goes to `Publisher.publish`, and a subscriber receives it byte for byte as if
the message had been published. Only between two fields, where a number is aligned, a typed
publish leaves whatever was there before, and a template leaves zeros.
"""

from collections.abc import Sequence
import struct

# Little-endian, as every machine that ROS 2 supports.
_HEADER = b'\0\1\0\0'


class JointStateTemplate:
    """
    A sensor_msgs/JointState of which only stamp, positions and velocities change.

    Parameters
    ----------
    names : sequence of str
        The names of the joints, at least one.
    frame_id : str
        The frame.

    """

    def __init__(self, names: Sequence[str], frame_id: str = '') -> None:
        """Make all that stays."""
        count = len(names)
        head = _aligned(_string(b'', frame_id), 4) + struct.pack('<I', count)
        for name in names:
            head = _string(head, name)
        self._head = _aligned(_aligned(head, 4) + struct.pack('<I', count), 8)
        self._middle = struct.pack('<I4x', count)
        layout = f'<4siI{len(self._head)}s{count}d'
        self._without = struct.Struct(f'{layout}8x')
        self._with = struct.Struct(f'{layout}8s{count}d4x')

    def fill(
        self,
        sec: int,
        nanosec: int,
        positions: Sequence[float],
        velocities: Sequence[float] = (),
    ) -> bytes:
        """Return the message; there are as many velocities as names, or none."""
        if velocities:
            return self._with.pack(
                _HEADER, sec, nanosec, self._head, *positions, self._middle, *velocities
            )
        return self._without.pack(_HEADER, sec, nanosec, self._head, *positions)


class PointTemplate:
    """A geometry_msgs/PointStamped of which only stamp, x and y change; z is 0."""

    _rest = 8

    def __init__(self, frame_id: str) -> None:
        """Make all that stays."""
        self._head = _aligned(_string(b'', frame_id), 8)
        self._layout = struct.Struct(f'<4siI{len(self._head)}s2d{self._rest}x')

    def fill(self, sec: int, nanosec: int, x: float, y: float) -> bytes:
        """Return the message."""
        return self._layout.pack(_HEADER, sec, nanosec, self._head, x, y)


class TwistTemplate(PointTemplate):
    """A geometry_msgs/TwistStamped of which only stamp, linear x and y change; the rest is 0."""

    _rest = 32


def _string(head: bytes, text: str) -> bytes:
    """Append a string to what stands before it."""
    encoded = text.encode() + b'\0'
    return _aligned(head, 4) + struct.pack('<I', len(encoded)) + encoded


def _aligned(head: bytes, size: int) -> bytes:
    """Fill up to where a number of a size begins; the stamp stands before, and fills 8 bytes."""
    return head + bytes(-len(head) % size)
