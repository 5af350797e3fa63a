"""The topics of a simulated robot: crank commands in; cranks, IMU, ground truth and time out."""

from array import array
from collections import Counter
from collections.abc import Callable, Sequence
from math import inf, isfinite
from time import monotonic
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped, TwistStamped
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    node_of,
    subscribe_raw,
)
from klann_ros.nodes.lease import LeaseListener
from klann_ros.nodes.raw_executor import Info
from klann_ros.nodes.solver.cdr import JointsReader
from klann_ros.sanitize.text import printable
from klann_ros.twin import Sensors, Twin
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu as ImuMessage, JointState
from std_msgs.msg import Header

# Minimum time between two warnings about commands [s].
WARNING_PERIOD = 2.0
# Period of the demo's commands [s].
_COMMAND_PERIOD = 0.1
# The demo stands for this time first, in which a walker learns its accelerometer's bias [s].
_STANDSTILL = 2.0


class CrankCommands:
    """Subscription to crank_command; without a younger command than the timeout a crank stops."""

    def __init__(self, node: Node, twin: Twin, timeout: float) -> None:
        self._node, self._twin, self._timeout = node, twin, timeout
        self._counts: Counter[str] = Counter()
        self._reader = JointsReader(twin.joints)
        # Arrival of the last command of each joint [s].
        self._last: dict[str, float] = {}
        self.topic = node.resolve_topic_name('crank_command')
        subscribe_raw(node, JointState, 'crank_command', self._on_command)

    @property
    def silent(self) -> list[str]:
        """Return the joints without a command."""
        return [joint for joint in self._twin.joints if joint not in self._last]

    @property
    def counts(self) -> dict[str, int]:
        """Return the numbers of commands by their outcome, and of cranks held after a timeout."""
        return {name: self._counts[name] for name in ('commands', 'rejected', 'limited', 'held')}

    def expire_commands(self) -> None:
        """Hold the cranks whose last command is too old."""
        now = monotonic()
        for joint, at in [*self._last.items()]:
            if now - at > self._timeout:
                del self._last[joint]
                self._twin.command(joint, 0.0)
                self._counts['held'] += 1

    def forget(self) -> None:
        """Hold all cranks until the next command."""
        self._last.clear()

    def _on_command(self, data: bytes, _: Info) -> None:
        self._counts['commands'] += 1
        try:
            velocities = self._velocities(data)
        except ValueError as error:
            self._counts['rejected'] += 1
            text = f'{self.topic} is rejected: {error}'
            self._node.get_logger().warning(text, throttle_duration_sec=WARNING_PERIOD)
            return
        for joint, velocity in velocities.items():
            self._last[joint] = monotonic()
            if self._twin.command(joint, velocity) != velocity:
                self._counts['limited'] += 1

    def _velocities(self, data: bytes) -> dict[str, float]:
        """Return the commanded velocities; a ValueError for an invalid message."""
        velocities = {}
        for joint, (_, velocity, *_) in self._reader.read(data).items():
            if velocity is None:
                raise ValueError('it has no velocities, and positions move no motor')
            if not isfinite(velocity):
                raise ValueError(f'velocity of {printable(joint)} is {velocity}')
            velocities[joint] = velocity
        return velocities


