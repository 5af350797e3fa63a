"""
The cost of an answer: solver_node against a plain rclpy relay that computes nothing.

Both publish a JointState and a PointStamped for every crank angle. They run in turn, several
times, each as a process of its own; what counts is the ratio within a round. So do solver_node
with Jansen's leg and with the Klann leg.
"""

from operator import attrgetter, truediv
from statistics import median
import sys

from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np
from support.aims import exit_code, is_met, sized
from support.node_under_test import Figures, NodeUnderTest, RELAY, SOLVER

ROUNDS = sized(1, 3, 5)
SECONDS = sized(0.2, 2.0, 3.0)
RATES = sized((200.0,), (1000.0,), (200.0, 1000.0))
# Maximum ratios of CPU a message and of latencies to the relay's.
MAX_RATIOS = {'cpu': 0.5, 'p50': 1.0, 'p99': 1.0}
# Maximum ratio of Jansen's CPU a message to Klann's.
MAX_JANSEN_RATIO = 1.15


def measure(command: list[str], rate: float) -> Figures:
    """Start a node, measure it, end it."""
    node = NodeUnderTest(command)
    try:
        return node.measure(rate, SECONDS)
    finally:
        node.stop()


def measure_in_turn(
    reference_command: list[str], command: list[str], rate: float
) -> tuple[list[Figures], list[Figures]]:
    """Return the figures of a reference and of a node, round by round."""
    reference_rounds: list[Figures] = []
    rounds: list[Figures] = []
    for k in range(ROUNDS):
        # They begin a round in turn.
        for is_reference in (k % 2 == 0, k % 2 == 1):
            if is_reference:
                reference_rounds.append(measure(reference_command, rate))
            else:
                rounds.append(measure(command, rate))
    return reference_rounds, rounds


def median_ratio(rounds: list[Figures], reference_rounds: list[Figures], quantity: str) -> float:
    """Return the median over the rounds of the ratio of a quantity to that of the reference."""
    get = attrgetter(quantity)
    return float(median(map(truediv, map(get, rounds), map(get, reference_rounds))))


def compare(rate: float) -> bool:
    """Print the figures at a rate; return whether the aims are met."""
    relay_rounds, solver_rounds = measure_in_turn(RELAY, SOLVER, rate)
    print(f'{rate:g} Hz, {ROUNDS} rounds in turn of {SECONDS:g} s')
    print(f'{"":12} {"CPU/us":>8} {"p50/us":>8} {"p99/us":>8} {"idle/%":>7} {"lost":>5}')
    for name, rounds in (('relay', relay_rounds), ('solver_node', solver_rounds)):
        medians = Figures(*np.median(rounds, axis=0).tolist())
        lost = sum(figures.lost for figures in rounds)
        print(
            f'{name:12} {medians.cpu:8.1f} {medians.p50:8.0f} {medians.p99:8.0f} '
            f'{medians.idle:7.2f} {lost:5}'
        )
    met = lost == 0
    for quantity, max_ratio in MAX_RATIOS.items():
        met &= is_met(quantity, median_ratio(solver_rounds, relay_rounds, quantity), max_ratio)
    print()
    return met


def compare_linkages(rate: float) -> bool:
    """Print what Jansen's leg costs beside the Klann leg; return whether the aim is met."""
    jansen = [*SOLVER, '--ros-args', '-p', f'linkage:={SHIPPED / "jansen.yaml"}']
    klann_rounds, jansen_rounds = measure_in_turn(SOLVER, jansen, rate)
    cpu = median(figures.cpu for figures in jansen_rounds)
    print(f'Jansen at {rate:g} Hz: {cpu:.1f} us CPU a message')
    ratio = median_ratio(jansen_rounds, klann_rounds, 'cpu')
    met = is_met('cpu of Klann', ratio, MAX_JANSEN_RATIO)
    return met and not any(figures.lost for figures in jansen_rounds)


if __name__ == '__main__':
    met = [*map(compare, RATES), compare_linkages(RATES[-1])]
    sys.exit(exit_code(*met))
