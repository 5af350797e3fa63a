"""
What a simulated walk costs: walker_node a core, odom after crank_state, sim_node in real time.

    python3 benchmarks/walker_node.py [--seconds S]

sim_node has one core to itself as far as the machine lets it; walker_node and the probe have the
others. Latencies are between the middleware's stamps of what was published.
"""

import argparse
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
import rclpy
from sensor_msgs.msg import JointState
from support.node_under_test import cpu_of

WALKER = Path(__file__).resolve().parents[1] / 'config' / 'walker6_two_motors.yaml'
GIVEN = ('--ros-args', '--params-file', str(WALKER))
# The aims: of a core, of a second, and of real time.
MOST_CPU, MOST_LATENCY, LEAST_FACTOR = 0.05, 1e-3, 0.99
WARM_UP = 4.0


def started(name: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Start one of our nodes."""
    code = f'import sys; from klann_ros.executables import {name} as main; sys.exit(main())'
    return subprocess.Popen([sys.executable, '-c', code, *arguments])


class Probe:
    """Hears when crank_state and odom were published, and how the simulation keeps up."""

    def __init__(self) -> None:
        """Listen."""
        rclpy.init()
        self.node = rclpy.create_node('walker_probe')
        # By stamp: when it was published [ns].
        self.cranks: dict[tuple[int, int], int] = {}
        self.odom: dict[tuple[int, int], int] = {}
        self.factors: list[float] = []
        self.node.create_subscription(JointState, 'crank_state', self._keep(self.cranks), 100)
        self.node.create_subscription(Odometry, 'odom', self._keep(self.odom), 100)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def _keep(self, times: dict[tuple[int, int], int]) -> Any:
        def heard(message: Any, info: Any) -> None:
            stamp = message.header.stamp
            times[stamp.sec, stamp.nanosec] = info['source_timestamp']

        return heard

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {each.key: each.value for each in status.values}
            if 'real_time_factor' in values:
                self.factors.append(float(values['real_time_factor']))

    def spin(self, seconds: float) -> None:
        """Listen for so long [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def latencies(self) -> list[float]:
        """Return by how much odom was later than the crank_state that it answers [s]."""
        both = self.cranks.keys() & self.odom.keys()
        return sorted((self.odom[stamp] - self.cranks[stamp]) / 1e9 for stamp in both)


def main() -> int:
    """Walk, print what it costs, and return whether the aims are met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=10.0)
    seconds = parser.parse_args().seconds
    sim = started('sim_node', *GIVEN, '-p', 'linear:=0.15')
    walker = started('walker_node', *GIVEN, '-p', 'use_imu:=true')
    cores = os.sched_getaffinity(0)
    if len(cores) > 1:
        os.sched_setaffinity(sim.pid, {max(cores)})
        os.sched_setaffinity(walker.pid, cores - {max(cores)})
    probe = Probe()
    try:
        while not probe.odom and sim.poll() is None and walker.poll() is None:
            probe.spin(0.5)
        probe.spin(WARM_UP)
        for heard in (probe.cranks, probe.odom, probe.factors):
            heard.clear()
        before = [(cpu_of(node.pid), time.monotonic()) for node in (sim, walker)]
        probe.spin(seconds)
        after = [(cpu_of(node.pid), time.monotonic()) for node in (sim, walker)]
    finally:
        for node in (walker, sim):
            node.terminate()
            node.wait()
        rclpy.shutdown()
    of_sim, of_walker = (
        (b - a) / (end - begin) for (a, begin), (b, end) in zip(before, after, strict=True)
    )
    late = probe.latencies()
    p50, p99 = late[len(late) // 2], late[int(0.99 * len(late))]
    factor = median(probe.factors)
    print(f'{len(probe.odom) / seconds:.0f} odom a second, load {os.getloadavg()[0]:.1f}')
    aims = (
        ('walker_node, of a core', of_walker, MOST_CPU),
        ('odom after crank_state, p50 [ms]', 1e3 * p50, 1e3 * MOST_LATENCY),
        ('sim_node on one core, real time by its own', 1.0 / factor, 1.0 / LEAST_FACTOR),
    )
    for what, is_so, most in aims:
        print(f'{what}: {is_so:.3g}, aim <= {most:.3g}: {"met" if is_so <= most else "MISSED"}')
    print(f'p99 {1e3 * p99:.2f} ms; sim_node takes {of_sim:.0%} of its core')
    return 0 if all(is_so <= most for _, is_so, most in aims) else 1


if __name__ == '__main__':
    sys.exit(main())
