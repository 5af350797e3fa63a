"""
Kill a recorder again and again at random moments: a crash costs at most a second.

    PYTHONPATH=benchmarks python -m support.kill [TIMES]

A crank of 1 kHz turns a solver; recorder_node takes all topics. For each topic it prints how much
time lies between the kill and the last message in the file, and how many are missing before it.
"""

from pathlib import Path
import random
from subprocess import DEVNULL, Popen
import sys
import tempfile
import time

from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import Log, open_log
from support.programs import command, started

# What is recorded of the crank and its solver, each at its rate.
TOPICS = ('/crank_angle', '/joint_states', '/point_h')
MOST = 1.0


def killed(folder: Path, seconds: float) -> dict[str, tuple[float, int]]:
    """Record, kill; return the lost time [s] of each topic, and the gaps before."""
    recorder = Popen(command('recorder_node', output=folder, all_topics='true'), stderr=DEVNULL)
    while not _heard(folder):
        time.sleep(0.1)
    time.sleep(seconds)
    recorder.kill()
    end = time.time_ns()
    recorder.wait()
    with open_log(folder) as log:
        return {topic: _loss(log, topic, end) for topic in TOPICS}


def _heard(folder: Path) -> bool:
    """Return whether there is something of every topic in the file."""
    try:
        with open_log(folder) as log:
            return set(TOPICS) <= {topic.name for topic in log.topics}
    except NotALogError:
        return False


def _loss(log: Log, topic: str, end: int) -> tuple[float, int]:
    """Return the time from the last message to the end [s], and how many are missing before."""
    messages = [(message.log_time, message.sequence) for message in log.messages([topic])]
    if not messages:
        return float('inf'), 0
    (last, newest), (_, oldest) = messages[-1], messages[0]
    return (end - last) / 1e9, newest - oldest + 1 - len(messages)


def main(times: int) -> int:
    """Print what each kill has cost; return 0 if it was never more than a second."""
    worst, missing = 0.0, 0
    with (
        started(command('crank_node', rate=1000.0), stderr=DEVNULL),
        started(command('solver_node'), stderr=DEVNULL),
        tempfile.TemporaryDirectory() as work,
    ):
        for number in range(times):
            seconds = random.uniform(0.5, 3.0)  # noqa: S311 - no secret
            losses = killed(Path(work, f'run_{number}'), seconds)
            worst = max(worst, *(lost for lost, _ in losses.values()))
            missing += sum(count for _, count in losses.values())
            rows = losses.items()
            said = ', '.join(f'{name} {lost:.3f} s, {gone}' for name, (lost, gone) in rows)
            print(f'{number + 1:3}: {said}', flush=True)
    print(f'at most {worst:.3f} s were lost, and {missing} messages before that')
    return 0 if worst <= MOST and not missing else 1


if __name__ == '__main__':
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
