"""A node as a process: it takes crank angles, and its answers and its CPU time are measured."""

from operator import sub
import struct
import subprocess
import time
from typing import Any, NamedTuple

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


class Figures(NamedTuple):
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
        """Start it, and wait for its discovery."""
        self.process = subprocess.Popen(command)
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        node = rclpy.create_node('probe', context=self._context)
        self._node = node
        self._crank = node.create_publisher(Float64, 'crank_angle', OUTPUT)
        endpoints = []
        for kind, topic in OUTPUTS:
            endpoints.append(
                node.create_subscription(kind, topic, lambda _: None, OUTPUT, raw=True)
            )
        while not self._crank.get_subscription_count():
            time.sleep(0.05)
        while not all(endpoint.get_publisher_count() for endpoint in endpoints):
            time.sleep(0.05)
        time.sleep(0.7)
        self._handles = [endpoint.handle for endpoint in endpoints]
        self._wait_set = rclpy_implementation.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)
        # Times of reception [s], by outputs.
        self._received_times: list[list[float]] = [[], []]

    def measure(self, rate: float, seconds: float) -> Figures:
        """Turn the crank at a rate [Hz] for some time [s], then leave it at rest."""
        self._turn(rate, round(rate * WARM_UP))
        count = round(rate * seconds)
        first_cpu = self.cpu()
        sent_times = self._turn(rate, count)
        last_cpu = self.cpu()
        point_times = self._received_times[1]
        latencies = sorted(map(sub, point_times, sent_times)) or [float('nan')]
        first_idle_cpu = self.cpu()
        time.sleep(REST)
        return Figures(
            cpu=(last_cpu - first_cpu) / count * 1e6,
            p50=latencies[len(latencies) // 2] * 1e6,
            p99=latencies[min(len(latencies) - 1, int(0.99 * len(latencies)))] * 1e6,
            idle=(self.cpu() - first_idle_cpu) / REST * 100.0,
            lost=len(OUTPUTS) * count - sum(map(len, self._received_times)),
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
        """Publish a number of angles; return their times, and store the answers' times [s]."""
        for times in self._received_times:
            times.clear()
        sent_times = []
        start_time = time.perf_counter()
        for k in range(count):
            while (timeout := start_time + k / rate - time.perf_counter()) > 0:
                self._take(timeout)
            message = struct.pack('<4sd', b'\0\1\0\0', 0.01 * k)
            sent_times.append(time.perf_counter())
            self._crank.publish(message)
        deadline = time.perf_counter() + 2.0
        while min(map(len, self._received_times)) < count and time.perf_counter() < deadline:
            self._take(0.01)
        return sent_times

    def _take(self, timeout: float) -> None:
        self._wait_set.clear_entities()
        for handle in self._handles:
            self._wait_set.add_subscription(handle)
        self._wait_set.wait(max(0, round(timeout * 1e9)))
        for k, (kind, _) in enumerate(OUTPUTS):
            while _take_raw(self._handles[k], kind):
                self._received_times[k].append(time.perf_counter())


def _take_raw(handle: Any, kind: type) -> bool:
    return handle.take_message(kind, True) is not None  # raw
