"""
The messages of `walker_node`, read and written as bytes, its diagnostics and log lines.

Conversion between bytes and Python messages would cost more than the computation.
"""

from collections.abc import Mapping
from math import cos, hypot, isfinite, pi, sin
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from klann_ros.gait import Triple, Twist2D
from klann_ros.kinematics.angles import yaw_of
from klann_ros.messages import (
    IMU,
    NumberPlaces,
    ODOMETRY,
    Template,
    TRANSFORMS,
    TWIST,
    TWIST_STAMPED,
)
from klann_ros.nodes.clocks import ControlClock, steady_time
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    diagnostic_array,
    diagnostic_status,
    message_class,
    node_of,
    TypeCheck,
    UnknownMessageTypeError,
)
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.walker import DiagnosticLevel, Fault, OdometryEstimate, Walker
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from .declarations import TYPE_REMEDIES

# Tolerance of the norm of a quaternion; a default-initialised one is shorter.
UNIT_TOLERANCE = 1e-2
# The numbers of an Imu that are read.
_IMU_NUMBERS = (
    *('header.stamp.sec', 'header.stamp.nanosec', 'orientation', 'orientation_covariance[0]'),
    *('orientation_covariance[8]', 'angular_velocity', 'linear_acceleration'),
    'linear_acceleration_covariance[0]',
)
# No walking body turns faster [rad/s].
MAX_ANGULAR_RATE = 100.0
# Variances of the velocities z, roll and pitch, which only tilting causes.
_TILTING_VARIANCES = (1e-2, 1e-2, 1e-2)
# The numbers in an Odometry that are not always 0: pose and covariance of a planar motion with
# variances of z, roll and pitch, its velocity, and their variances.
_ODOMETRY_NUMBERS = (
    'pose.pose',
    *(f'pose.covariance[{index}]' for index in (0, 1, 5, 6, 7, 11, 14, 21, 28, 30, 31, 35)),
    *('twist.twist.linear.x', 'twist.twist.linear.y', 'twist.twist.angular.z'),
    *(f'twist.covariance[{index}]' for index in (0, 7, 14, 21, 28, 35)),
)
# Indices of x, y and yaw in a covariance of six, and rounding errors of its eigenvalues.
_PLANAR = [0, 1, 5]
MAX_ROUNDING = 1e-9


def odometry_template(frame: str, child: str) -> Template:
    """Return a nav_msgs/Odometry of the numbers of a planar motion and their variances."""
    content = {'header.frame_id': frame, 'child_frame_id': child}
    return Template(ODOMETRY, content, _ODOMETRY_NUMBERS)


def transform_template(frame: str, child: str) -> Template:
    """Return a tf2_msgs/TFMessage of one transform: translation, rotation."""
    transform = {'header.frame_id': frame, 'child_frame_id': child}
    return Template(TRANSFORMS, {'transforms': [transform]}, ['transforms[0].transform'])


class TwistReading(NamedTuple):
    """A cmd_vel; the stamp of a Twist is 0."""

    linear: float
    angular: float
    sec: int
    nanosec: int


def read_twist(data: bytes, *, stamped: bool) -> TwistReading:
    """Read a geometry_msgs/TwistStamped or Twist; a ValueError for another message."""
    if not stamped:
        twist = TWIST.read(data)
        return TwistReading(twist['linear.x'], twist['angular.z'], 0, 0)
    twist = TWIST_STAMPED.read(data)
    sec = twist['header.stamp.sec']
    nanosec = twist['header.stamp.nanosec']
    return TwistReading(twist['twist.linear.x'], twist['twist.angular.z'], sec, nanosec)


def twist_message(motion: Twist2D, frame: str, sec: int, nanosec: int) -> TwistStamped:
    """Return a motion as a message."""
    message = TwistStamped()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    message.twist.linear.x, message.twist.angular.z = motion
    return message


