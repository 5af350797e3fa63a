"""The legs as markers for RViz and Foxglove: bars, joints, and the paths of the feet."""

from collections.abc import Iterable, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from klann_ros.kinematics import foot_path, KinematicsError, LinkagePose
from klann_ros.nodes import qos_overrides
from klann_ros.plotting.drawn import Drawn
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from .solved_leg import SolvedLeg

# At most so often [s], and only while somebody looks.
PERIOD = 0.05
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


class LegMarkers:
    """
    Publisher of the legs as markers.

    What stands still, pivots and foot paths, is published when somebody comes to look and when a
    leg changes; what moves after that, while somebody looks.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.
    legs : sequence of SolvedLeg
        The legs.
    frame_id : str
        The plane of a leg; a named leg's has its name before it.

    """

    def __init__(self, node: Node, legs: Sequence[SolvedLeg], frame_id: str) -> None:
        """Publish nothing yet."""
        self._node, self._legs, self._frame_id = node, legs, frame_id
        self._drawn: list[LinkagePose | None] = []
        self._publisher = node.create_publisher(
            MarkerArray,
            'markers',
            qos_overrides.of_publisher(node, 'markers', LATCHED),
            event_callbacks=PublisherEventCallbacks(matched=self._on_matched),
        )
        self._timer = node.create_timer(PERIOD, self._on_timer, autostart=False)

    def legs_changed(self) -> None:
        """Draw everything anew."""
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

    def _still(self, leg: SolvedLeg, stamp: Time) -> list[Marker]:
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
        drawn = Drawn.of(pose)
        fixed = (drawn.points[name] for name in drawn.pivots)
        pivots = self._marker(leg, PIVOTS_ID, Marker.CUBE_LIST, PIVOT * size, DARK, stamp)
        pivots.points = _points(fixed)
        return [line, pivots]

    def _moving(self, leg: SolvedLeg, pose: LinkagePose, stamp: Time) -> list[Marker]:
        """Return the joints, and the bars of every body."""
        drawn = Drawn.of(pose)
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
        self, leg: SolvedLeg, number: int, kind: int, size: float, colour: str, stamp: Time
    ) -> Marker:
        marker = Marker(ns=leg.mounting.name or 'leg', id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = stamp
        marker.header.frame_id = leg.mounting.prefixed(self._frame_id)
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = size
        red, green, blue = (part / 255 for part in bytes.fromhex(colour[1:]))
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        return marker


def _points(places: Iterable[Any]) -> list[Point]:
    return [Point(x=float(x), y=float(y)) for x, y in places]
