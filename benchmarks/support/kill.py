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
from typing import NamedTuple

from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import Log, open_log
from support.programs import command, started

# Topics of the crank and its solver.
TOPICS = ('/crank_angle', '/joint_states', '/point_h')
MAX_LOSS = 1.0


class Loss(NamedTuple):
    """The time from the last message to the kill [s], and missing messages before."""

    time: float
    gaps: int


def record_and_kill(folder: Path, seconds: float) -> dict[str, Loss]:
    """Record, kill; return the loss of each topic."""
    recorder = Popen(command('recorder_node', output=folder, all_topics='true'), stderr=DEVNULL)
    while not _has_all_topics(folder):
        time.sleep(0.1)
    time.sleep(seconds)
    recorder.kill()
    kill_time = time.time_ns()
    recorder.wait()
    with open_log(folder) as log:
        return {topic: _loss(log, topic, kill_time) for topic in TOPICS}


def _has_all_topics(folder: Path) -> bool:
    """Return whether the file has messages of every topic."""
    try:
        with open_log(folder) as log:
            return set(TOPICS) <= {topic.name for topic in log.topics}
    except NotALogError:
        return False


def _loss(log: Log, topic: str, kill_time: int) -> Loss:
    messages = list(log.messages([topic]))
    if not messages:
        return Loss(float('inf'), 0)
    sent_count = messages[-1].sequence - messages[0].sequence + 1
    return Loss((kill_time - messages[-1].log_time) / 1e9, sent_count - len(messages))


def main(times: int) -> int:
    """Print the losses of each kill; return 0 if it was never more than a second."""
    max_loss = 0.0
    missing = 0
    with (
        started(command('crank_node', rate=1000.0), stderr=DEVNULL),
        started(command('solver_node'), stderr=DEVNULL),
        tempfile.TemporaryDirectory() as work,
    ):
        for number in range(times):
            seconds = random.uniform(0.5, 3.0)  # noqa: S311 - no secret
            losses = record_and_kill(Path(work, f'run_{number}'), seconds)
            line = f'{number + 1:3}:'
            for topic, loss in losses.items():
                max_loss = max(max_loss, loss.time)
                missing += loss.gaps
                line += f' {topic} {loss.time:.3f} s, {loss.gaps};'
            print(line, flush=True)
    print(f'at most {max_loss:.3f} s were lost, and {missing} messages before that')
    return 0 if max_loss <= MAX_LOSS and not missing else 1


if __name__ == '__main__':
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
