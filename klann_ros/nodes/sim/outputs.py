"""The topics that a simulated robot gives: cranks, IMU, where it really is, and time."""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped
from klann_ros.nodes.endpoints import create_publisher
from klann_ros.twin import Imu, Sensors, SimulatedCrank, Truth, Twin
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu as ImuMessage, JointState
from std_msgs.msg import Header


class RobotOutputs:
    """
    Publishers of what a robot tells.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    twin : Twin
        The robot.
    sensors : Sensors
        How well its IMU knows.
    world, base : str
        Frames of the ground truth and of the body.
    with_clock : bool
        Whether /clock is published as well.
    with_cameras : bool
        Whether the moving points of the legs are measured and published as well.

    """

    def __init__(
        self,
        node: Node,
        twin: Twin,
        sensors: Sensors,
        *,
        world: str,
        base: str,
        with_clock: bool,
        with_cameras: bool = False,
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
        self._publish_cranks(list(self._twin.cranks().values()))
        self._publish_imu(self._twin.imu())
        self._publish_truth(self._twin.truth())
        if self._cameras:
            for name, (x, y) in self._twin.points().items():
                message = PointStamped(header=Header(stamp=stamp), point=Point(x=x, y=y))
                message.header.frame_id = f'{name.rpartition("/")[0]}/leg_plane'.lstrip('/')
                self._cameras[name].publish(message)

    def _publish_cranks(self, cranks: Sequence[SimulatedCrank]) -> None:
        self._crank.position = array('d', [crank.position for crank in cranks])
        self._crank.velocity = array('d', [crank.velocity for crank in cranks])
        # A walker's would carry its weight, and be held against the masses of its legs alone.
        if not self._twin.is_free:
            self._crank.effort = array('d', self._twin.efforts())
        self._cranks.publish(self._crank)

    def _publish_imu(self, imu: Imu) -> None:
        _fill(self._imu.orientation, 'xyzw', imu.orientation)
        _fill(self._imu.angular_velocity, 'xyz', imu.angular_velocity)
        _fill(self._imu.linear_acceleration, 'xyz', imu.linear_acceleration)
        self._imus.publish(self._imu)

    def _publish_truth(self, truth: Truth) -> None:
        pose, twist = self._truth.pose.pose, self._truth.twist.twist
        _fill(pose.position, 'xyz', truth.position)
        _fill(pose.orientation, 'xyzw', truth.orientation)
        _fill(twist.linear, 'xyz', truth.linear)
        _fill(twist.angular, 'xyz', truth.angular)
        self._truths.publish(self._truth)


def _fill(message: object, names: str, values: Sequence[float]) -> None:
    for name, value in zip(names, values, strict=True):
        setattr(message, name, value)


def _diagonal(variance: float) -> list[float]:
    # All zero: by the message's definition unknown, and also without error.
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
