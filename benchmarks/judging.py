"""
What it costs a recorder to judge, and to hold what passes in memory until there is a cause.

A crank and a solver publish three topics of 1 kHz; several recorders hear the same messages at the
same time, one for each way to record, so that whatever else the machine does is the same to all.
What counts is the CPU of each beside that of the one that only records, over the same messages.
"""

from contextlib import ExitStack
from pathlib import Path
from statistics import median
from subprocess import DEVNULL
import sys
import tempfile
import time

from klann_ros.log.reader import open_log
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
# What waits is held in memory for 5 s.
SECONDS, WARM_UP = sized(0.5, 10.0), sized(2.0, 7.0, 15.0)
RATE, MAX_RATIO = 1000.0, 1.2


def measured(ways: list[str]) -> dict[str, tuple[float, float]]:
    """Return CPU a message [us] and memory [MB] of each way, all at once."""
    quiet = {'stdin': DEVNULL, 'stderr': DEVNULL}
    with tempfile.TemporaryDirectory() as place:
        runs = {way: Path(place, f'run{k}') for k, way in enumerate(ways)}
        recording = runs['recording']
        with ExitStack() as stack:
            stack.enter_context(started(command('solver_node'), **quiet))
            pids = {}
            for way, run in runs.items():
                line = command('recorder_node', output=run, topics=TOPICS, **WAYS[way])
                pids[way] = stack.enter_context(started(line, **quiet)).pid
            count = len(ways) + 1
            crank = command('crank_node', rate=RATE, speed=3.0, min_subscribers=count)
            stack.enter_context(started(crank, **quiet))
            while not any(recording.glob('*.mcap')):
                time.sleep(0.1)
            time.sleep(WARM_UP)
            before, begin = {way: cpu_of(pid) for way, pid in pids.items()}, time.time_ns()
            time.sleep(SECONDS)
            spent = {way: cpu_of(pid) - before[way] for way, pid in pids.items()}
            end, sizes = time.time_ns(), {way: memory_of(pid) for way, pid in pids.items()}
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
    ratios = {}
    for way in ways:
        costs, sizes = zip(*(costs[way] for costs in rounds), strict=True)
        ratios[way] = median(costs[way][0] / costs['recording'][0] for costs in rounds)
        print(f'{way:18} {median(costs):7.1f} {ratios[way]:6.2f} {median(sizes):6.1f}')
    return exit_code(is_met('judging', ratios['judging'], MAX_RATIO))


if __name__ == '__main__':
    sys.exit(main())
