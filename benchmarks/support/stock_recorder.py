"""A recorder as anybody would write one with rclpy: a node, raw subscriptions, the same writer."""

from collections.abc import Callable
import sys
from threading import Thread

from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.writer import RunWriter
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

FLUSH_PERIOD = 0.5


class StockRecorder(Node):  # type: ignore[misc] # Node is Any
    """Write every message in its callback, and flush by a timer."""

    def __init__(self, folder: str, topics: list[str]) -> None:
        """Subscribe to topics of joint states."""
        super().__init__('stock_recorder')
        self.writer = RunWriter(folder)
        for name in topics:
            self.create_subscription(
                JointState, name, self._writes(name), QoSProfile(depth=2000), raw=True
            )
        self.create_timer(FLUSH_PERIOD, self.writer.flush)

    def _writes(self, name: str) -> Callable[[bytes, dict[str, int]], None]:
        kind = 'sensor_msgs/msg/JointState'
        topic = Topic(name, kind, definition(kind))

        def write(data: bytes, info: dict[str, int]) -> None:
            self.writer.write(
                Message(
                    topic,
                    data,
                    info['received_timestamp'],
                    info['source_timestamp'],
                    info['publication_sequence_number'],
                )
            )

        return write


def main(folder: str, *topics: str) -> None:
    """Record until stdin ends."""
    rclpy.init()
    node = StockRecorder(folder, list(topics))

    def wait() -> None:
        sys.stdin.read()
        rclpy.shutdown()

    Thread(target=wait, daemon=True).start()
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        node.writer.close()


if __name__ == '__main__':
    main(*sys.argv[1:])
