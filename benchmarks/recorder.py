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
import numpy as np
import rclpy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from support.aims import exit_code, is_met, REST, sized
from support.programs import command, cpu_of, memory_of, support_command

ROUNDS = sized(1, 3, 5)
SECONDS = sized(0.2, 2.0, 4.0)
RATE = sized(200.0, 1000.0)
TOPICS = 3
MAX_CPU_RATIO = 0.25
# CPU time of rosbag2's C++ recorder on this load [us a message].
ROSBAG2_CPU = 26.0
FLOOD_TOPICS = 5
FLOOD_RATE = 2000.0
FLOOD_SECONDS = sized(0.2, 20.0, 60.0)
# Messages that are published at once: a publisher that wakes up for each has no time for it.
BURST = 5


class Cost(NamedTuple):
    """CPU a message [us], idle CPU [%], memory [MB], and messages that are not in the run."""

    cpu: float
    idle: float
    memory: float
    lost: int


def measure(*, ours: bool, topics: int, rate: float, seconds: float) -> Cost:
    """Start a recorder of topics of joint states, publish on each at a rate [Hz], end it."""
    names = [f'/load_{number}' for number in range(topics)]
    rclpy.init()
    with tempfile.TemporaryDirectory() as work:
        node = rclpy.create_node('probe')
        publishers = [node.create_publisher(JointState, name, OUTPUT) for name in names]
        run = Path(work, 'run')
        log = Path(work, 'recorder.log')
        line = support_command('stock_recorder', run, *names)
        if ours:
            line = command('recorder_node', output=run, topics=f'[{",".join(names)}]')
        with log.open('w') as errors:
            process = subprocess.Popen(line, stdin=subprocess.PIPE, stderr=errors)
        while any(publisher.get_subscription_count() < 1 for publisher in publishers):
            if process.poll() is not None:
                raise SystemExit(f'the recorder has ended:\n{log.read_text()}')
            time.sleep(0.05)
        time.sleep(REST)
        first_cpu = cpu_of(process.pid)
        time.sleep(REST)
        idle_cpu = cpu_of(process.pid) - first_cpu
        warm_up_count = round(rate * REST / 2.0)
        publish(publishers, rate, warm_up_count)
        first_cpu = cpu_of(process.pid)
        count = round(rate * seconds)
        publish(publishers, rate, count)
        cpu = cpu_of(process.pid) - first_cpu
        memory = memory_of(process.pid)
        if ours:
            process.terminate()
        process.communicate()
        node.destroy_node()
        rclpy.shutdown()
        lost = (warm_up_count + count) * topics - count_messages(run)
    return Cost(cpu / (count * topics) * 1e6, idle_cpu / REST * 100.0, memory, lost)


def publish(publishers: list[Any], rate: float, count: int) -> None:
    """Publish a number of messages on every topic."""
    state = JointState(name=['alpha', 'gamma', 'beta', 'delta', 'theta'], position=[0.5] * 5)
    state.velocity = [0.25] * 5
    data = serialize_message(state)
    begin = time.perf_counter()
    for k in range(count):
        if k % BURST == 0:
            time.sleep(max(0.0, begin + k / rate - time.perf_counter()))
        for publisher in publishers:
            publisher.publish(data)
    # Messages on their way count as well.
    time.sleep(0.5)


def count_messages(run: Path) -> int:
    """Return the number of messages in a run, whose sequence numbers must have no gap."""
    counts: Counter[str] = Counter()
    with open_log(run) as log:
        for message in log.messages():
            if message.topic.name.startswith('/load_'):
                counts[message.topic.name] += 1
                if message.sequence != counts[message.topic.name]:
                    raise SystemExit(f'{message.topic.name}: a number is missing')
    return counts.total()


def compare() -> bool:
    """Print what both recorders cost; return whether the aims are met."""
    stock_costs: list[Cost] = []
    our_costs: list[Cost] = []
    for k in range(ROUNDS):
        # They run in turn, and they begin a round in turn.
        for ours in (k % 2 == 1, k % 2 == 0):
            cost = measure(ours=ours, topics=TOPICS, rate=RATE, seconds=SECONDS)
            (our_costs if ours else stock_costs).append(cost)
    print(f'{TOPICS} topics of {RATE:g} Hz, {ROUNDS} rounds in turn of {SECONDS:g} s')
    print(f'{"":16} {"CPU/us":>8} {"idle/%":>7} {"MB":>6} {"lost":>5}')
    for name, costs in (('stock recorder', stock_costs), ('recorder_node', our_costs)):
        cpu, idle, memory, _ = np.median(costs, axis=0)
        lost = sum(cost.lost for cost in costs)
        print(f'{name:16} {cpu:8.1f} {idle:7.2f} {memory:6.1f} {lost:5}')
    is_met('cpu beside rosbag2', cpu, ROSBAG2_CPU, ' us')
    rounds = zip(our_costs, stock_costs, strict=True)
    ratio = median(our_cost.cpu / stock_cost.cpu for our_cost, stock_cost in rounds)
    return is_met('cpu', ratio, MAX_CPU_RATIO) and lost == 0


def flood() -> bool:
    """Print the cost and the losses of recorder_node in a flood; return whether it lost none."""
    cost = measure(ours=True, topics=FLOOD_TOPICS, rate=FLOOD_RATE, seconds=FLOOD_SECONDS)
    print(
        f'{FLOOD_TOPICS * FLOOD_RATE:g} messages/s for {FLOOD_SECONDS:g} s: {cost.cpu:.1f} us a '
        f'message, {cost.memory:.0f} MB'
    )
    return is_met('lost', cost.lost, 0)


if __name__ == '__main__':
    aims_met = [compare(), flood()]
    sys.exit(exit_code(*aims_met))
