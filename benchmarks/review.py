"""
The cost of a review, its time and its memory, as a process.

The runs have ten minutes at 200 Hz, and five minutes at 1 kHz, or an hour with --full.
Of the first run also the additional CPU time of an annotated copy, the median of pairs.

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

PAIRS, MAX_ANNOTATION_COST = sized(1, 5, 9), 0.1


class Case(NamedTuple):
    """
    A run to be reviewed, and the aims: time [s] and memory [MB].

    Of a linkage other than Klann's: at most `times` the time of the case before, in the same run.
    """

    seconds: float
    rate: float
    most_time: float
    most_memory: float
    linkage: str = ''
    times: float = inf


# The long runs, and the time that they may take.
LONG, MOST_TIME = sized(2.0, 300.0, 3600.0), sized(180.0, 15.0, 180.0)
CASES = (
    Case(sized(2.0, 600.0), 200.0, 5.0, 500.0),
    Case(LONG, 1000.0, MOST_TIME, 1000.0),
    Case(LONG, 1000.0, MOST_TIME, 1000.0, 'jansen', 2.0),
)


def annotation_cost(run: Path, copy: Path) -> float:
    """Return the additional share of CPU time for an annotated copy, by alternating pairs."""
    ratios = []
    for _ in range(PAIRS):
        shutil.rmtree(copy, ignore_errors=True)
        costs = [
            finished(command('review', run, *more)).cpu for more in ((), ('--annotate', copy))
        ]
        ratios.append(costs[1] / costs[0] - 1.0)
    return median(ratios)


def main() -> int:
    """Print the figures of each case; return 0 if all aims are met."""
    met, before = True, inf
    print(f'{"run":22} {"messages":>10} {"MB on disk":>10} {"time/s":>8} {"peak/MB":>8}')
    with tempfile.TemporaryDirectory() as work:
        for n, case in enumerate(CASES[:: sized(2, 1)]):
            run, name = Path(work, str(n)), f'{case.seconds / 60.0:g} min at {case.rate:g} Hz'
            text = SHIPPED.joinpath(f'{case.linkage}.yaml').read_text() if case.linkage else ''
            write_long_run(run, case.seconds, case.rate, text)
            size = sum(path.stat().st_size for path in run.iterdir()) / 1e6
            code, time, _, memory = finished(command('review', run))
            count = 3 * round(case.seconds * case.rate)
            print(
                f'{f"{name} {case.linkage}":22} {count:10} {size:10.1f} {time:8.1f} {memory:8.0f}'
            )
            most = min(case.most_time, case.times * before)
            reached = code == 0 and time <= most and memory <= case.most_memory
            met, before = met and reached, time
            aims = f'aims <= {most:.3g} s, <= {case.most_memory:g} MB, nothing found'
            print(f'{aims}: {"met" if reached else "MISSED"}', flush=True)
            if n == 0:
                share = annotation_cost(run, Path(work, 'copy'))
                met &= is_met('--annotate, additional CPU time', share, MAX_ANNOTATION_COST)
    return exit_code(met)


if __name__ == '__main__':
    sys.exit(main())
