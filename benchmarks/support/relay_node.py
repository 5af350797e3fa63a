"""A plain rclpy relay: both messages for every crank angle, and nothing computed."""

from array import array
from contextlib import suppress

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from klann_ros.nodes.endpoints import INPUT, OUTPUT
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64


class Relay(Node):  # type: ignore[misc] # Node is Any
    """Publish what solver_node publishes, of what came in."""

    def __init__(self) -> None:
        """Make the messages once, as anybody would."""
        super().__init__('relay')
        self._joint_states = self.create_publisher(JointState, 'joint_states', OUTPUT)
        self._point_h = self.create_publisher(PointStamped, 'point_h', OUTPUT)
        self._state = JointState(name=['alpha', 'gamma', 'beta', 'delta', 'theta'])
        self._point = PointStamped()
        self._point.header.frame_id = 'leg_plane'
        self.create_subscription(Float64, 'crank_angle', self._relay, INPUT)

    def _relay(self, message: Float64, info: dict[str, int]) -> None:
        seconds, nanoseconds = divmod(info['source_timestamp'], 10**9)
        stamp, alpha = Time(sec=seconds, nanosec=nanoseconds), message.data
        self._state.header.stamp = stamp
        self._state.position = array('d', [alpha] * 5)
        self._joint_states.publish(self._state)
        self._point.header.stamp = stamp
        self._point.point.x = self._point.point.y = alpha
        self._point_h.publish(self._point)


if __name__ == '__main__':
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Relay())
