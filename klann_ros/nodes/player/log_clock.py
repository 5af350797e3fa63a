"""Simulated time: the time of the log that is played, on /clock."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage

# Nodes listen there whatever their namespace is.
TOPIC = '/clock'
# A message cannot hold later times [ns].
LATEST = 2**31 * 10**9 - 1


class LogClock:
    """
    Publish a time all the while, also before the first message and while it stands still.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose publisher and timer they are.
    rate : float
        How often a second of real time.
    time : callable
        Returns the time [ns].

    """

    def __init__(self, node: Node, rate: float, time: Callable[[], int]) -> None:
        """Begin."""
        self._time = time
        self._publisher = node.create_publisher(ClockMessage, TOPIC, QoSProfile(depth=10))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(1.0 / rate, self.tell, clock=steady)

    def tell(self) -> None:
        """Publish it now."""
        message = ClockMessage()
        time = min(self._time(), LATEST)
        message.clock.sec, message.clock.nanosec = divmod(time, 10**9)
        self._publisher.publish(message)
