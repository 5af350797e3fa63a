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
GIVEN = ('--ros-args', '--params-file', WALKER, '-p')
# The aims: CPU as a part of the relay's with typed messages, of a second, and of real time.
MOST_CPU, MOST_LATENCY, LEAST_FACTOR = 1.0, 1e-3, 0.99
WARM_UP = sized(0.2, 4.0)
# What may wait to be taken, and how often nothing is found before nothing is there.
DEPTH, IDLE = 100_000, 20


class Cost(NamedTuple):
    """Parts of a core, and of crank_state that was answered; latency [s]; real-time factor."""

    cpu: float
    sim: float
    answered: float
    p50: float
    p99: float
    factor: float


class Probe:
    """Hears when crank_state and odom were published, and how the simulation keeps up."""

    def __init__(self) -> None:
        """Listen."""
        rclpy.init()
        self._node = rclpy.create_node('walker_probe')
        # By stamp: when it was published [ns].
        self.cranks: dict[tuple[int, int], int] = {}
        self.odom: dict[tuple[int, int], int] = {}
        self.factors: list[float] = []
        self._node.create_subscription(JointState, 'crank_state', self._keep(self.cranks), DEPTH)
        self._node.create_subscription(Odometry, 'odom', self._keep(self.odom), DEPTH)
        self._node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, DEPTH
        )

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

    def take(self) -> None:
        """Take all that waits."""
        idle = 0
        while idle < IDLE:
            before = self._count()
            rclpy.spin_once(self._node, timeout_sec=0.0)
            idle = 0 if self._count() > before else idle + 1

    def forget(self) -> None:
        """Forget all that was heard."""
        for heard in (self.cranks, self.odom, self.factors):
            heard.clear()

    def _count(self) -> int:
        return len(self.cranks) + len(self.odom) + len(self.factors)

    def latencies(self) -> list[float]:
        """Return by how much odom was later than the crank_state that it answers [s]."""
        both = self.cranks.keys() & self.odom.keys()
        return sorted((self.odom[stamp] - self.cranks[stamp]) / 1e9 for stamp in both)


def cost(line: list[str], seconds: float) -> Cost:
    """Return what a node costs that walks a simulated walker."""
    sim = subprocess.Popen(command('sim_node', *GIVEN, 'linear:=0.15'))
    walker = subprocess.Popen(line)
    cores = os.sched_getaffinity(0)
    if len(cores) > 1:
        os.sched_setaffinity(sim.pid, {max(cores)})
        os.sched_setaffinity(walker.pid, cores - {max(cores)})
    probe = Probe()
    try:
        while not probe.odom and sim.poll() is None and walker.poll() is None:
            time.sleep(0.5)
            probe.take()
        time.sleep(WARM_UP)
        probe.take()
        probe.forget()
        before = [(cpu_of(each.pid), time.monotonic()) for each in (sim, walker)]
        time.sleep(seconds)
        after = [(cpu_of(each.pid), time.monotonic()) for each in (sim, walker)]
        probe.take()
        # The factor is reported once a second.
        while not (probe.factors and probe.latencies()) and sim.poll() is None:
            time.sleep(0.1)
            probe.take()
    finally:
        for each in (walker, sim):
            end(each)
        rclpy.shutdown()
    of_sim, of_walker = (
        (b - a) / (end - begin) for (a, begin), (b, end) in zip(before, after, strict=True)
    )
    late = probe.latencies()
    p50, p99 = late[len(late) // 2], late[int(0.99 * len(late))]
    answered = len(late) / len(probe.cranks)
    return Cost(of_walker, of_sim, answered, p50, p99, median(probe.factors))


def main() -> int:
    """Walk, print what it costs, and return whether the aims are met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=sized(0.3, 10.0))
    seconds = parser.parse_args().seconds
    walk = cost(command('walker_node', *GIVEN, 'use_imu:=true'), seconds)
    costs = {'walker_node': walk}
    for loop in sized(('rclpy',), ('lean', 'rclpy')):
        costs[f'a relay, {loop}'] = cost(support_command('walker_relay', loop), seconds)
    part = walk.cpu / costs['a relay, rclpy'].cpu
    aims = (
        ('CPU of walker_node, of the relay with typed messages', part, MOST_CPU),
        ('odom after crank_state, p50 [ms]', 1e3 * walk.p50, 1e3 * MOST_LATENCY),
        ('sim_node on one core, real time by its own', 1.0 / walk.factor, 1.0 / LEAST_FACTOR),
    )
    met = [is_met(*each) for each in aims]
    for name, its in costs.items():
        print(
            f'{name}: {its.answered:.0%} answered, {its.cpu:.1%} of a core, '
            f'p50 {1e3 * its.p50:.2f} ms, p99 {1e3 * its.p99:.2f} ms; sim_node {its.sim:.0%}'
        )
    print(f'load {os.getloadavg()[0]:.1f}')
    return exit_code(*met)


if __name__ == '__main__':
    sys.exit(main())
