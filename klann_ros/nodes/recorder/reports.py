"""The diagnostics of a recording, at a steady rate."""

from collections import deque
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from klann_ros.log.writing.recording import RecordingState
from klann_ros.nodes import qos_overrides
from klann_ros.nodes.qos import OUTPUT
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import serialize_message

from .status import status

PERIOD = 1.0
# What is under way at the end is waited for at most so long [s].
LAST_WORDS = 1.0


class RecordingReports:
    """
    Publisher of a recording's diagnostics, which are not a part of what it records.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.

    Attributes
    ----------
    topic : str
        Where they are published.

    """

    def __init__(self, node: Node) -> None:
        """Publish nothing yet."""
        self._node = node
        self._lost = 0
        self._told: deque[bytes] = deque(maxlen=10)
        profile = qos_overrides.of_publisher(node, '/diagnostics', OUTPUT)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', profile)
        self.topic = self._publisher.topic_name

    def start(self, state: Callable[[], RecordingState]) -> None:
        """Tell once a second what is returned here."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._node.create_timer(PERIOD, lambda: self.report(state()), clock=clock)

    def report(self, state: RecordingState) -> None:
        """Tell how a recording stands."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status.append(status(f'{self._node.get_name()}: recording', state, self._lost))
        data = serialize_message(array)
        self._told.append(data)
        self._publisher.publish(data)
        self._lost = state.lost

    def flush(self) -> None:
        """Wait until the last report has arrived, but not for ever."""
        self._publisher.wait_for_all_acked(Duration(seconds=LAST_WORDS))

    def has_told(self, data: bytes) -> bool:
        """Return whether a message is one of these."""
        return data in self._told
