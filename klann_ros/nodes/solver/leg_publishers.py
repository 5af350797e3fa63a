"""Publishers of legs: answers as CDR, and markers for RViz and Foxglove."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped, TwistStamped
from klann_ros import kinematics
from klann_ros.kinematics import KinematicsError, LinkageMotion, LinkagePose
from klann_ros.log import leg_description, SolverParameters
from klann_ros.messages import JointStateTemplate, point_template, Template, twist_template
from klann_ros.nodes.endpoints import create_publisher, LATCHED
from klann_ros.nodes.parameters import plain
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from .crank_inputs import Stamp
from .declarations import DESCRIBED
from .driven_leg import DrivenLeg

Send = Callable[[bytes], None]
Answer = tuple[DrivenLeg, LinkagePose, LinkageMotion | None]
# Minimum period, while there are subscribers [s].
_MARKERS_PERIOD = 0.05
# Sizes of pivots, joints and bars, and of the path, relative to the leg's size.
_PIVOT_SIZE, _JOINT_SIZE, _BAR_SIZE, _PATH_SIZE = 0.035, 0.03, 0.018, 0.005
# Numbers of markers; the bodies' follow from the last.
_PATH_ID, _PIVOTS_ID, _JOINTS_ID, _BODIES_ID = range(4)
_GREY, _DARK, _WHITE = '#8d99ae', '#404040', '#f0f0f0'


class _Foot(NamedTuple):
    """The publishers of a leg's foot and its velocity, with their messages."""

    send_point: Send
    point: Template
    send_velocity: Send
    velocity: Template


class LegMessages:
    """Publishers of the legs' answers; `frame_id`, with a leg's prefix, is its plane."""

    def __init__(self, node: Node, legs: Sequence[DrivenLeg], frame_id: str) -> None:
        def publisher(kind: type, topic: str) -> Send:
            # `publish` would also guard against a publisher destroyed by another thread.
            send: Send = create_publisher(node, kind, topic).handle.publish_raw
            return send

        self._send_joint_state = publisher(JointState, 'joint_states')
        # The templates by the names of the solved legs in them.
        self._templates: dict[tuple[str, ...], JointStateTemplate] = {}
        self._feet = {}
        for leg in legs:
            self._feet[leg.name] = _Foot(
                publisher(PointStamped, f'{leg.prefix}point_h'),
                point_template(leg.prefix + frame_id),
                publisher(TwistStamped, f'{leg.prefix}velocity_h'),
                twist_template(leg.prefix + frame_id),
            )

    def publish(self, answers: Sequence[Answer], stamp: Stamp) -> None:
        """Publish one JointState and each leg's foot; velocities if every answer has one."""
        positions: list[float] = []
        velocities: list[float] = []
        for _, pose, motion in answers:
            positions += pose.joints
            if motion is not None:
                velocities += motion.joints
        if len(velocities) < len(positions):
            velocities = []
        self._send_joint_state(self._template_of(answers).fill(*stamp, positions, velocities))
        for leg, pose, motion in answers:
            foot = self._feet[leg.name]
            foot.send_point(foot.point.fill(*stamp, *pose.h))
            if motion is not None:
                foot.send_velocity(foot.velocity.fill(*stamp, *motion.h))

    def _template_of(self, answers: Sequence[Answer]) -> JointStateTemplate:
        legs = tuple(leg.name for leg, _, _ in answers)
        template = self._templates.get(legs)
        if template is None:
            names: list[str] = []
            for leg, _, _ in answers:
                names += leg.joint_names
            template = self._templates[legs] = JointStateTemplate(names)
        return template


def description_message(node: Node) -> String:
    """Return the present parameters of the legs as a parameter file."""
    parameters = {}
    for name, parameter in node.get_parameters_by_prefix('').items():
        if name.rpartition('.')[2] in DESCRIBED:
            parameters[name] = plain(parameter.value)
    solver = SolverParameters(node.get_fully_qualified_name(), 0, parameters)
    return String(data=leg_description(solver))


class LegMarkers:
    """Publisher of the legs as markers, while there are subscribers; fixed parts once for each."""

    def __init__(self, node: Node, legs: Sequence[DrivenLeg], frame_id: str) -> None:
        self._node, self._legs, self._frame_id = node, legs, frame_id
        self._drawn: list[LinkagePose | None] = []
        matched = PublisherEventCallbacks(matched=self._on_matched)
        self._publisher = create_publisher(
            node, MarkerArray, 'markers', LATCHED, event_callbacks=matched
        )
        self._timer = node.create_timer(_MARKERS_PERIOD, self._on_timer, autostart=False)

    def legs_changed(self) -> None:
        """Draw everything again."""
        self._drawn = []

    def _on_matched(self, status: Any) -> None:
        if status.current_count:
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
                markers.markers += self._fixed_parts(leg, stamp)
            if pose is not None and not (self._drawn and pose is self._drawn[i]):
                markers.markers += self._moving_parts(leg, pose, stamp)
        self._drawn = poses
        self._publisher.publish(markers)

    def _fixed_parts(self, leg: DrivenLeg, stamp: Time) -> list[Marker]:
        """Return the markers of a leg that stay: the path of its foot, and its pivots."""
        try:
            # Loaded for the first subscriber.
            path = kinematics.foot_path(leg.leg)
            pose = leg.leg.closed_form(float(path.alphas[0]))
        except KinematicsError:
            # A leg that hardly closes anywhere has no path.
            return []
        size = max(path.stride, path.lift)
        feet = path.h.tolist()
        line = self._make_marker(leg, _PATH_ID, Marker.LINE_STRIP, _PATH_SIZE * size, _GREY, stamp)
        line.points = _points([*feet, feet[0]] if path.full_turn else feet)
        drawing = kinematics.PoseDrawing.of(pose)
        pivots = self._make_marker(
            leg, _PIVOTS_ID, Marker.CUBE_LIST, _PIVOT_SIZE * size, _DARK, stamp
        )
        pivots.points = _points(drawing.points[name] for name in drawing.pivots)
        return [line, pivots]

    def _moving_parts(self, leg: DrivenLeg, pose: LinkagePose, stamp: Time) -> list[Marker]:
        """Return the markers of a pose: its joints, and the bars of each body."""
        drawing = kinematics.PoseDrawing.of(pose)
        points = list(drawing.points.values())
        x_values, y_values = zip(*points, strict=True)
        size = float(max(max(x_values) - min(x_values), max(y_values) - min(y_values)))
        diameter = _JOINT_SIZE * size
        width = _BAR_SIZE * size
        joints = self._make_marker(leg, _JOINTS_ID, Marker.SPHERE_LIST, diameter, _WHITE, stamp)
        joints.points = _points(points)
        markers = [joints]
        for number, body in enumerate(drawing.bodies, start=_BODIES_ID):
            bars = self._make_marker(leg, number, Marker.LINE_LIST, width, body.colour, stamp)
            bars.points = _points(drawing.points[name] for name in chain(*body.strokes))
            markers.append(bars)
        return markers

    def _make_marker(  # noqa: PLR0917 - a marker's fields
        self, leg: DrivenLeg, number: int, kind: int, size: float, colour: str, stamp: Time
    ) -> Marker:
        marker = Marker(ns=leg.name or 'leg', id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = stamp
        marker.header.frame_id = leg.prefix + self._frame_id
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = size
        red, green, blue = (byte / 255 for byte in bytes.fromhex(colour[1:]))
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        return marker


def _points(coordinates: Iterable[Any]) -> list[Point]:
    return [Point(x=float(x), y=float(y)) for x, y in coordinates]
