"""The topics that a walker gives: commands of its cranks, and where it is."""

from collections.abc import Sequence
from math import cos, isfinite, sin
from typing import Any

from klann_ros.nodes.endpoints import create_publisher, message_class, UnknownMessageTypeError
from klann_ros.sanitize.cdr import JointStateTemplate
from klann_ros.walker import CrankCommand, OdometryEstimate
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from .messages import odometry_template, transform_template

# Variance of the components that move only as far as the body tilts.
UNTOLD = 1e-2
NONE = (0.0, 0.0, 0.0)


class CrankOutput:
    """
    Publisher of crank_command.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    joints : sequence of str
        The joints of the cranks.
    velocities : bool
        Whether rates alone are sent, as ros2_control's forward controllers take them.

    """

    def __init__(self, node: Node, joints: Sequence[str], *, velocities: bool) -> None:
        self._template = None if velocities else JointStateTemplate(joints)
        kind: Any = Float64MultiArray if velocities else JointState
        self._publisher = create_publisher(node, kind, 'crank_command')

    def publish(self, command: CrankCommand, sec: int, nanosec: int) -> None:
        """Publish a command."""
        if self._template is None:
            self._publisher.publish(Float64MultiArray(data=list(command.velocity)))
        else:
            filled = self._template.fill(sec, nanosec, command.position, command.velocity)
            self._publisher.publish(filled)


class OdomOutput:
    """
    Publisher of odom, and of the transform that it tells.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    frame, child : str
        odom and base_link.
    tilt, height : float
        Standard deviations of roll and pitch [rad], and of the height [m].
    transform : bool
        Whether the transform is wanted.

    Attributes
    ----------
    problem : str
        Why there is no transform, although it is wanted.

    """

    def __init__(
        self, node: Node, frame: str, child: str, *, tilt: float, height: float, transform: bool
    ) -> None:
        self._odom = create_publisher(node, Odometry, 'odom')
        self._odom_template = odometry_template(frame, child)
        self._tilt, self._height = tilt**2, height**2
        self._tf: Any = None
        self.problem = ''
        if transform:
            try:
                kind = message_class('tf2_msgs/msg/TFMessage')
            except UnknownMessageTypeError:
                self.problem = 'tf2_msgs is not installed: odom is published, but nothing on /tf'
                return
            self._tf = create_publisher(node, kind, '/tf')
            self._tf_template = transform_template(frame, child, kind)

    def publish(self, at: OdometryEstimate, sec: int, nanosec: int) -> None:
        """Publish where it is."""
        if not isfinite(at.z):
            return
        pose = (at.x, at.y, at.z, *_quaternion(at.roll, at.pitch, at.yaw))
        twist = (*at.linear, 0.0, 0.0, 0.0, at.angular)
        numbers = (*pose, *self._spread(at), *twist, *_rates(at))
        self._odom.publish(self._odom_template.fill(sec, nanosec, numbers))
        if self._tf is not None:
            self._tf.publish(self._tf_template.fill(sec, nanosec, pose))

    def _spread(self, at: OdometryEstimate) -> tuple[float, ...]:
        """Return the covariance of x, y, z, roll, pitch and yaw, row by row."""
        (xx, xy, xt), (yx, yy, yt), (tx, ty, tt) = at.covariance
        return (
            *(xx, xy, *NONE, xt),
            *(yx, yy, *NONE, yt),
            *(0.0, 0.0, self._height, *NONE),
            *(*NONE, self._tilt, 0.0, 0.0),
            *(*NONE, 0.0, self._tilt, 0.0),
            *(tx, ty, *NONE, tt),
        )


def _rates(at: OdometryEstimate) -> tuple[float, ...]:
    """Return the covariance of the velocities, row by row."""
    x, y, turn = at.rate_variances
    return (
        *(x, 0.0, 0.0, *NONE),
        *(0.0, y, 0.0, *NONE),
        *(0.0, 0.0, UNTOLD, *NONE),
        *(*NONE, UNTOLD, 0.0, 0.0),
        *(*NONE, 0.0, UNTOLD, 0.0),
        *(*NONE, 0.0, 0.0, turn),
    )


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