class RobotOutputs:
    """Publishers of the robot's readings and of the truth, in the frames `world` and `base`."""

    def __init__(
        self,
        node: Node,
        twin: Twin,
        sensors: Sensors,
        *,
        world: str,
        base: str,
        with_clock: bool,
        with_cameras: bool,
    ) -> None:
        self._twin = twin
        self._cranks = create_publisher(node, JointState, 'crank_state')
        self._imus = create_publisher(node, ImuMessage, 'imu')
        self._truths = create_publisher(node, Odometry, 'ground_truth')
        self._clock = create_publisher(node, Clock, '/clock') if with_clock else None
        self._cameras = {
            name: create_publisher(node, PointStamped, f'camera/{name}')
            for name in (twin.points() if with_cameras else ())
        }
        self._crank, self._imu, self._truth = JointState(), ImuMessage(), Odometry()
        self._crank.name = list(twin.joints)
        self._imu.header.frame_id = self._truth.child_frame_id = base
        self._truth.header.frame_id = world
        self._imu.orientation_covariance = _diagonal(sensors.orientation_noise**2)
        self._imu.angular_velocity_covariance = _diagonal(sensors.gyro_noise**2)
        self._imu.linear_acceleration_covariance = _diagonal(sensors.accelerometer_noise**2)

    def publish(self, stamp: Time) -> None:
        """Publish the current state."""
        if self._clock is not None:
            # First, so that nodes with simulated time have it before the rest arrives.
            self._clock.publish(Clock(clock=stamp))
        for message in (self._crank, self._imu, self._truth):
            message.header.stamp = stamp
        cranks, imu, truth = self._twin.cranks().values(), self._twin.imu(), self._twin.truth()
        self._crank.position = array('d', [crank.position for crank in cranks])
        self._crank.velocity = array('d', [crank.velocity for crank in cranks])
        # A review compares efforts with the masses of the legs alone; a walker's carry its weight.
        if not self._twin.is_free:
            self._crank.effort = array('d', self._twin.efforts())
        self._cranks.publish(self._crank)
        _fill(self._imu.orientation, 'xyzw', imu.orientation)
        _fill(self._imu.angular_velocity, 'xyz', imu.angular_velocity)
        _fill(self._imu.linear_acceleration, 'xyz', imu.linear_acceleration)
        self._imus.publish(self._imu)
        pose, twist = self._truth.pose.pose, self._truth.twist.twist
        _fill(pose.position, 'xyz', truth.position)
        _fill(pose.orientation, 'xyzw', truth.orientation)
        _fill(twist.linear, 'xyz', truth.linear)
        _fill(twist.angular, 'xyz', truth.angular)
        self._truths.publish(self._truth)
        if self._cameras:
            for name, (x, y) in self._twin.points().items():
                message = PointStamped(header=Header(stamp=stamp), point=Point(x=x, y=y))
                message.header.frame_id = f'{name.rpartition("/")[0]}/leg_plane'.lstrip('/')
                self._cameras[name].publish(message)


class DemoCommandPublisher:
    """Repeat one cmd_vel [m/s]; pause while another node publishes it, or holds its lease."""

    def __init__(self, node: Node, linear: float, now: Callable[[], float]) -> None:
        self._node, self._now = node, now
        self._since = inf
        self._cranks = node.resolve_topic_name('crank_command')
        self._publisher: Any = create_publisher(node, TwistStamped, 'cmd_vel')
        self._lease = LeaseListener(node, self._publisher.topic_name, self._on_lease)
        # Without a stamp it is as old as its arrival.
        self._command = TwistStamped()
        self._command.twist.linear.x = linear
        create_steady_timer(node, _COMMAND_PERIOD, self._send)

    def _send(self) -> None:
        if not self._node.count_publishers(self._cranks):
            self._since = inf
            return
        # The robot's time starts again at a reset.
        self._since = min(self._since, self._now())
        has_stood = self._now() >= self._since + _STANDSTILL
        if has_stood and not self._lease.holder and not self._has_others():
            self._publisher.publish(self._command)

    def _has_others(self) -> bool:
        """Return whether another node publishes cmd_vel, except a driver that has left."""
        topic = self._publisher.topic_name
        if self._node.count_publishers(topic) == 1:
            return False
        publishers = {*map(node_of, self._node.get_publishers_info_by_topic(topic))}
        # A driver that was killed is known to the middleware for 20 s more.
        return bool(publishers - {self._node.get_fully_qualified_name(), self._lease.last_holder})

    def _on_lease(self, driver: str) -> None:
        text = f'yields to {driver}, which drives it' if driver else 'resumes: the driver has left'
        self._node.get_logger().info(f'{self._publisher.topic_name}: {text}')


def _fill(message: object, names: str, values: Sequence[float]) -> None:
    for name, value in zip(names, values, strict=True):
        setattr(message, name, value)


def _diagonal(variance: float) -> list[float]:
    # All zero: by the message's definition unknown, and also without error.
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
