"""Who sends cmd_vel while nobody else does: a robot that walks by itself."""

from collections.abc import Callable
from math import inf
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.endpoints import create_publisher
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

# Between two commands [s].
PERIOD = 0.1
# So long a walker is left to stand that has begun to listen: it learns its accelerometer [s].
STANDS = 2.0


class Driver:
    """
    Send the same cmd_vel again and again, and none as soon as somebody else does.

    Parameters
    ----------
    node : Node
        Whose it is.
    linear : float
        So fast it is to walk [m/s].
    now : callable
        Returns the robot's time [s].

    """

    def __init__(self, node: Node, linear: float, now: Callable[[], float]) -> None:
        self._node, self._now = node, now
        self._since = inf
        self._cranks = node.resolve_topic_name('crank_command')
        self._publisher: Any = create_publisher(node, TwistStamped, 'cmd_vel')
        # Without a stamp it is as old as its arrival.
        self._command = TwistStamped()
        self._command.twist.linear.x = linear
        node.create_timer(PERIOD, self._send, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _send(self) -> None:
        if not self._node.count_publishers(self._cranks):
            self._since = inf
            return
        # Its time begins anew where it is put back.
        self._since = min(self._since, self._now())
        has_stood = self._now() >= self._since + STANDS
        if has_stood and self._node.count_publishers(self._publisher.topic_name) == 1:
            self._publisher.publish(self._command)
