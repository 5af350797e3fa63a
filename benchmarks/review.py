"""
The cost of a review: its time and its memory, as a process, for ten minutes and for an hour.

Of the first run also the additional CPU time of an annotated copy, the median of pairs.

The runs are written at once by the log library, into a folder that is removed at the end.
"""

from math import inf
import os
from pathlib import Path
import shutil
from statistics import median
import subprocess
import sys
import tempfile
from time import monotonic
from typing import NamedTuple

from klann_ros.kinematics.linkage.file import SHIPPED
from support.aims import exit_code, is_met, SMOKE
from support.long_run import write_long_run

REVIEW = 'import sys; from klann_ros.executables import review; sys.exit(review())'


PAIRS, MAX_ANNOTATION_COST = 9, 0.1


class Case(NamedTuple):
    """
    A run to be reviewed, and the aims: time [s] and memory [MB].

    Of a linkage other than Klann's: at most `times` the time of the case before, in the same run.
    """

    name: str
    seconds: float
    rate: float
    most_time: float
    most_memory: float
    linkage: str = ''
    times: float = inf


CASES = (
    Case('ten minutes at 200 Hz', 600.0, 200.0, 5.0, 500.0),
    Case('an hour at 1 kHz', 3600.0, 1000.0, 180.0, 1000.0),
    Case('an hour of Jansen', 3600.0, 1000.0, 180.0, 1000.0, 'jansen.yaml', 2.0),
)


def measured(run: Path) -> tuple[int, float, float]:
    """Review a run; return the exit code, the time [s] and the peak of its memory [MB]."""
    begin = monotonic()
    process = subprocess.Popen([sys.executable, '-c', REVIEW, run], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, monotonic() - begin, usage.ru_maxrss / 1000


def cpu_time(*arguments: Path | str) -> float:
    """Return the CPU time of a review as a process [s]."""
    command = [sys.executable, '-c', REVIEW, *arguments]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime


def annotation_cost(run: Path, copy: Path) -> float:
    """Return the additional share of CPU time for an annotated copy, by alternating pairs."""
    ratios = []
    for _ in range(1 if SMOKE else PAIRS):
        shutil.rmtree(copy, ignore_errors=True)
        ratios.append(cpu_time(run, '--annotate', copy) / cpu_time(run) - 1.0)
    return median(ratios)


def main() -> int:
    """Print the figures of each case; return 0 if all aims are met."""
    met, before = True, inf
    print(f'{"run":22} {"messages":>10} {"MB on disk":>10} {"time/s":>8} {"peak/MB":>8}')
    with tempfile.TemporaryDirectory() as work:
        for case in CASES:
            run = Path(work, case.name.replace(' ', '_'))
            text = SHIPPED.joinpath(case.linkage).read_text() if case.linkage else ''
            seconds = 2.0 if SMOKE else case.seconds
            write_long_run(run, seconds, case.rate, text)
            size = sum(path.stat().st_size for path in run.iterdir()) / 1e6
            code, time, memory = measured(run)
            count = 3 * round(seconds * case.rate)
            print(f'{case.name:22} {count:10} {size:10.1f} {time:8.1f} {memory:8.0f}')
            most = min(case.most_time, case.times * before)
            reached = code == 0 and time <= most and memory <= case.most_memory
            met, before = met and reached, time
            aims = f'aims <= {most:.3g} s, <= {case.most_memory:g} MB, nothing found'
            print(f'{aims}: {"met" if reached else "MISSED"}', flush=True)
            if case is CASES[0]:
                share = annotation_cost(run, Path(work, 'copy'))
                met &= is_met('--annotate, additional CPU time', share, MAX_ANNOTATION_COST)
    return exit_code(met)


if __name__ == '__main__':
    sys.exit(main())
