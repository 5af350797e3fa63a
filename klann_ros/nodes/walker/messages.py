"""
The messages of `walker_node`, read and written as bytes, and their publishers.

As in cdr_readers.py: conversion between bytes and Python messages costs more than the computation.
"""

from collections.abc import Mapping, Sequence
from math import cos, hypot, isfinite, pi, sin
import struct
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, TwistStamped
from klann_ros.gait import Triple, Twist2D
from klann_ros.kinematics.angles import yaw_of
from klann_ros.nodes.endpoints import (
    create_publisher,
    message_class,
    UnknownMessageTypeError,
)
from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, STAMP_SIZE
from klann_ros.sanitize.text import printable
from klann_ros.walker import OdometryEstimate
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

# A number and a stamp that mark their places in a message; no name contains their bytes.
_MARK = 1.2345678e-300
_STAMP = 123456789, 987654321
# Tolerance of the norm of a quaternion; a default-initialised one is shorter.
UNIT_TOLERANCE = 1e-2
# The length of a header's frame in a message.
_FRAME = slice(HEADER_SIZE + STAMP_SIZE, HEADER_SIZE + STAMP_SIZE + 4)
# No walking body turns faster [rad/s].
MAX_ANGULAR_RATE = 100.0
# Variances of the velocities z, roll and pitch, which only tilting causes.
_TILTING_VARIANCES = (1e-2, 1e-2, 1e-2)
# Places of the numbers of a pose, of an Odometry that are not always 0: pose and covariance of a
# planar motion with variances of z, roll and pitch, its velocity, and their variances.
_POSE = '7d'
_ODOMETRY = f'{_POSE}2d24xd2d24xd16xd48xd48xd8x2d24xd2d24xdd48xd48xd48xd48xd48xd'
# The places of x, y and yaw in a covariance of six, and rounding errors of its eigenvalues.
_PLANE = [0, 1, 5]
MAX_ROUNDING = 1e-9


class NumbersTemplate:
    """
    A message with `_STAMP` and `_MARK`: only its stamp and numbers from the mark on change.

    Their places are in struct's notation; between them are zeros.
    """

    def __init__(self, message: Any, places: str) -> None:
        whole = bytes(serialize_message(message))
        stamp = whole.index(struct.pack('<iI', *_STAMP))
        first = whole.index(struct.pack('<d', _MARK))
        self._head, self._middle = whole[:stamp], whole[slice(stamp + 8, first)]
        self._tail = whole[slice(first + struct.calcsize(f'<{places}'), None)]
        parts = f'{len(self._head)}siI{len(self._middle)}s{places}{len(self._tail)}s'
        self._layout = struct.Struct(f'<{parts}')

    def fill(self, sec: int, nanosec: int, numbers: Sequence[float]) -> bytes:
        """Return the message."""
        return self._layout.pack(self._head, sec, nanosec, self._middle, *numbers, self._tail)


def odometry_template(frame: str, child: str) -> NumbersTemplate:
    """Return a nav_msgs/Odometry of the numbers at `_ODOMETRY`."""
    message = Odometry(child_frame_id=child)
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = _STAMP
    message.pose.pose.position.x = _MARK
    return NumbersTemplate(message, _ODOMETRY)


def transform_template(frame: str, child: str, kind: Any) -> NumbersTemplate:
    """Return a tf2_msgs/TFMessage of one transform: translation, rotation."""
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = frame
    transform.header.stamp.sec, transform.header.stamp.nanosec = _STAMP
    transform.transform.translation.x = _MARK
    return NumbersTemplate(kind(transforms=[transform]), _POSE)


class TwistReading(NamedTuple):
    """A cmd_vel; the stamp of a Twist is 0."""

    linear: float
    angular: float
    sec: int
    nanosec: int


def read_twist(data: bytes, *, stamped: bool) -> TwistReading:
    """Read a geometry_msgs/TwistStamped or Twist; a ValueError for another message."""
    cursor = CdrCursor(data)
    sec, nanosec = cursor.header() if stamped else (0, 0)
    x, *_, turn = cursor.numbers('d', 6)
    return TwistReading(x, turn, sec, nanosec)


def twist_message(motion: Twist2D, frame: str, sec: int, nanosec: int) -> TwistStamped:
    """Return a motion as a message."""
    message = TwistStamped()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    message.twist.linear.x, message.twist.angular.z = motion
    return message


def read_pose(data: bytes, frame: str) -> tuple[Triple, tuple[Triple, Triple, Triple]]:
    """
    Read x, y and yaw of a geometry_msgs/PoseWithCovarianceStamped, and their covariance.

    A ValueError for another frame, for a pose that is none, and for a covariance that is none.
    """
    message = deserialize_message(data, PoseWithCovarianceStamped)
    if message.header.frame_id not in ('', frame):
        raise ValueError(f'its frame is {printable(message.header.frame_id)}, not {frame}')
    position, turned = message.pose.pose.position, message.pose.pose.orientation
    norm = hypot(turned.x, turned.y, turned.z, turned.w)
    if not (isfinite(position.x + position.y) and abs(norm - 1.0) < UNIT_TOLERANCE):
        raise ValueError('its position is not finite, or its orientation no unit quaternion')
    rows = message.pose.covariance.reshape(6, 6)[_PLANE][:, _PLANE]
    if not (np.isfinite(rows).all() and np.linalg.eigvalsh(rows).min() >= -MAX_ROUNDING):
        raise ValueError('its covariance is not finite, or not positive')
    yaw = yaw_of(turned.x, turned.y, turned.z, turned.w)
    x_row, y_row, yaw_row = rows.tolist()
    return (position.x, position.y, yaw), (tuple(x_row), tuple(y_row), tuple(yaw_row))


