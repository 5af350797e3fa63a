"""
The cost of judging in a recorder, and of holding messages in memory until an event.

A crank and a solver publish three topics of 1 kHz; several recorders hear the same messages at the
same time, one for each way to record, so that the load of the machine is the same to all. What
counts is the CPU of each relative to the one that only records, over the same messages.
"""

from contextlib import ExitStack
from pathlib import Path
from statistics import median
from subprocess import DEVNULL
import sys
import tempfile
import time
from typing import NamedTuple

from klann_ros.log import open_log
import numpy as np
from support.aims import exit_code, is_met, sized, SMOKE
from support.programs import command, cpu_of, memory_of, started

TOPICS = '[/crank_angle, /joint_states, /point_h]'
WAYS = {
    'recording': {},
    'judging': {'judge': 'true'},
    'waiting': {'pre_trigger': '5.0', 'judge': 'false'},
    'waiting, judging': {'pre_trigger': '5.0'},
}
ROUNDS = sized(1, 2, 3)
SECONDS = sized(0.5, 10.0)
# Messages wait in memory for 5 s.
WARM_UP = sized(0.5, 7.0, 15.0)
RATE = sized(200.0, 1000.0)
MAX_RATIO = 1.2


class Cost(NamedTuple):
    """CPU a message [us] and memory [MB] of a recorder."""

    cpu: float
    memory: float


def measure(ways: list[str]) -> dict[str, Cost]:
    """Return the costs of all ways at the same time."""
    quiet = {'stdin': DEVNULL, 'stderr': DEVNULL}
    with tempfile.TemporaryDirectory() as work:
        recording = Path(work, 'recording')
        with ExitStack() as stack:
            stack.enter_context(started(command('solver_node'), **quiet))
            pids = {}
            for way in ways:
                line = command('recorder_node', output=Path(work, way), topics=TOPICS, **WAYS[way])
                pids[way] = stack.enter_context(started(line, **quiet)).pid
            subscribers = len(ways) + 1
            crank = command('crank_node', rate=RATE, speed=3.0, min_subscribers=subscribers)
            stack.enter_context(started(crank, **quiet))
            while not any(recording.glob('*.mcap')):
                time.sleep(0.1)
            time.sleep(WARM_UP)
            start_cpu = {way: cpu_of(pid) for way, pid in pids.items()}
            start_time = time.time_ns()
            time.sleep(SECONDS)
            cpu_times = {way: cpu_of(pid) - start_cpu[way] for way, pid in pids.items()}
            end_time = time.time_ns()
            sizes = {way: memory_of(pid) for way, pid in pids.items()}
        with open_log(recording) as log:
            count = sum(start_time <= message.log_time < end_time for message in log.messages())
    costs = {way: Cost(cpu_times[way] / max(count, 1) * 1e6, sizes[way]) for way in ways}
    texts = [f'{way} {cost.cpu:.1f} us' for way, cost in costs.items()]
    print(f'  {count / SECONDS:.0f} messages/s: {", ".join(texts)}', flush=True)
    return costs


def main() -> int:
    """Print what each way costs; return 0 if judging costs no more than it may."""
    ways = sys.argv[1:] or (['judging'] if SMOKE else [*WAYS])
    ways = ways if 'recording' in ways else ['recording', *ways]
    rounds = [measure(ways if k % 2 == 0 else ways[::-1]) for k in range(ROUNDS)]
    print(f'{"":18} {"CPU/us":>7} {"ratio":>6} {"MB":>6}')
    ratios = {}
    for way in ways:
        cpu, memory = np.median([costs[way] for costs in rounds], axis=0)
        ratios[way] = median(costs[way].cpu / costs['recording'].cpu for costs in rounds)
        print(f'{way:18} {cpu:7.1f} {ratios[way]:6.2f} {memory:6.1f}')
    return exit_code(is_met('judging', ratios['judging'], MAX_RATIO))


if __name__ == '__main__':
    sys.exit(main())
