"""The output crank_command in each of its types, and the standstill of a robot."""

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from klann_ros.messages import JointStateTemplate
from klann_ros.walker import CrankCommand, CrankDrives
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray

from .endpoints import create_publisher, publish_last
from .parameters import Declaration

# The types that hold velocities alone, as for ros2_control.
_VELOCITY_ARRAYS = {'velocities': Float64MultiArray, 'velocities_float32': Float32MultiArray}
COMMAND_TYPE = Declaration(
    'command_type',
    'joint_state',
    'sensor_msgs/JointState, or std_msgs/Float64MultiArray or Float32MultiArray',
    choices=('joint_state', *_VELOCITY_ARRAYS),
)

# Types of the rates of cranks, by the last part of a topic's name; `commands` is ros2_control's.
_RATES = {
    'crank_command': (JointState, Float64MultiArray, Float32MultiArray),
    'commands': (Float64MultiArray,),
}


def standstill(topic: str, kind: type, data: bytes) -> Any:
    """Return the last message of a topic with rates of 0; None if it commands no robot."""
    name = topic.rpartition('/')[2]
    if name == 'cmd_vel' and kind in {Twist, TwistStamped}:
        # Without a stamp it is as old as its arrival.
        return kind()
    if kind not in _RATES.get(name, ()):
        return None
    try:
        command = deserialize_message(data, kind)
    # A log may hold any bytes, which no robot took for a command.
    except (RuntimeError, ValueError):
        return None
    if kind is JointState:
        command.velocity = [0.0] * len(command.name)
        command.effort = []
    else:
        command.data = [0.0] * len(command.data)
    return command


class CrankOutput:
    """Publisher of crank_command, in the units of the motors of `drives`."""

    def __init__(self, node: Node, drives: CrankDrives, command_type: str) -> None:
        self._drives = drives
        self._array: Any = _VELOCITY_ARRAYS.get(command_type)
        self._template = JointStateTemplate([*drives.drives])
        self._publisher = create_publisher(node, self._array or JointState, 'crank_command')
        # Whether the last command, if there is one, lets a crank turn.
        self.is_turning = False
        self._has_commanded = False

    def publish(self, command: CrankCommand, sec: int, nanosec: int) -> None:
        """Publish a command."""
        self._has_commanded = True
        self.is_turning = any(command.velocity)
        self._publisher.publish(self._message(command, sec, nanosec))

    def end(self, standstill: CrankCommand, sec: int, nanosec: int) -> None:
        """Publish the last command, unless there was none before."""
        if self._has_commanded:
            publish_last(self._publisher, self._message(standstill, sec, nanosec))
        self._has_commanded = self.is_turning = False

    def _message(self, command: CrankCommand, sec: int, nanosec: int) -> Any:
        motor_command = self._drives.commanded(command)
        if self._array is not None:
            return self._array(data=list(motor_command.velocity))
        positions, velocities = motor_command
        return self._template.fill(sec, nanosec, positions, velocities)
