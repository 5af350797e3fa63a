"""The messages that tell a leg's pose."""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, TwistStamped
from sensor_msgs.msg import JointState

from .leg_parameters import LegPose, LegVelocity


class LegMessages:
    """
    The messages of one leg, made once and filled for every pose.

    Parameters
    ----------
    frame_id : str
        The leg's plane, in which H and its velocity are told.
    joint_names : sequence of str
        The names of its angles, the crank's first.

    """

    def __init__(self, frame_id: str, joint_names: Sequence[str]) -> None:
        """Make the messages."""
        self._joint_state = JointState(name=list(joint_names))
        self._point_h = PointStamped()
        self._point_h.header.frame_id = frame_id
        self._velocity_h = TwistStamped()
        self._velocity_h.header.frame_id = frame_id

    def joint_state(self, pose: LegPose, velocity: LegVelocity | None, stamp: Time) -> JointState:
        """Return the leg's angles [rad], and their rates [rad/s] where they are known."""
        message = self._joint_state
        message.header.stamp = stamp
        message.position = array('d', pose.joints)
        message.velocity = array('d', velocity.joints if velocity else ())
        return message

    def point_h(self, pose: LegPose, stamp: Time) -> PointStamped:
        """Return the foot H [m]."""
        message = self._point_h
        message.header.stamp = stamp
        message.point.x, message.point.y = pose.h
        return message

    def velocity_h(self, velocity: LegVelocity, stamp: Time) -> TwistStamped:
        """Return the velocity of the foot H [m/s]."""
        message = self._velocity_h
        message.header.stamp = stamp
        message.twist.linear.x, message.twist.linear.y = velocity.h
        return message
