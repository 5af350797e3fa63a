"""
Damage runs and users' files at random, and hold their readers to the laws.

Run by `scripts/fuzz`. Each case is made from its seed alone, so one that fails can be run again:
`scripts/fuzz --first SEED 1`.
"""

import argparse
from collections import Counter
from pathlib import Path
import signal
import sys
import tempfile
import time

from fuzzing.laws import check, check_cost, check_legal, MAX_MEMORY, memory
from fuzzing.programs import check_program
from fuzzing.readers import check_file
from fuzzing.samples import make_samples

TIMEOUT = 30
LAWS = {
    'damage': check,
    'legal': check_legal,
    'cost': check_cost,
    'file': check_file,
    'program': check_program,
}


def main():
    """Run the cases; return 1 if any of them broke a law."""
    parser = argparse.ArgumentParser(prog='scripts/fuzz', description=__doc__)
    parser.add_argument('cases', nargs='?', type=int, default=5000)
    parser.add_argument('--first', type=int, default=0, metavar='SEED')
    parser.add_argument('--law', choices=LAWS, action='append', help='all by default')
    options = parser.parse_args()
    signal.signal(signal.SIGALRM, _give_up)
    with tempfile.TemporaryDirectory() as work:
        return _run(options, Path(work))


def _run(options, work):
    samples = make_samples(work)
    failed, slowest, begin = Counter(), 0.0, time.monotonic()
    before = memory()
    for seed in range(options.first, options.first + options.cases):
        sample = samples[seed % len(samples)]
        signal.alarm(TIMEOUT)
        start = time.monotonic()
        try:
            for law in options.law or LAWS:
                LAWS[law](sample, seed, work / f'case{seed}')
        except (Exception, TooSlow) as error:  # noqa: BLE001, RUF100 - that there is none is the law
            failed[sample.name] += 1
            print(f'{type(error).__name__}: {error or sample.name}, seed {seed}\n')
        signal.alarm(0)
        slowest = max(slowest, time.monotonic() - start)
    used = memory() - before
    print(
        f'{options.cases} cases in {time.monotonic() - begin:.0f} s, the slowest {slowest:.2f} s, '
        f'at most {used / 2**20:.0f} MB more than at the start; {failed.total()} broke a law'
    )
    return 1 if failed or used > MAX_MEMORY else 0


class TooSlow(BaseException):
    """A case took longer than TIMEOUT. No OSError, which a reader would take for its file's."""


def _give_up(*_):
    raise TooSlow


if __name__ == '__main__':
    sys.exit(main())
