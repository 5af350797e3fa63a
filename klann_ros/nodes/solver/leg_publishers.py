"""How legs are published: their answers on the wire, and markers for RViz and Foxglove."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped, TwistStamped
from klann_ros.kinematics import foot_path, KinematicsError, LinkageMotion, LinkagePose
from klann_ros.nodes.endpoints import create_publisher
from klann_ros.plotting.drawing import PoseDrawing
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from .cdr import JointStateTemplate, PointTemplate, TwistTemplate
from .crank_inputs import Stamp
from .driven_leg import DrivenLeg

# Publishes bytes as they are.
Send = Callable[[bytes], None]
Answer = tuple[DrivenLeg, LinkagePose, LinkageMotion | None]
# At most so often [s], and only while somebody looks.
MARKERS_PERIOD = 0.05
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# Sizes of pivots, joints and bars, and of the path, as parts of the leg's size.
PIVOT, JOINT, BAR, PATH = 0.035, 0.03, 0.018, 0.005
# Markers' numbers; the bodies' follow from the last.
PATH_ID, PIVOTS_ID, JOINTS_ID, BODIES_ID = 0, 1, 2, 3
GREY, DARK, WHITE = '#8d99ae', '#404040', '#f0f0f0'


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
        The node.
    legs : sequence of DrivenLeg
        The legs.
    frame_id : str
        The plane of a leg, of its foot and velocity; a named leg's has its name
        before it.

    """

    def __init__(self, node: Node, legs: Sequence[DrivenLeg], frame_id: str) -> None:
        def publisher(kind: type, topic: str) -> Send:
            # What `publish` adds to it guards against a publisher that somebody else destroys.
            send: Send = create_publisher(node, kind, topic).handle.publish_raw
            return send

        self._send_joint_state = publisher(JointState, 'joint_states')
        # By the legs that are in it: one that cannot be solved is left out.
        self._joint_state: dict[tuple[str, ...], JointStateTemplate] = {}
        self._feet = {}
        for leg in legs:
            prefixed = leg.prefixed
            self._feet[leg.name] = _Foot(
                publisher(PointStamped, prefixed('point_h')),
                PointTemplate(prefixed(frame_id)),
                publisher(TwistStamped, prefixed('velocity_h')),
                TwistTemplate(prefixed(frame_id)),
            )

    def publish(self, answers: Sequence[Answer], stamp: Stamp) -> None:
        """
        Publish the angles of all answers in one JointState, and each leg's foot.

        Velocities are published where every answer has one.
        """
        positions = tuple(chain.from_iterable(pose.joints for _, pose, _ in answers))
        known = [velocity.joints for _, _, velocity in answers if velocity is not None]
        velocities = tuple(chain(*known)) if len(known) == len(answers) else ()
        self._send_joint_state(self._template(answers).fill(*stamp, positions, velocities))
        for leg, pose, velocity in answers:
            foot = self._feet[leg.name]
            foot.send_point(foot.point.fill(*stamp, *pose.h))
            if velocity is not None:
                foot.send_velocity(foot.velocity.fill(*stamp, *velocity.h))

    def _template(self, answers: Sequence[Answer]) -> JointStateTemplate:
        legs = tuple(leg.name for leg, _, _ in answers)
        template = self._joint_state.get(legs)
        if template is None:
            names = [name for leg, _, _ in answers for name in leg.joint_names]
            template = self._joint_state[legs] = JointStateTemplate(names)
        return template


class LegMarkers:
    """
    Publisher of the legs as markers.

    What stands still, pivots and foot paths, is published when somebody comes to look and when a
    leg changes; what moves after that, while somebody looks.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    legs : sequence of DrivenLeg
        The legs.
    frame_id : str
        The plane of a leg; a named leg's has its name before it.

    """

    def __init__(self, node: Node, legs: Sequence[DrivenLeg], frame_id: str) -> None:
        self._node, self._legs, self._frame_id = node, legs, frame_id
        self._drawn: list[LinkagePose | None] = []
        matched = PublisherEventCallbacks(matched=self._on_matched)
        self._publisher = create_publisher(
            node, MarkerArray, 'markers', LATCHED, event_callbacks=matched
        )
        self._timer = node.create_timer(MARKERS_PERIOD, self._on_timer, autostart=False)

    def legs_changed(self) -> None:
        """Draw everything again."""
        self._drawn = []

    def _on_matched(self, status: Any) -> None:
        if status.current_count:
            # Who comes last has heard of nothing that stands still.
            self.legs_changed()
            self._timer.reset()
        else:
            self._timer.cancel()

    def _on_timer(self) -> None:
        poses = [leg.last for leg in self._legs]
        if poses == self._drawn:
            return
        stamp = self._node.get_clock().now().to_msg()
        markers = MarkerArray()
        for i, leg in enumerate(self._legs):
            pose = poses[i]
            if not self._drawn:
                markers.markers += self._still(leg, stamp)
            if pose is not None and not (self._drawn and pose is self._drawn[i]):
                markers.markers += self._moving(leg, pose, stamp)
        self._drawn = poses
        self._publisher.publish(markers)

    def _still(self, leg: DrivenLeg, stamp: Time) -> list[Marker]:
        """Return the path of the foot, and the pivots."""
        try:
            path = foot_path(leg.leg)
            pose = leg.leg.closed_form(float(path.alphas[0]))
        except KinematicsError:
            # A leg that hardly closes anywhere is seen where it is solved.
            return []
        size = max(path.stride, path.lift)
        feet = path.h.tolist()
        line = self._marker(leg, PATH_ID, Marker.LINE_STRIP, PATH * size, GREY, stamp)
        line.points = _points([*feet, feet[0]] if path.full_turn else feet)
        drawn = PoseDrawing.of(pose)
        fixed = (drawn.points[name] for name in drawn.pivots)
        pivots = self._marker(leg, PIVOTS_ID, Marker.CUBE_LIST, PIVOT * size, DARK, stamp)
        pivots.points = _points(fixed)
        return [line, pivots]

    def _moving(self, leg: DrivenLeg, pose: LinkagePose, stamp: Time) -> list[Marker]:
        """Return the joints, and the bars of every body."""
        drawn = PoseDrawing.of(pose)
        places = list(drawn.points.values())
        size = max(float(max(p[k] for p in places) - min(p[k] for p in places)) for k in (0, 1))
        joints = self._marker(leg, JOINTS_ID, Marker.SPHERE_LIST, JOINT * size, WHITE, stamp)
        joints.points = _points(places)
        markers = [joints]
        for number, body in enumerate(drawn.bodies, start=BODIES_ID):
            bars = self._marker(leg, number, Marker.LINE_LIST, BAR * size, body.colour, stamp)
            bars.points = _points(drawn.points[name] for bar in body.strokes for name in bar)
            markers.append(bars)
        return markers

    def _marker(  # noqa: PLR0917 - as many as a marker has
        self, leg: DrivenLeg, number: int, kind: int, size: float, colour: str, stamp: Time
    ) -> Marker:
        marker = Marker(ns=leg.name or 'leg', id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = stamp
        marker.header.frame_id = leg.prefixed(self._frame_id)
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = size
        red, green, blue = (part / 255 for part in bytes.fromhex(colour[1:]))
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        return marker


def _points(places: Iterable[Any]) -> list[Point]:
    return [Point(x=float(x), y=float(y)) for x, y in places]
