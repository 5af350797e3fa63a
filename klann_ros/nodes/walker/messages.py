"""
What `walker_node` reads and writes a hundred times a second, as it is on the wire.

As in solver/cdr.py, of which this is a sequel: to make a Python message of bytes, or bytes of it,
costs more than all that is computed.
"""

from collections.abc import Sequence
from math import isfinite
import struct
from typing import Any, NamedTuple

from geometry_msgs.msg import TransformStamped
from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, STAMP_SIZE
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

# Numbers that no name contains, by which their places are found.
_MARK = 1.2345678e-300
_STAMP = 123456789, 987654321
# Norm of a valid quaternion; a default-initialised one is shorter.
UNIT = 1e-2
# How long the frame of a header is.
_FRAME = slice(HEADER_SIZE + STAMP_SIZE, HEADER_SIZE + STAMP_SIZE + 4)
# No body that walks turns at more [rad/s].
FASTEST = 100.0


class NumbersTemplate:
    """
    A message of which only its stamp and a run of numbers change.

    Parameters
    ----------
    message : message
        With `_STAMP` as its stamp and `_MARK` as the first of the numbers.
    count : int
        How many numbers follow each other.

    """

    def __init__(self, message: Any, count: int) -> None:
        whole = bytes(serialize_message(message))
        stamp = whole.index(struct.pack('<iI', *_STAMP))
        first = whole.index(struct.pack('<d', _MARK))
        self._head, self._middle = whole[:stamp], whole[slice(stamp + 8, first)]
        self._tail = whole[slice(first + 8 * count, None)]
        parts = f'{len(self._head)}siI{len(self._middle)}s{count}d{len(self._tail)}s'
        self._layout = struct.Struct(f'<{parts}')

    def fill(self, sec: int, nanosec: int, numbers: Sequence[float]) -> bytes:
        """Return the message."""
        return self._layout.pack(self._head, sec, nanosec, self._middle, *numbers, self._tail)


def odometry_template(frame: str, child: str) -> NumbersTemplate:
    """Return a nav_msgs/Odometry: pose, its covariance, twist, its covariance."""
    message = Odometry(child_frame_id=child)
    message.header.frame_id = frame
    _mark(message.header)
    message.pose.pose.position.x = _MARK
    return NumbersTemplate(message, 7 + 36 + 6 + 36)


def transform_template(frame: str, child: str, kind: Any) -> NumbersTemplate:
    """Return a tf2_msgs/TFMessage of one transform: translation, rotation."""
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = frame
    _mark(transform.header)
    transform.transform.translation.x = _MARK
    return NumbersTemplate(kind(transforms=[transform]), 7)


def _mark(header: Any) -> None:
    header.stamp.sec, header.stamp.nanosec = _STAMP


class TwistReading(NamedTuple):
    """What a cmd_vel asks for; the stamp of a Twist is 0."""

    linear: float
    angular: float
    sec: int
    nanosec: int


def read_twist(data: bytes, *, stamped: bool) -> TwistReading:
    """
    Return what a geometry_msgs/TwistStamped, or a Twist, asks for.

    Raises
    ------
    ValueError
        It is no such message.

    """
    cursor = CdrCursor(data)
    sec = nanosec = 0
    if stamped:
        sec, nanosec = _stamp(cursor, data)
    x, *_, turn = _doubles(cursor, data, 6)
    return TwistReading(x, turn, sec, nanosec)


class ImuMessage(NamedTuple):
    """
    What a sensor_msgs/Imu says.

    Attributes
    ----------
    orientation : tuple of 4 floats, or None
        x, y, z, w; None where there is none.
    variance : float
        Variance of the yaw [rad^2]; 0 if unknown.
    angular : tuple of 3 floats
        [rad/s].
    force : tuple of 3 floats, or None
        What its accelerometer feels [m/s^2]; None where there is none.
    sec, nanosec : int
        The stamp.

    """

    orientation: tuple[float, float, float, float] | None
    variance: float
    angular: tuple[float, float, float]
    force: tuple[float, float, float] | None
    sec: int
    nanosec: int


class ImuReader:
    """Read one sensor_msgs/Imu after the other."""

    def __init__(self) -> None:
        # Most messages differ from the last one in their numbers only: its size, what it begins
        # with, how long its frame is, and where its numbers are.
        self._layout = -1, b'', b'', _imu_numbers('<', 0)

    def read(self, data: bytes) -> ImuMessage:
        """
        Return what a message says.

        Raises
        ------
        ValueError
            It is no such message, or its rates are no numbers.

        """
        kind = len(data), data[:2], data[_FRAME]
        if kind != self._layout[:3]:
            self._layout = *kind, _imu_layout(data)
        numbers = self._layout[3].unpack_from(data)
        sec, nanosec, x, y, z, w, first, variance, a, b, c, *force, feels = numbers
        # NaN compares with nothing.
        if not (abs(a) <= FASTEST and abs(b) <= FASTEST and abs(c) <= FASTEST):
            raise ValueError(f'its angular velocity is not finite, or beyond {FASTEST:g} rad/s')
        # So the message's definition has it: -1 where there is no orientation, or no acceleration.
        has = first != -1.0 and abs(x * x + y * y + z * z + w * w - 1.0) < UNIT
        if not (isfinite(variance) and variance > 0.0):
            variance = 0.0
        orientation = (x, y, z, w) if has else None
        acceleration = (force[0], force[1], force[2]) if feels != -1.0 else None
        return ImuMessage(orientation, variance, (a, b, c), acceleration, sec, nanosec)


def _imu_layout(data: bytes) -> struct.Struct:
    cursor = CdrCursor(data)
    _stamp(cursor, data)
    cursor.align(8)
    return _imu_numbers(cursor.order, cursor.skip(8 * 37))


def _imu_numbers(order: str, begin: int) -> struct.Struct:
    """
    Return the places of the stamp, and of what there is of each of three and their covariances.

    Of the orientation with the first and last, of the angular velocity with none, of the linear
    acceleration with the first.
    """
    between = max(0, begin - _FRAME.start)
    return struct.Struct(f'{order}{HEADER_SIZE}xiI{between}x4dd{7 * 8}xd3d{9 * 8}x3dd')


def _stamp(cursor: CdrCursor, data: bytes) -> tuple[int, int]:
    sec, nanosec = struct.unpack_from(f'{cursor.order}iI', data, cursor.skip(8))
    cursor.string()
    return sec, nanosec


def _doubles(cursor: CdrCursor, data: bytes, count: int) -> tuple[float, ...]:
    cursor.align(8)
    numbers: tuple[float, ...] = struct.unpack_from(
        f'{cursor.order}{count}d', data, cursor.skip(8 * count)
    )
    return numbers