def read_pose(data: bytes, frame: str) -> tuple[Triple, tuple[Triple, Triple, Triple]]:
    """Read x, y, yaw and their covariance of a PoseWithCovarianceStamped; or a ValueError."""
    message = deserialize_message(data, PoseWithCovarianceStamped)
    if message.header.frame_id not in ('', frame):
        raise ValueError(f'its frame is {printable(message.header.frame_id)}, not {frame}')
    position = message.pose.pose.position
    quaternion = message.pose.pose.orientation
    norm = hypot(quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    if not (isfinite(position.x + position.y) and abs(norm - 1.0) < UNIT_TOLERANCE):
        raise ValueError('its position is not finite, or its orientation no unit quaternion')
    covariance = message.pose.covariance.reshape(6, 6)[_PLANAR][:, _PLANAR]
    is_finite = np.isfinite(covariance).all()
    if not (is_finite and np.linalg.eigvalsh(covariance).min() >= -MAX_ROUNDING):
        raise ValueError('its covariance is not finite, or not positive')
    yaw = yaw_of(quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    x_row, y_row, yaw_row = covariance.tolist()
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
        # Most messages differ from the last one in their numbers only.
        self._places: NumberPlaces | None = None

    def read(self, data: bytes) -> ImuMessage:
        """Return a message; a ValueError for another one, or one with invalid rates."""
        if self._places is None or not self._places.fits(data):
            self._places = NumberPlaces(IMU.layout(data), _IMU_NUMBERS)
        numbers = self._places.read(data)
        sec, nanosec, x, y, z, w, roll_variance, yaw_variance = numbers[:8]
        wx, wy, wz, force_x, force_y, force_z, force_variance = numbers[8:]
        # NaN compares with nothing.
        limit = MAX_ANGULAR_RATE
        if not (abs(wx) <= limit and abs(wy) <= limit and abs(wz) <= limit):
            raise ValueError(f'its angular velocity is not finite, or beyond {limit:g} rad/s')
        # By the message's definition a variance of -1 means no orientation, or no acceleration;
        # many drivers without an orientation leave the default of the message.
        is_unit = abs(x * x + y * y + z * z + w * w - 1.0) < UNIT_TOLERANCE
        is_default = (w, roll_variance, yaw_variance) == (1.0, 0.0, 0.0)
        orientation = None
        if is_unit and roll_variance != -1.0 and not is_default:
            orientation = x, y, z, w
        force = None if force_variance == -1.0 else (force_x, force_y, force_z)
        # A yaw of any direction has no larger variance.
        variance = min(yaw_variance, pi**2) if yaw_variance > 0.0 else 0.0
        return ImuMessage(orientation, variance, (wx, wy, wz), force, sec, nanosec)


class OdomOutput:
    """Publisher of odom and its transform, by the node's parameters."""

    def __init__(self, node: Node, parameters: Mapping[str, Any]) -> None:
        frame, child = parameters['odom_frame'], parameters['base_frame']
        self._height_variance = parameters['height_error'] ** 2
        self._tilt_variance = parameters['tilt_error'] ** 2
        self._odom = create_publisher(node, Odometry, 'odom')
        self._odom_template = odometry_template(frame, child)
        self._tf: Any = None
        if not parameters['publish_tf']:
            return
        try:
            kind = message_class('tf2_msgs/msg/TFMessage')
        except UnknownMessageTypeError:
            text = 'tf2_msgs is not installed: odom is published, but nothing on /tf'
            node.get_logger().warning(text)
        else:
            self._tf = create_publisher(node, kind, '/tf')
            self._tf_template = transform_template(frame, child)

    def publish(self, estimate: OdometryEstimate, sec: int, nanosec: int) -> None:
        """Publish an estimate, unless its height is unknown."""
        x, y, z, roll, pitch, yaw, linear, angular, covariance, rate_variances = estimate
        if not isfinite(z):
            return
        pose = (x, y, z, *_quaternion(roll, pitch, yaw))
        x_row, y_row, yaw_row = covariance
        tilt_variance = self._tilt_variance
        variances = self._height_variance, tilt_variance, tilt_variance
        x_variance, y_variance, yaw_variance = rate_variances
        numbers = (
            *pose, *x_row, *y_row, *variances, *yaw_row,
            *linear, angular, x_variance, y_variance, *_TILTING_VARIANCES, yaw_variance,
        )  # fmt: skip
        self._odom.publish(self._odom_template.fill(sec, nanosec, *numbers))
        if self._tf is not None:
            self._tf.publish(self._tf_template.fill(sec, nanosec, *pose))


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Return x, y, z and w."""
    cos_roll, sin_roll = cos(roll / 2.0), sin(roll / 2.0)
    cos_pitch, sin_pitch = cos(pitch / 2.0), sin(pitch / 2.0)
    cos_yaw, sin_yaw = cos(yaw / 2.0), sin(yaw / 2.0)
    return (
        sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
        cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
        cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
        cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
    )


# Minimum time between two log lines about events [s].
EVENT_PERIOD = 1.0
# Events in one line of the log.
MAX_LOGGED = 5


class WalkerReports:
    """Publisher of a walker's diagnostics, by the node's parameters; it logs faults and events."""

    def __init__(
        self, node: Node, walker: Walker, clock: ControlClock, parameters: Mapping[str, Any]
    ) -> None:
        self._node = node
        self._walker = walker
        self._clock = clock
        # Largest effort of each crank by the masses in the robot's file [N m].
        self._described_efforts: dict[str, float] = {}
        if parameters['max_effort']:
            # The data sheet takes 15 ms to import.
            from klann_ros.datasheet import peak_efforts  # noqa: PLC0415

            self._described_efforts = peak_efforts(walker.feet.robot)
        self._publisher: Any = create_publisher(node, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(node, TYPE_REMEDIES)
        self._logged_warnings: set[str] = set()
        # Steady time of the last line about events [s].
        self._event_log_time = -EVENT_PERIOD
        self._logged_fault: Fault | None = None
        # Also where simulated time stands still.
        create_steady_timer(node, parameters['diagnostics_period'], self._publish)

    def log_events(self) -> None:
        """Log a new fault, and now and then the events since the last line."""
        controller = self._walker.controller
        latch, events = controller.latch, controller.events
        if latch.fault is not self._logged_fault:
            self._logged_fault = latch.fault
            if latch.fault:
                self._node.get_logger().error(printable_line(f'fault: {latch.reason}'))
        now = steady_time()
        if not events or now - self._event_log_time < EVENT_PERIOD:
            return
        self._event_log_time = now
        texts = [*events][:MAX_LOGGED]
        more = f'; and {len(events) - len(texts)} more' if len(events) > len(texts) else ''
        events.clear()
        self._node.get_logger().warning(printable_line('; '.join(texts) + more))

    def _publish(self) -> None:
        """Publish the state of the walker as diagnostics, and warn once of each trouble."""
        now = self._clock.now()
        level, message = self._walker.verdict(now)
        figures = self._walker.values(now)
        for joint, effort in self._described_efforts.items():
            figures[f'{joint} described_effort'] = f'{effort:.3f}'
        for rivalry in self._rivalries():
            self._warn_once(rivalry)
            level = DiagnosticLevel.WARN if level == DiagnosticLevel.OK else level
            message = f'{message}; {rivalry}'
        for crank in self._walker.controller.cranks:
            self._warn_once(crank.units.suspicion)
        verdict = self._types.add_to(bytes([level.value]), message)
        status = diagnostic_status(self._node, 'walker', *verdict, figures.items())
        self._publisher.publish(diagnostic_array(self._node, [status]))

    def _rivalries(self) -> list[str]:
        """Return the inputs and outputs with several publishers, in words."""
        rivalries = []
        for topic, harmless, text in (
            ('crank_command', 'watchdog_node', '{} publishers: only one may drive the cranks'),
            # sim_node gives way to others.
            ('cmd_vel', 'sim_node', '{} publishers: {}'),
            ('e_stop', '', '{} publishers, whose silence hides: {}'),
        ):
            nodes = self._publishing_nodes(topic, harmless)
            if len(nodes) > 1:
                names = ', '.join(map(printable, nodes))
                rivalries.append(f'{topic} has {text.format(len(nodes), names)}')
        return rivalries

    def _publishing_nodes(self, name: str, harmless: str = '') -> list[str]:
        """Return the nodes that publish a topic, if there are several, but the harmless ones."""
        topic = self._node.resolve_topic_name(name)
        if self._node.count_publishers(topic) < 2:
            return []
        nodes = map(node_of, self._node.get_publishers_info_by_topic(topic))
        return sorted(node for node in nodes if node.rpartition('/')[2] not in ('', harmless))

    def _warn_once(self, text: str) -> None:
        """Log a warning, unless it is empty or was logged before."""
        if text and text not in self._logged_warnings:
            self._logged_warnings.add(text)
            self._node.get_logger().warning(printable_line(text))
