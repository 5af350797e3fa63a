"""The messages that tell the poses of legs."""

from array import array
from collections.abc import Sequence
from itertools import chain
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState

from .leg_types import LegPose, LegVelocity
from .qos import OUTPUT
from .solved_leg import SolvedLeg

Answer = tuple[SolvedLeg, LegPose, LegVelocity | None]


class LegMessages:
    """
    Publishers of what legs answer, and their messages, made once and filled for every answer.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.
    legs : sequence of SolvedLeg
        The legs.
    frame_id : str
        The plane of a leg, in which its foot and velocity are told; a named leg's has its name
        before it.

    """

    def __init__(self, node: Node, legs: Sequence[SolvedLeg], frame_id: str) -> None:
        """Make the publishers and the messages."""
        overridable = QoSOverridingOptions.with_default_policies()

        def publisher(kind: type, topic: str) -> Any:
            return node.create_publisher(kind, topic, OUTPUT, qos_overriding_options=overridable)

        self._joint_states = publisher(JointState, 'joint_states')
        self._joint_state = JointState()
        self._feet = {}
        for leg in legs:
            prefixed = leg.mounting.prefixed
            point, velocity = PointStamped(), TwistStamped()
            point.header.frame_id = velocity.header.frame_id = prefixed(frame_id)
            self._feet[leg.mounting.name] = (
                publisher(PointStamped, prefixed('point_h')),
                point,
                publisher(TwistStamped, prefixed('velocity_h')),
                velocity,
            )

    def publish(self, answers: Sequence[Answer], stamp: Time) -> None:
        """
        Publish the angles of all answers in one JointState, and each leg's foot.

        Velocities are told where every answer has one.
        """
        message = self._joint_state
        message.header.stamp = stamp
        message.name = [name for leg, _, _ in answers for name in leg.joint_names]
        message.position = array('d', chain.from_iterable(pose.joints for _, pose, _ in answers))
        velocities = [velocity.joints for _, _, velocity in answers if velocity is not None]
        known = len(velocities) == len(answers)
        message.velocity = array('d', chain.from_iterable(velocities) if known else ())
        self._joint_states.publish(message)
        for leg, pose, velocity in answers:
            self._publish_foot(leg, pose, velocity, stamp)

    def _publish_foot(
        self, leg: SolvedLeg, pose: LegPose, velocity: LegVelocity | None, stamp: Time
    ) -> None:
        points, point, velocities, twist = self._feet[leg.mounting.name]
        point.header.stamp = stamp
        point.point.x, point.point.y = pose.h
        points.publish(point)
        if velocity is not None:
            twist.header.stamp = stamp
            twist.twist.linear.x, twist.twist.linear.y = velocity.h
            velocities.publish(twist)
