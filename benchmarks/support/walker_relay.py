"""
A relay with the topics of walker_node, which computes nothing.

    python3 walker_relay.py lean | rclpy

In the project's own loop, of raw messages, or as rclpy has it, of typed ones.
"""

from contextlib import suppress
import sys
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.messages import JointsReader, JointStateTemplate
from klann_ros.nodes.endpoints import INPUT, OUTPUT
from klann_ros.nodes.process import run
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.nodes.walker.messages import odometry_template
from klann_ros.stop_signals import StopSignals
from nav_msgs.msg import Odometry
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

CRANKS = ['left_crank', 'right_crank']


class Relay(Node):  # type: ignore[misc] # Node is Any
    """Answer each crank_state with an odom and a crank_command, all of them zeros."""

    def __init__(self, *, raw: bool) -> None:
        """Make the messages once."""
        super().__init__('walker_relay')
        self._odom = self.create_publisher(Odometry, 'odom', OUTPUT)
        self._commands = self.create_publisher(JointState, 'crank_command', OUTPUT)
        options: dict[str, Any] = {'raw': True, 'callback_group': RawCallbackGroup()}
        for kind, topic, callback in (
            (JointState, 'crank_state', self._relay_raw if raw else self._relay),
            (Imu, 'imu', self._ignore),
            (TwistStamped, 'cmd_vel', self._ignore),
        ):
            self.create_subscription(kind, topic, callback, INPUT, **(options if raw else {}))
        self._reader = JointsReader(CRANKS[:1])
        self._odom_template = odometry_template('odom', 'base_link')
        self._command_template = JointStateTemplate(CRANKS)
        self._odom_message = Odometry()
        self._command_message = JointState(name=CRANKS, position=[0.0] * 2, velocity=[0.0] * 2)

    def _ignore(self, message: Any, info: Any) -> None:
        pass

    def _relay_raw(self, data: bytes, _: Any) -> None:
        reading = self._reader.read(data)[CRANKS[0]]
        stamp = reading.sec, reading.nanosec
        self._odom.publish(self._odom_template.fill(*stamp, *(0.0,) * 28))
        self._commands.publish(self._command_template.fill(*stamp, (0.0, 0.0), (0.0, 0.0)))

    def _relay(self, message: JointState, _: Any) -> None:
        self._odom_message.header.stamp = message.header.stamp
        self._command_message.header.stamp = message.header.stamp
        self._odom.publish(self._odom_message)
        self._commands.publish(self._command_message)


if __name__ == '__main__':
    if sys.argv[1] == 'lean':
        sys.exit(run('relay', lambda _: Relay(raw=True), [''], StopSignals(), raw=True))
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Relay(raw=False))
