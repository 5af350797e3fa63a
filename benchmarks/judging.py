"""
What it costs a recorder to judge, and to hold what passes in memory until there is a cause.

A crank and a solver publish three topics of 1 kHz; several recorders hear the same messages at the
same time, one for each way to record, so that whatever else the machine does is the same to all.
What counts is the CPU of each beside that of the one that only records, over the same messages.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
import time

from klann_ros.log.reader import open_log
from support.aims import exit_code, is_met, SMOKE

# The traffic never leaves the machine, nor meets another's.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_DOMAIN_ID', '92')

TOPICS = '[/crank_angle, /joint_states, /point_h]'
WAYS = {
    'recording': {},
    'judging': {'judge': 'true'},
    'waiting': {'pre_trigger': '5.0', 'judge': 'false'},
    'waiting, judging': {'pre_trigger': '5.0'},
}
ROUNDS, SECONDS, WARM_UP = (1, 0.5, 2.0) if SMOKE else (3, 10.0, 15.0)
RATE, MAX_RATIO = 1000.0, 1.2


def command(name: str, **parameters: object) -> list[str]:
    """Return the command line of a node."""
    code = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
    given = [word for key, value in parameters.items() for word in ('-p', f'{key}:={value}')]
    return [sys.executable, '-c', code, '--ros-args', *given]


@contextmanager
def started(*line: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process, and end it by its id."""
    process = subprocess.Popen(line, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def cpu(process: subprocess.Popen[bytes]) -> float:
    """Return the time that all threads of a process have run [s]."""
    threads = Path(f'/proc/{process.pid}/task').iterdir()
    return sum(int((thread / 'schedstat').read_text().split()[0]) for thread in threads) / 1e9


def memory(process: subprocess.Popen[bytes]) -> float:
    """Return the resident memory of a process [MB]."""
    pages = int(Path(f'/proc/{process.pid}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def measured(ways: list[str]) -> dict[str, tuple[float, float]]:
    """Return CPU a message [us] and memory [MB] of each way, all at once."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        with started(*command('solver_node')):
            recorders = {
                way: started(
                    *command(
                        'recorder_node', output=folder / f'run{k}', topics=TOPICS, **WAYS[way]
                    )
                )
                for k, way in enumerate(ways)
            }
            processes = {way: recorder.__enter__() for way, recorder in recorders.items()}
            crank = command('crank_node', rate=RATE, speed=3.0, min_subscribers=len(ways) + 1)
            recording = folder / f'run{ways.index("recording")}'
            with started(*crank):
                while not any(recording.glob('*.mcap')):
                    time.sleep(0.1)
                time.sleep(WARM_UP)
                before, begin = {w: cpu(p) for w, p in processes.items()}, time.time_ns()
                time.sleep(SECONDS)
                spent, end = {w: cpu(p) - before[w] for w, p in processes.items()}, time.time_ns()
                sizes = {w: memory(p) for w, p in processes.items()}
            for recorder in recorders.values():
                recorder.__exit__(None, None, None)
        with open_log(recording) as log:
            count = sum(begin <= message.log_time < end for message in log.messages())
    costs = {way: spent[way] / max(count, 1) * 1e6 for way in ways}
    row = ', '.join(f'{way} {cost:.1f} us' for way, cost in costs.items())
    print(f'  {count / SECONDS:.0f} messages/s: {row}', flush=True)
    return {way: (costs[way], sizes[way]) for way in ways}


def main() -> int:
    """Print what each way costs; return 0 if judging costs no more than it may."""
    ways = sys.argv[1:] or (['judging'] if SMOKE else [*WAYS])
    ways = ways if 'recording' in ways else ['recording', *ways]
    rounds = [measured(ways if k % 2 == 0 else ways[::-1]) for k in range(ROUNDS)]
    print(f'{"":18} {"CPU/us":>7} {"ratio":>6} {"MB":>6}')
    for way in ways:
        costs, sizes = zip(*(costs[way] for costs in rounds), strict=True)
        ratio = median(costs[way][0] / costs['recording'][0] for costs in rounds)
        print(f'{way:18} {median(costs):7.1f} {ratio:6.2f} {median(sizes):6.1f}')
    worst = median(costs['judging'][0] / costs['recording'][0] for costs in rounds)
    return exit_code(is_met('judging', worst, MAX_RATIO))


if __name__ == '__main__':
    sys.exit(main())
