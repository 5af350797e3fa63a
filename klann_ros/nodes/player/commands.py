"""Topics that command a robot, which a replay must not leave moving."""

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray

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
