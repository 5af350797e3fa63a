"""
The cost of a review, its time and its memory, as a process.

The runs have ten minutes at 200 Hz, and five minutes at 1 kHz, or an hour with --full. For the
first run the additional CPU time of an annotated copy is measured too, the median of pairs.

The runs are written at once by the log library, into a folder that is removed at the end.
"""

from math import inf
from pathlib import Path
import shutil
from statistics import median
import sys
import tempfile
from typing import NamedTuple

from klann_ros.kinematics.linkage.file import SHIPPED
from support.aims import exit_code, is_met, sized
from support.long_run import write_long_run
from support.programs import command, finished

PAIRS = sized(1, 5, 9)
MAX_ANNOTATION_COST = 0.1


class Case(NamedTuple):
    """
    A run to be reviewed, and the aims: time [s] and memory [MB].

    A linkage other than Klann's has an additional aim: the ratio of its time to the last case's.
    """

    seconds: float
    rate: float
    max_time: float
    max_memory: float
    linkage: str = ''
    max_ratio: float = inf


# Duration of the long runs, and the time that their review may take [s].
LONG = sized(2.0, 300.0, 3600.0)
MAX_LONG_TIME = sized(180.0, 15.0, 180.0)
CASES = (
    Case(sized(2.0, 600.0), 200.0, 5.0, 500.0),
    Case(LONG, 1000.0, MAX_LONG_TIME, 1000.0),
    Case(LONG, 1000.0, MAX_LONG_TIME, 1000.0, 'jansen', 2.0),
)


def annotation_cost(run: Path, copy: Path) -> float:
    """Return the additional share of CPU time for an annotated copy, by alternating pairs."""
    ratios = []
    for _ in range(PAIRS):
        shutil.rmtree(copy, ignore_errors=True)
        plain_cpu = finished(command('review', run)).cpu
        annotating_cpu = finished(command('review', run, '--annotate', copy)).cpu
        ratios.append(annotating_cpu / plain_cpu - 1.0)
    return median(ratios)


def main() -> int:
    """Print the figures of each case; return 0 if all aims are met."""
    met = True
    last_time = inf
    print(f'{"run":22} {"messages":>10} {"MB on disk":>10} {"time/s":>8} {"peak/MB":>8}')
    with tempfile.TemporaryDirectory() as work:
        for n, case in enumerate(CASES[:: sized(2, 1)]):
            run = Path(work, str(n))
            name = f'{case.seconds / 60.0:g} min at {case.rate:g} Hz {case.linkage}'
            text = SHIPPED.joinpath(f'{case.linkage}.yaml').read_text() if case.linkage else ''
            write_long_run(run, case.seconds, case.rate, text)
            size = sum(path.stat().st_size for path in run.iterdir()) / 1e6
            code, time, _, memory = finished(command('review', run))
            count = 3 * round(case.seconds * case.rate)
            print(f'{name:22} {count:10} {size:10.1f} {time:8.1f} {memory:8.0f}')
            max_time = min(case.max_time, case.max_ratio * last_time)
            is_case_met = code == 0 and time <= max_time and memory <= case.max_memory
            met &= is_case_met
            last_time = time
            aims = f'aims <= {max_time:.3g} s, <= {case.max_memory:g} MB, nothing found'
            print(f'{aims}: {"met" if is_case_met else "MISSED"}', flush=True)
            if n == 0:
                share = annotation_cost(run, Path(work, 'copy'))
                met &= is_met('--annotate, additional CPU time', share, MAX_ANNOTATION_COST)
    return exit_code(met)


if __name__ == '__main__':
    sys.exit(main())
