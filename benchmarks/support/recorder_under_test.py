"""A recorder as a process: messages go in at a rate, and what it costs is read from outside."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
import subprocess
import time

from klann_ros.log.reader import open_log
from klann_ros.nodes.endpoints import OUTPUT
import rclpy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from .aims import REST
from .programs import command, cpu_of, memory_of, support_command

WARM_UP = REST / 2.0
# How many messages are published at once: a publisher that wakes up for each has no time for it.
BURST = 5


@dataclass(frozen=True)
class Cost:
    """CPU a message [us], idle CPU [%], memory [MB], and messages that are not in the run."""

    cpu: float
    idle: float
    memory: float
    lost: int


class RecorderUnderTest:
    """
    A recorder that is given joint states.

    Parameters
    ----------
    ours : bool
        Whether it is recorder_node, or else the stock recorder.
    folder : pathlib.Path
        Where the run goes.
    topics : int
        How many topics there are.

    """

    def __init__(self, folder: Path, *, ours: bool, topics: int) -> None:
        """Start it, and wait until it listens."""
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('probe', context=self._context)
        names = [f'/load_{number}' for number in range(topics)]
        self._publishers = [self._node.create_publisher(JointState, n, OUTPUT) for n in names]
        self._folder = folder / 'run'
        if ours:
            line = command('recorder_node', output=self._folder, topics=f'[{",".join(names)}]')
        else:
            line = support_command('stock_recorder', self._folder, *names)
        self._ours = ours
        self._log = folder / 'recorder.log'
        with self._log.open('w') as log:
            self._process = subprocess.Popen(line, stdin=subprocess.PIPE, stderr=log)
        while any(p.get_subscription_count() < 1 for p in self._publishers):
            if self._process.poll() is not None:
                raise SystemExit(f'the recorder has ended:\n{self._log.read_text()}')
            time.sleep(0.05)
        time.sleep(REST)

    def measure(self, rate: float, seconds: float) -> Cost:
        """Publish on every topic at a rate [Hz] for some time [s], then end it."""
        idle = cpu_of(self._process.pid)
        time.sleep(REST)
        idle = cpu_of(self._process.pid) - idle
        warm_up, count = round(rate * WARM_UP), round(rate * seconds)
        self._publish(rate, warm_up)
        before = cpu_of(self._process.pid)
        self._publish(rate, count)
        spent, memory = cpu_of(self._process.pid) - before, memory_of(self._process.pid)
        self._stop()
        lost = (warm_up + count) * len(self._publishers) - self._written()
        per_message = spent / (count * len(self._publishers))
        return Cost(per_message * 1e6, idle / REST * 100.0, memory, lost)

    def _publish(self, rate: float, count: int) -> None:
        state = JointState(name=['alpha', 'gamma', 'beta', 'delta', 'theta'], position=[0.5] * 5)
        state.velocity = [0.25] * 5
        data = serialize_message(state)
        begin = time.perf_counter()
        for k in range(count):
            if k % BURST == 0 and (left := begin + k / rate - time.perf_counter()) > 0:
                time.sleep(left)
            for publisher in self._publishers:
                publisher.publish(data)
        # What is under way counts as well.
        time.sleep(0.5)

    def _written(self) -> int:
        """Return how many messages are in the run, each with the number that follows."""
        seen: Counter[str] = Counter()
        with open_log(self._folder) as log:
            for message in log.messages():
                if message.topic.name.startswith('/load_'):
                    seen[message.topic.name] += 1
                    if message.sequence != seen[message.topic.name]:
                        raise SystemExit(f'{message.topic.name}: a number is missing')
        return seen.total()

    def _stop(self) -> None:
        if self._ours:
            self._process.terminate()
        self._process.communicate()
        self._node.destroy_node()
        self._context.try_shutdown()
