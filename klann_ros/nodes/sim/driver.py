"""The demo's own cmd_vel: sent while no other node sends one."""

from collections.abc import Callable
from math import inf
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.endpoints import create_publisher
from klann_ros.nodes.lease import leased_topic, LeaseListener
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

# Between two commands [s].
COMMAND_PERIOD = 0.1
# A walker stands for this time first: it learns the bias of its accelerometer [s].
STANDS = 2.0


class Driver:
    """
    Repeat one cmd_vel; send none while another node publishes it, or holds its lease.

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
        self._lease: LeaseListener | None = None
        if leased_topic(self._publisher.topic_name):
            self._lease = LeaseListener(node, self._publisher.topic_name, self._on_lease)
        # Without a stamp it is as old as its arrival.
        self._command = TwistStamped()
        self._command.twist.linear.x = linear
        node.create_timer(
            COMMAND_PERIOD, self._send, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _send(self) -> None:
        if not self._node.count_publishers(self._cranks):
            self._since = inf
            return
        # Its time starts again at a reset.
        self._since = min(self._since, self._now())
        has_stood = self._now() >= self._since + STANDS
        if has_stood and not (self._lease and self._lease.holder) and not self._others():
            self._publisher.publish(self._command)

    def _others(self) -> bool:
        """Return whether another node publishes cmd_vel, but for a driver that has left."""
        topic = self._publisher.topic_name
        if self._node.count_publishers(topic) == 1:
            return False
        # A driver that was killed is known to the middleware for 20 s more.
        gone = self._lease.last_holder if self._lease else ''
        own = self._node.get_fully_qualified_name()
        infos = self._node.get_publishers_info_by_topic(topic)
        names = {f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in infos}
        return bool(names - {own, gone})

    def _on_lease(self, driver: str) -> None:
        said = f'yields to {driver}, which drives it' if driver else 'resumes: the driver has left'
        self._node.get_logger().info(f'{self._publisher.topic_name}: {said}')
