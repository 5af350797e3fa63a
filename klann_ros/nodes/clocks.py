"""The clocks of robots: control time, which nobody sets, and the age of messages."""

import time

from rclpy.node import Node

from .raw_executor import Info


def steady_time() -> float:
    """Return the time of a clock that runs while the machine is suspended as well [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def transport_age(info: Info) -> float | None:
    """Return the age of a message since it was sent [s]; None if unknown."""
    sending_time: int = info['source_timestamp']
    return (time.time_ns() - sending_time) / 1e9 if sending_time else None


class ControlClock:
    """
    The clock of a robot: simulated time, or a clock that is never set.

    Simulated time may stand still, and the machine's may be set; cranks need neither.
    """

    def __init__(self, node: Node) -> None:
        self.is_simulated = bool(node.get_parameter('use_sim_time').value)
        self._ros_clock = node.get_clock()

    def now(self) -> float:
        """Return the control time [s]."""
        return self._ros_clock.now().nanoseconds / 1e9 if self.is_simulated else steady_time()

    def stamp(self) -> tuple[int, int]:
        """Return a stamp of now: seconds and nanoseconds."""
        # rclpy's clock of the machine's time costs ten times as much.
        stamp = self._ros_clock.now().nanoseconds if self.is_simulated else time.time_ns()
        seconds, nanoseconds = divmod(stamp, 10**9)
        return seconds, nanoseconds

    def age(self, sec: int, nanosec: int) -> float:
        """Return the age of a stamp [s]."""
        now = self.now() if self.is_simulated else time.time()
        return now - sec - nanosec / 1e9

    def sending_time(self, info: Info) -> float:
        """Return the time of sending [s]; 0 in a simulation, whose time it is not."""
        return 0.0 if self.is_simulated else float(info['source_timestamp'] / 1e9)
