"""The diagnostics of a walker, at a steady rate."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from klann_ros.nodes.endpoints import create_publisher
from klann_ros.walker import DiagnosticLevel, Walker
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_LEVELS = {
    DiagnosticLevel.OK: DiagnosticStatus.OK,
    DiagnosticLevel.WARN: DiagnosticStatus.WARN,
    DiagnosticLevel.ERROR: DiagnosticStatus.ERROR,
}


class WalkerDiagnostics:
    """
    Publisher of a walker's diagnostics.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    walker : Walker
        Whose they are.
    now : callable
        Returns the time by which it is controlled [s].
    period : float
        Time between diagnostics [s].

    """

    def __init__(
        self, node: Node, walker: Walker, now: Callable[[], float], *, period: float
    ) -> None:
        self._node, self._walker, self._now = node, walker, now
        self._publisher = create_publisher(node, DiagnosticArray, '/diagnostics')
        # Also where simulated time stands still.
        node.create_timer(period, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _report(self) -> None:
        now = self._now()
        level, message = self._walker.verdict(now)
        name = f'{self._node.get_name()}: walker'
        status = DiagnosticStatus(
            level=_LEVELS[level],
            name=name,
            message=message,
            hardware_id=name,
            values=[
                KeyValue(key=key, value=value) for key, value in self._walker.values(now).items()
            ],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
