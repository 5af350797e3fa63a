"""Who sends cmd_vel while nobody else does: a robot that walks at once."""

from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.endpoints import create_publisher
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

# Between two commands [s].
PERIOD = 0.1


class Driver:
    """
    Send the same cmd_vel again and again, and none as soon as somebody else does.

    Parameters
    ----------
    node : Node
        Whose it is.
    linear : float
        So fast it is to walk [m/s].

    """

    def __init__(self, node: Node, linear: float) -> None:
        self._node = node
        self._publisher: Any = create_publisher(node, TwistStamped, 'cmd_vel')
        # Without a stamp it is as old as its arrival.
        self._command = TwistStamped()
        self._command.twist.linear.x = linear
        node.create_timer(PERIOD, self._send, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _send(self) -> None:
        if self._node.count_publishers(self._publisher.topic_name) == 1:
            self._publisher.publish(self._command)
