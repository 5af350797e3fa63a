"""
What a recorded message costs: recorder_node against a stock rclpy recorder with the same writer.

They run in turn, several times, each as a process of its own, on three topics of 1 kHz each; what
counts is the ratio within a round. Then recorder_node alone takes 10,000 messages a second, of
which none may be missing in its run; with --full for a minute.
"""

from pathlib import Path
from statistics import median
import sys
import tempfile

from support.aims import exit_code, is_met, sized
from support.recorder_under_test import Cost, RecorderUnderTest

ROUNDS, SECONDS = sized(1, 3, 5), sized(0.2, 2.0, 4.0)
RATE, TOPICS = 1000.0, 3
MOST_CPU = 0.25
# What rosbag2's C++ recorder was seen to need on this load [us a message].
ROSBAG2 = 26.0
FLOOD_TOPICS, FLOOD_RATE, FLOOD_SECONDS = 5, 2000.0, sized(0.2, 20.0, 60.0)


def measured(*, ours: bool, topics: int, rate: float, seconds: float) -> Cost:
    """Start a recorder, measure it, end it."""
    with tempfile.TemporaryDirectory() as folder:
        return RecorderUnderTest(Path(folder), ours=ours, topics=topics).measure(rate, seconds)


def compare() -> bool:
    """Print what both recorders cost; return whether the aims are met."""
    rounds: list[dict[bool, Cost]] = []
    for k in range(ROUNDS):
        # In turn, and which is first in turn as well.
        order = (False, True) if k % 2 == 0 else (True, False)
        rounds.append(
            {
                ours: measured(ours=ours, topics=TOPICS, rate=RATE, seconds=SECONDS)
                for ours in order
            }
        )
    print(f'{TOPICS} topics of {RATE:g} Hz, {ROUNDS} rounds in turn of {SECONDS:g} s')
    print(f'{"":16} {"CPU/us":>8} {"idle/%":>7} {"MB":>6} {"lost":>5}')
    for name, ours in (('stock recorder', False), ('recorder_node', True)):
        cpu, idle, memory = (
            median(getattr(both[ours], word) for both in rounds)
            for word in ('cpu', 'idle', 'memory')
        )
        lost = sum(both[ours].lost for both in rounds)
        print(f'{name:16} {cpu:8.1f} {idle:7.2f} {memory:6.1f} {lost:5}')
    ratio = median(both[True].cpu / both[False].cpu for both in rounds)
    own = median(both[True].cpu for both in rounds)
    lost = sum(both[True].lost for both in rounds)
    is_met('cpu beside rosbag2', own, ROSBAG2, ' us')
    return is_met('cpu', ratio, MOST_CPU) and lost == 0


def flood() -> bool:
    """Print what recorder_node loses of a flood; return whether that is nothing."""
    cost = measured(ours=True, topics=FLOOD_TOPICS, rate=FLOOD_RATE, seconds=FLOOD_SECONDS)
    print(
        f'{FLOOD_TOPICS * FLOOD_RATE:g} messages/s for {FLOOD_SECONDS:g} s: {cost.cpu:.1f} us a '
        f'message, {cost.memory:.0f} MB'
    )
    return is_met('lost', cost.lost, 0)


if __name__ == '__main__':
    met = [compare(), flood()]
    sys.exit(exit_code(*met))
