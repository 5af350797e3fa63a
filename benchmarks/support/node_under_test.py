"""A node as a process: cranks go in, answers come out, and what it costs is read from outside."""

from dataclasses import dataclass
import struct
import subprocess
import time
from typing import Any

from geometry_msgs.msg import PointStamped
from klann_ros.nodes.endpoints import OUTPUT
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from .aims import REST
from .programs import command, cpu_of, end, support_command

RELAY, SOLVER = support_command('relay_node'), command('solver_node')
WARM_UP = REST / 4.0
OUTPUTS = ((JointState, 'joint_states'), (PointStamped, 'point_h'))


@dataclass(frozen=True)
class Figures:
    """CPU a message [us], latency of point_h [us], idle CPU [%] and lost answers."""

    cpu: float
    p50: float
    p99: float
    idle: float
    lost: int


class NodeUnderTest:
    """
    A process that answers crank angles, and the probe that asks it.

    Parameters
    ----------
    command : list of str
        How to start it.

    """

    def __init__(self, command: list[str]) -> None:
        """Start it, and wait until it is found."""
        self.process = subprocess.Popen(command)
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        node = rclpy.create_node('probe', context=self._context)
        self._node = node
        self._crank = node.create_publisher(Float64, 'crank_angle', OUTPUT)
        outputs = [
            node.create_subscription(kind, topic, lambda _: None, OUTPUT, raw=True)
            for kind, topic in OUTPUTS
        ]
        while self._crank.get_subscription_count() < 1 or any(
            output.get_publisher_count() < 1 for output in outputs
        ):
            time.sleep(0.05)
        time.sleep(0.7)
        self._handles = [output.handle for output in outputs]
        self._wait_set = rclpy_implementation.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)
        self._received: list[list[float]] = [[], []]

    def measure(self, rate: float, seconds: float) -> Figures:
        """Turn the crank at a rate [Hz] for some time [s], then leave it at rest."""
        self._turn(rate, round(rate * WARM_UP))
        before, count = self.cpu(), round(rate * seconds)
        sent = self._turn(rate, count)
        spent = self.cpu() - before
        points = self._received[1]
        latencies = sorted(b - a for a, b in zip(sent, points, strict=False)) or [float('nan')]
        before = self.cpu()
        time.sleep(REST)
        return Figures(
            cpu=spent / count * 1e6,
            p50=latencies[len(latencies) // 2] * 1e6,
            p99=latencies[min(len(latencies) - 1, int(0.99 * len(latencies)))] * 1e6,
            idle=(self.cpu() - before) / REST * 100.0,
            lost=sum(count - len(received) for received in self._received),
        )

    def cpu(self) -> float:
        """Return the time that all its threads have run [s]."""
        return cpu_of(self.process.pid)

    def stop(self) -> None:
        """End it."""
        end(self.process)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _turn(self, rate: float, count: int) -> list[float]:
        """Publish a number of angles; return their times, and store those of the answers [s]."""
        for received in self._received:
            received.clear()
        sent = []
        begin = time.perf_counter()
        for k in range(count):
            while (left := begin + k / rate - time.perf_counter()) > 0:
                self._take(left)
            data = struct.pack('<4sd', b'\0\1\0\0', 0.01 * k)
            sent.append(time.perf_counter())
            self._crank.publish(data)
        end = time.perf_counter() + 2.0
        while min(map(len, self._received)) < count and time.perf_counter() < end:
            self._take(0.01)
        return sent

    def _take(self, timeout: float) -> None:
        self._wait_set.clear_entities()
        for handle in self._handles:
            self._wait_set.add_subscription(handle)
        self._wait_set.wait(max(0, round(timeout * 1e9)))
        for handle, (kind, _), received in zip(
            self._handles, OUTPUTS, self._received, strict=True
        ):
            while _taken(handle, kind):
                received.append(time.perf_counter())


def _taken(handle: Any, kind: type) -> bool:
    return handle.take_message(kind, True) is not None  # raw
