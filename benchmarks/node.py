"""
What an answer costs: solver_node against a plain rclpy relay that computes nothing.

Both publish a JointState and a PointStamped for every crank angle. They run in turn, several
times, each as a process of its own; what counts is the ratio within a round. So do solver_node
with Jansen's leg and with the Klann leg.
"""

from statistics import median
import sys

from klann_ros.kinematics.linkage.file import SHIPPED
from support.aims import exit_code, is_met, sized
from support.node_under_test import Figures, NodeUnderTest, RELAY, SOLVER

ROUNDS, SECONDS = sized(1, 3, 5), sized(0.2, 2.0, 3.0)
RATES = sized((200.0,), (1000.0,), (200.0, 1000.0))
# The aims: CPU a message, and latencies, as parts of the relay's.
MOST_CPU, MOST_LATENCY = 0.5, 1.0
# Jansen's CPU a message as a part of Klann's.
MOST_OF_KLANN = 1.15


def measured(command: list[str], rate: float) -> Figures:
    """Start a node, measure it, end it."""
    node = NodeUnderTest(command)
    try:
        return node.measure(rate, SECONDS)
    finally:
        node.stop()


def rounds_of(one: list[str], other: list[str], rate: float) -> list[tuple[Figures, Figures]]:
    """Measure two nodes in turn, and which is first in turn as well."""
    rounds = []
    for k in range(ROUNDS):
        both = [(one, 0), (other, 1)][:: 1 if k % 2 == 0 else -1]
        figures = {which: measured(command, rate) for command, which in both}
        rounds.append((figures[0], figures[1]))
    return rounds


def compare(rate: float) -> bool:
    """Print the figures at a rate; return whether the aims are met."""
    rounds = rounds_of(RELAY, SOLVER, rate)
    print(f'{rate:g} Hz, {ROUNDS} rounds in turn of {SECONDS:g} s')
    print(f'{"":12} {"CPU/us":>8} {"p50/us":>8} {"p99/us":>8} {"idle/%":>7} {"lost":>5}')
    for name, which in (('relay', 0), ('solver_node', 1)):
        cpu, p50, p99, idle = (
            median(getattr(both[which], word) for both in rounds)
            for word in ('cpu', 'p50', 'p99', 'idle')
        )
        lost = sum(both[which].lost for both in rounds)
        print(f'{name:12} {cpu:8.1f} {p50:8.0f} {p99:8.0f} {idle:7.2f} {lost:5}')
    met = not any(solver.lost for _, solver in rounds)
    for word, most in (('cpu', MOST_CPU), ('p50', MOST_LATENCY), ('p99', MOST_LATENCY)):
        ratio = median(getattr(solver, word) / getattr(relay, word) for relay, solver in rounds)
        met &= is_met(word, ratio, most)
    print()
    return met


def linkages(rate: float) -> bool:
    """Print what Jansen's leg costs beside the Klann leg; return whether the aim is met."""
    jansen = [*SOLVER, '--ros-args', '-p', f'linkage:={SHIPPED / "jansen.yaml"}']
    rounds = rounds_of(SOLVER, jansen, rate)
    own = median(figures.cpu for _, figures in rounds)
    ratio = median(figures.cpu / klann.cpu for klann, figures in rounds)
    print(f'Jansen at {rate:g} Hz: {own:.1f} us CPU a message')
    met = is_met('cpu of Klann', ratio, MOST_OF_KLANN)
    return met and not any(figures.lost for _, figures in rounds)


if __name__ == '__main__':
    met = [*(compare(rate) for rate in RATES), linkages(RATES[-1])]
    sys.exit(exit_code(*met))
