"""
What a recorded message costs: recorder_node against a stock rclpy recorder with the same writer.

They run in turn, several times, each as a process of its own, on three topics of 1 kHz each; what
counts is the ratio within a round. Then recorder_node alone takes 10,000 messages a second, of
which none may be missing in its run; with --full for a minute.
"""

from collections import Counter
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from klann_ros.log.reader import open_log
from klann_ros.nodes.endpoints import OUTPUT
import rclpy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from support.aims import exit_code, is_met, REST, sized
from support.programs import command, cpu_of, memory_of, support_command

ROUNDS, SECONDS = sized(1, 3, 5), sized(0.2, 2.0, 4.0)
RATE, TOPICS = 1000.0, 3
MOST_CPU = 0.25
# What rosbag2's C++ recorder was seen to need on this load [us a message].
ROSBAG2 = 26.0
FLOOD_TOPICS, FLOOD_RATE, FLOOD_SECONDS = 5, 2000.0, sized(0.2, 20.0, 60.0)
# How many messages are published at once: a publisher that wakes up for each has no time for it.
BURST = 5


class Cost(NamedTuple):
    """CPU a message [us], idle CPU [%], memory [MB], and messages that are not in the run."""

    cpu: float
    idle: float
    memory: float
    lost: int


def measured(*, ours: bool, topics: int, rate: float, seconds: float) -> Cost:
    """Start a recorder of topics of joint states, publish on each at a rate [Hz], end it."""
    names = [f'/load_{number}' for number in range(topics)]
    rclpy.init()
    with tempfile.TemporaryDirectory() as work:
        node = rclpy.create_node('probe')
        publishers = [node.create_publisher(JointState, name, OUTPUT) for name in names]
        run, log = Path(work, 'run'), Path(work, 'recorder.log')
        line = support_command('stock_recorder', run, *names)
        if ours:
            line = command('recorder_node', output=run, topics=f'[{",".join(names)}]')
        with log.open('w') as errors:
            process = subprocess.Popen(line, stdin=subprocess.PIPE, stderr=errors)
        while any(each.get_subscription_count() < 1 for each in publishers):
            if process.poll() is not None:
                raise SystemExit(f'the recorder has ended:\n{log.read_text()}')
            time.sleep(0.05)
        time.sleep(REST)
        idle = cpu_of(process.pid)
        time.sleep(REST)
        idle = cpu_of(process.pid) - idle
        warm_up, count = round(rate * REST / 2.0), round(rate * seconds)
        publish(publishers, rate, warm_up)
        before = cpu_of(process.pid)
        publish(publishers, rate, count)
        spent, memory = cpu_of(process.pid) - before, memory_of(process.pid)
        if ours:
            process.terminate()
        process.communicate()
        node.destroy_node()
        rclpy.shutdown()
        lost = (warm_up + count) * topics - written(run)
    return Cost(spent / (count * topics) * 1e6, idle / REST * 100.0, memory, lost)


def publish(publishers: list[Any], rate: float, count: int) -> None:
    """Publish a number of messages on every topic."""
    state = JointState(name=['alpha', 'gamma', 'beta', 'delta', 'theta'], position=[0.5] * 5)
    state.velocity = [0.25] * 5
    data = serialize_message(state)
    begin = time.perf_counter()
    for k in range(count):
        if k % BURST == 0 and (left := begin + k / rate - time.perf_counter()) > 0:
            time.sleep(left)
        for publisher in publishers:
            publisher.publish(data)
    # What is under way counts as well.
    time.sleep(0.5)


def written(run: Path) -> int:
    """Return how many messages are in a run, each with the number that follows."""
    seen: Counter[str] = Counter()
    with open_log(run) as log:
        for message in log.messages():
            if message.topic.name.startswith('/load_'):
                seen[message.topic.name] += 1
                if message.sequence != seen[message.topic.name]:
                    raise SystemExit(f'{message.topic.name}: a number is missing')
    return seen.total()


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
