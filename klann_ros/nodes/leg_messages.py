"""The messages that tell a leg's pose."""

from array import array

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, TwistStamped
from klann_ros.kinematics import KlannPose, KlannVelocity
from klann_ros.kinematics.klann.pose import JOINTS
from sensor_msgs.msg import JointState


class LegMessages:
    """
    The messages of one leg, made once and filled for every pose.

    Parameters
    ----------
    frame_id : str
        The leg's plane, in which H and its velocity are told.

    """

    def __init__(self, frame_id: str) -> None:
        """Make the messages."""
        self._joint_state = JointState(name=list(JOINTS))
        self._point_h = PointStamped()
        self._point_h.header.frame_id = frame_id
        self._velocity_h = TwistStamped()
        self._velocity_h.header.frame_id = frame_id

    def joint_state(
        self, pose: KlannPose, velocity: KlannVelocity | None, stamp: Time
    ) -> JointState:
        """Return the textbook's angles [rad], and their rates [rad/s] where they are known."""
        message = self._joint_state
        message.header.stamp = stamp
        message.position = array('d', pose[:5])
        message.velocity = array('d', velocity[:5] if velocity else ())
        return message

    def point_h(self, pose: KlannPose, stamp: Time) -> PointStamped:
        """Return the foot H [m]."""
        message = self._point_h
        message.header.stamp = stamp
        message.point.x, message.point.y = pose.h
        return message

    def velocity_h(self, velocity: KlannVelocity, stamp: Time) -> TwistStamped:
        """Return the velocity of the foot H [m/s]."""
        message = self._velocity_h
        message.header.stamp = stamp
        message.twist.linear.x, message.twist.linear.y = velocity.h
        return message
