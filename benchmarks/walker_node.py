"""
What a simulated walk costs: walker_node a core, odom after crank_state, sim_node in real time.

    python3 benchmarks/walker_node.py [--seconds S]

sim_node has one core to itself as far as the machine lets it; walker_node and the probe have the
others. Latencies are between the publication stamps of the middleware; the probe takes them
afterwards, for it would wake up together with walker_node.

Beside walker_node stand two relays that take and publish the same, and compute nothing: one in the
loop that it has, which is the least that it could cost, one in rclpy's own with typed messages.
"""

import argparse
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
import rclpy
from sensor_msgs.msg import JointState
from support.aims import exit_code, is_met, sized
from support.programs import command, cpu_of, end, support_command

WALKER = Path(__file__).resolve().parents[1] / 'config' / 'walker6_two_motors.yaml'
ROBOT_ARGUMENTS = ('--ros-args', '--params-file', WALKER, '-p')
# CPU by that of the relay with typed messages.
MAX_CPU_RATIO = 1.0
# Latency of odom in the median [s].
MAX_LATENCY = 1e-3
MIN_REAL_TIME_FACTOR = 0.99
WARM_UP = sized(0.2, 4.0)
# Depth of the queues.
DEPTH = 100_000
# Spins without a message after which the queues are taken for empty.
MAX_IDLE_SPINS = 20
# Seconds and nanoseconds.
Stamp = tuple[int, int]


class Cost(NamedTuple):
    """What a walk costs."""

    # CPU of the node under test and of sim_node, by a core.
    cpu: float
    sim_cpu: float
    # Part of the crank_state messages that were answered.
    answered: float
    # Percentiles of the latency of odom [s].
    p50: float
    p99: float
    real_time_factor: float


class Probe:
    """Records when crank_state and odom were published, and how the simulation keeps up."""

    def __init__(self) -> None:
        """Subscribe."""
        rclpy.init()
        self._node = rclpy.create_node('walker_probe')
        # Times of publication by the stamps [ns].
        self.crank_times: dict[Stamp, int] = {}
        self.odom_times: dict[Stamp, int] = {}
        self.real_time_factors: list[float] = []
        for kind, topic, callback in (
            (JointState, 'crank_state', self._recorder(self.crank_times)),
            (Odometry, 'odom', self._recorder(self.odom_times)),
            (DiagnosticArray, '/diagnostics', self._on_diagnostics),
        ):
            self._node.create_subscription(kind, topic, callback, DEPTH)

    def _recorder(self, times: dict[Stamp, int]) -> Any:
        def record(message: Any, info: Any) -> None:
            stamp = message.header.stamp
            times[stamp.sec, stamp.nanosec] = info['source_timestamp']

        return record

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            for figure in status.values:
                if figure.key == 'real_time_factor':
                    self.real_time_factors.append(float(figure.value))

    def take(self) -> None:
        """Take all messages that wait."""
        idle_spins = 0
        while idle_spins < MAX_IDLE_SPINS:
            count = self._count()
            rclpy.spin_once(self._node, timeout_sec=0.0)
            idle_spins = 0 if self._count() > count else idle_spins + 1

    def clear(self) -> None:
        """Forget all messages."""
        self.crank_times.clear()
        self.odom_times.clear()
        self.real_time_factors.clear()

    def _count(self) -> int:
        return len(self.crank_times) + len(self.odom_times) + len(self.real_time_factors)

    def latencies(self) -> list[float]:
        """Return the times from each crank_state to the odom that answers it, sorted [s]."""
        answered = self.crank_times.keys() & self.odom_times.keys()
        return sorted(
            (self.odom_times[stamp] - self.crank_times[stamp]) / 1e9 for stamp in answered
        )


class CpuMeter:
    """The CPU of a process, by a core, since the start of the meter."""

    def __init__(self, process: int) -> None:
        """Start."""
        self._process = process
        self._cpu_time = cpu_of(process)
        self._start_time = time.monotonic()

    def read(self) -> float:
        """Return the mean so far."""
        cpu_time = cpu_of(self._process) - self._cpu_time
        return cpu_time / (time.monotonic() - self._start_time)


def measure_walk(line: list[str], seconds: float) -> Cost:
    """Return what a node costs that walks a simulated walker."""
    sim = subprocess.Popen(command('sim_node', *ROBOT_ARGUMENTS, 'linear:=0.15'))
    walker = subprocess.Popen(line)
    cores = os.sched_getaffinity(0)
    if len(cores) > 1:
        os.sched_setaffinity(sim.pid, {max(cores)})
        os.sched_setaffinity(walker.pid, cores - {max(cores)})
    probe = Probe()
    try:
        while not probe.odom_times and sim.poll() is None and walker.poll() is None:
            time.sleep(0.5)
            probe.take()
        time.sleep(WARM_UP)
        probe.take()
        probe.clear()
        sim_meter, walker_meter = CpuMeter(sim.pid), CpuMeter(walker.pid)
        time.sleep(seconds)
        sim_cpu, walker_cpu = sim_meter.read(), walker_meter.read()
        probe.take()
        # The factor is reported once a second.
        while not (probe.real_time_factors and probe.latencies()) and sim.poll() is None:
            time.sleep(0.1)
            probe.take()
    finally:
        end(walker)
        end(sim)
        rclpy.shutdown()
    latencies = probe.latencies()
    return Cost(
        walker_cpu,
        sim_cpu,
        answered=len(latencies) / len(probe.crank_times),
        p50=latencies[len(latencies) // 2],
        p99=latencies[int(0.99 * len(latencies))],
        real_time_factor=median(probe.real_time_factors),
    )


def main() -> int:
    """Walk, print what it costs, and return whether the aims are met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=sized(0.3, 10.0))
    seconds = parser.parse_args().seconds
    walk = measure_walk(command('walker_node', *ROBOT_ARGUMENTS, 'use_imu:=true'), seconds)
    costs = {'walker_node': walk}
    for loop in sized(('rclpy',), ('lean', 'rclpy')):
        relay = measure_walk(support_command('walker_relay', loop), seconds)
        costs[f'a relay, {loop}'] = relay
    cpu_ratio = walk.cpu / costs['a relay, rclpy'].cpu
    slowdown = 1.0 / walk.real_time_factor
    met = (
        is_met('CPU of walker_node, of the relay with typed messages', cpu_ratio, MAX_CPU_RATIO),
        is_met('odom after crank_state, p50 [ms]', 1e3 * walk.p50, 1e3 * MAX_LATENCY),
        is_met('sim_node on one core, real time by its own', slowdown, 1.0 / MIN_REAL_TIME_FACTOR),
    )
    for name, cost in costs.items():
        print(
            f'{name}: {cost.answered:.0%} answered, {cost.cpu:.1%} of a core, '
            f'p50 {1e3 * cost.p50:.2f} ms, p99 {1e3 * cost.p99:.2f} ms; '
            f'sim_node {cost.sim_cpu:.0%}'
        )
    print(f'load {os.getloadavg()[0]:.1f}')
    return exit_code(*met)


if __name__ == '__main__':
    sys.exit(main())
