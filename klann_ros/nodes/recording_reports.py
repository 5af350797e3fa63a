"""The diagnostics of a recording, at a steady rate."""

from collections import deque
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import serialize_message

from .qos import OUTPUT
from .recording_status import RecordingState, status

PERIOD = 1.0


class RecordingReports:
    """
    Publisher of a recording's diagnostics, which are not a part of what it records.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.
    state : callable
        Returns how the recording stands.

    Attributes
    ----------
    topic : str
        Where they are published.

    """

    def __init__(self, node: Node, state: Callable[[], RecordingState]) -> None:
        """Start the timer."""
        self._node, self._state = node, state
        self._lost = 0
        self._told: deque[bytes] = deque(maxlen=10)
        overridable = QoSOverridingOptions.with_default_policies()
        self._publisher = node.create_publisher(
            DiagnosticArray, '/diagnostics', OUTPUT, qos_overriding_options=overridable
        )
        self.topic = self._publisher.topic_name
        node.create_timer(PERIOD, self.report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def report(self) -> None:
        """Publish a status."""
        state = self._state()
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status.append(status(f'{self._node.get_name()}: recording', state, self._lost))
        data = serialize_message(array)
        self._told.append(data)
        self._publisher.publish(data)
        self._lost = state.lost

    def has_told(self, data: bytes) -> bool:
        """Return whether a message is one of these."""
        return data in self._told