class ImuMessage(NamedTuple):
    """A sensor_msgs/Imu."""

    # x, y, z, w; None if it has none.
    orientation: tuple[float, float, float, float] | None
    # Variance of the yaw [rad^2]; 0 if unknown.
    variance: float
    # Angular velocity [rad/s].
    angular: tuple[float, float, float]
    # Linear acceleration [m/s^2]; None if it has none.
    force: tuple[float, float, float] | None
    sec: int
    nanosec: int


class ImuReader:
    """Read successive sensor_msgs/Imu messages."""

    def __init__(self) -> None:
        # Most messages differ from the last one in their numbers only: size, byte order and length
        # of the frame of the last one, and the places of its numbers.
        self._layout = -1, b'', b'', _imu_numbers('<', 0)

    def read(self, data: bytes) -> ImuMessage:
        """Return a message; a ValueError for another one, or one with invalid rates."""
        kind = len(data), data[:2], data[_FRAME]
        if kind != self._layout[:3]:
            self._layout = *kind, _imu_layout(data)
        numbers = self._layout[3].unpack_from(data)
        sec, nanosec, x, y, z, w, first, variance, a, b, c, *force, force_first = numbers
        # NaN compares with nothing.
        limit = MAX_ANGULAR_RATE
        if not (abs(a) <= limit and abs(b) <= limit and abs(c) <= limit):
            raise ValueError(f'its angular velocity is not finite, or beyond {limit:g} rad/s')
        # By the message's definition -1 means no orientation, or no acceleration; many drivers
        # without an orientation leave the default of the message.
        is_unit = abs(x * x + y * y + z * z + w * w - 1.0) < UNIT_TOLERANCE
        has = is_unit and first != -1.0 and (w, first, variance) != (1.0, 0.0, 0.0)
        # A yaw of any direction has no larger one.
        variance = min(variance, pi**2) if variance > 0.0 else 0.0
        orientation = (x, y, z, w) if has else None
        acceleration = (force[0], force[1], force[2]) if force_first != -1.0 else None
        return ImuMessage(orientation, variance, (a, b, c), acceleration, sec, nanosec)


def _imu_layout(data: bytes) -> struct.Struct:
    cursor = CdrCursor(data)
    cursor.header()
    cursor.align(8)
    return _imu_numbers(cursor.order, cursor.skip(8 * 37))


def _imu_numbers(order: str, begin: int) -> struct.Struct:
    """
    Return the places of the stamp, and of three quantities with parts of their covariances.

    The first and last of the orientation's, none of the angular velocity's, and the first of the
    linear acceleration's.
    """
    between = max(0, begin - _FRAME.start)
    return struct.Struct(f'{order}{HEADER_SIZE}xiI{between}x4dd{7 * 8}xd3d{9 * 8}x3dd')


class OdomOutput:
    """Publisher of odom and its transform, by the node's parameters."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        frame, child = values['odom_frame'], values['base_frame']
        self._odom = create_publisher(node, Odometry, 'odom')
        self._odom_template = odometry_template(frame, child)
        self._tilt, self._height = values['tilt_error'] ** 2, values['height_error'] ** 2
        self._tf: Any = None
        # The reason why there is no transform, although it is requested.
        self.problem = ''
        if values['publish_tf']:
            try:
                kind = message_class('tf2_msgs/msg/TFMessage')
            except UnknownMessageTypeError:
                self.problem = 'tf2_msgs is not installed: odom is published, but nothing on /tf'
                return
            self._tf = create_publisher(node, kind, '/tf')
            self._tf_template = transform_template(frame, child, kind)

    def publish(self, at: OdometryEstimate, sec: int, nanosec: int) -> None:
        """Publish an estimate, unless its height is unknown."""
        if not isfinite(at.z):
            return
        pose = (at.x, at.y, at.z, *_quaternion(at.roll, at.pitch, at.yaw))
        x, y, yaw = at.covariance
        plane = (*x, *y, self._height, self._tilt, self._tilt, *yaw)
        variance_x, variance_y, variance_yaw = at.rate_variances
        rates = (variance_x, variance_y, *_TILTING_VARIANCES, variance_yaw)
        numbers = (*pose, *plane, *at.linear, at.angular, *rates)
        self._odom.publish(self._odom_template.fill(sec, nanosec, numbers))
        if self._tf is not None:
            self._tf.publish(self._tf_template.fill(sec, nanosec, pose))


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    a, b = cos(roll / 2.0), sin(roll / 2.0)
    c, d = cos(pitch / 2.0), sin(pitch / 2.0)
    e, f = cos(yaw / 2.0), sin(yaw / 2.0)
    return (
        b * c * e - a * d * f,
        a * d * e + b * c * f,
        a * c * f - b * d * e,
        a * c * e + b * d * f,
    )
