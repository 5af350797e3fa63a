"""What legs answer, on the wire."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import NamedTuple

from geometry_msgs.msg import PointStamped, TwistStamped
from klann_ros.kinematics import LinkageMotion, LinkagePose
from klann_ros.nodes import qos_overrides
from klann_ros.nodes.qos import OUTPUT
from rclpy.node import Node
from sensor_msgs.msg import JointState

from .cdr_templates import JointStateTemplate, PointTemplate, TwistTemplate
from .crank_inputs import Stamp
from .solved_leg import SolvedLeg

# Publishes bytes as they are.
Send = Callable[[bytes], None]
Answer = tuple[SolvedLeg, LinkagePose, LinkageMotion | None]


class _Foot(NamedTuple):
    """The publishers of a leg's foot and its velocity, with their messages."""

    send_point: Send
    point: PointTemplate
    send_velocity: Send
    velocity: TwistTemplate


class LegMessages:
    """
    Publishers of what legs answer.

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

        def publisher(kind: type, topic: str) -> Send:
            profile = qos_overrides.of_publisher(node, topic, OUTPUT)
            made = node.create_publisher(kind, topic, profile)
            # What `publish` adds to it guards against a publisher that somebody else destroys.
            send: Send = made.handle.publish_raw
            return send

        self._send_joint_state = publisher(JointState, 'joint_states')
        # By the legs that are in it: one that cannot be solved is left out.
        self._joint_state: dict[tuple[str, ...], JointStateTemplate] = {}
        self._feet = {}
        for leg in legs:
            prefixed = leg.mounting.prefixed
            self._feet[leg.mounting.name] = _Foot(
                publisher(PointStamped, prefixed('point_h')),
                PointTemplate(prefixed(frame_id)),
                publisher(TwistStamped, prefixed('velocity_h')),
                TwistTemplate(prefixed(frame_id)),
            )

    def publish(self, answers: Sequence[Answer], stamp: Stamp) -> None:
        """
        Publish the angles of all answers in one JointState, and each leg's foot.

        Velocities are told where every answer has one.
        """
        positions = tuple(chain.from_iterable(pose.joints for _, pose, _ in answers))
        known = [velocity.joints for _, _, velocity in answers if velocity is not None]
        velocities = tuple(chain(*known)) if len(known) == len(answers) else ()
        self._send_joint_state(self._template(answers).fill(*stamp, positions, velocities))
        for leg, pose, velocity in answers:
            foot = self._feet[leg.mounting.name]
            foot.send_point(foot.point.fill(*stamp, *pose.h))
            if velocity is not None:
                foot.send_velocity(foot.velocity.fill(*stamp, *velocity.h))

    def _template(self, answers: Sequence[Answer]) -> JointStateTemplate:
        legs = tuple(leg.mounting.name for leg, _, _ in answers)
        template = self._joint_state.get(legs)
        if template is None:
            names = [name for leg, _, _ in answers for name in leg.joint_names]
            template = self._joint_state[legs] = JointStateTemplate(names)
        return template
