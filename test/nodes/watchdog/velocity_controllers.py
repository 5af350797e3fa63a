"""
The controllers of ros2_control.launch.py, as a process that repeats the last command for ever.

As velocity_controllers/JointGroupVelocityController and joint_state_topic_hardware_interface do
(Jazzy): nothing before the first command; then every 10 ms the last one, with the present time;
numbers that are not finite, or of another count than the joints, are dropped.
"""

from contextlib import suppress
from math import isfinite

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

JOINTS = ['left_crank', 'right_crank']


class VelocityControllers(Node):
    """Repeat the last command, and republish the last angles."""

    def __init__(self) -> None:
        super().__init__('controller_manager')
        self._command: list[float] = []
        self._state = JointState()
        commands = 'crank_velocity_controller/commands'
        states = 'joint_state_broadcaster/joint_states'
        self._hardware = self.create_publisher(JointState, 'crank_command', 1)
        self._states = self.create_publisher(JointState, states, 10)
        self.create_subscription(Float64MultiArray, commands, self._on_command, 10)
        self.create_subscription(JointState, 'crank_state', self._on_state, 10)
        self.create_timer(0.01, self._update)

    def _on_command(self, message: Float64MultiArray) -> None:
        if len(message.data) == len(JOINTS) and all(map(isfinite, message.data)):
            self._command = list(message.data)

    def _on_state(self, message: JointState) -> None:
        self._state = message

    def _update(self) -> None:
        now = self.get_clock().now().to_msg()
        self._state.header.stamp = now
        if self._state.name:
            self._states.publish(self._state)
        if self._command:
            message = JointState(name=JOINTS, velocity=self._command)
            message.header.stamp = now
            self._hardware.publish(message)


rclpy.init()
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(VelocityControllers())
