"""
What a pose of each linkage costs, beside the Klann leg's, and beside another checkout's.

    python3 benchmarks/linkages.py [CHECKOUT]

Each checkout is a process of its own, and they are asked in turn for the same work; what counts is
the ratio within a round, since the machine's speed drifts.
"""

import os
from pathlib import Path
from statistics import median
import subprocess
import sys
from typing import IO

from support.aims import exit_code, is_met, sized, SMOKE

HERE = Path(__file__).resolve().parent
ROUNDS = sized(1, 15)
# Maximum ratios of the times per pose of two solvers of the same checkout. Jansen's
# leg has three dyads, the Klann leg two.
AIMS = (
    ('jansen warm', 'klann warm', 1.3 * 3 / 2),
    ('stephenson warm', 'klann warm', 3.0),
    ('jansen bulk numpy', 'klann_poses numpy', 2.5),
    ('jansen bulk numba', 'klann_poses numba', 2.5),
    ('arrays x 72 numpy', 'objects x 72 numpy', 1 / 5),
    ('arrays x 72 numba', 'objects x 72 numba', 1 / 5),
)
# And of the other checkout's time for the same.
MOST_OF_THE_OTHER = 1.05
HELD = (
    'klann warm',
    *(f'{what} {kernel}' for what in ('klann_poses', '1000 legs x 72')
      for kernel in ('numpy', 'numba')),
)  # fmt: skip


class Checkout:
    """A checkout at work in a process of its own."""

    def __init__(self, folder: Path) -> None:
        """Start it."""
        self._process = subprocess.Popen(
            [sys.executable, HERE / 'support' / 'worker.py', *(['--smoke'] if SMOKE else [])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {'PYTHONPATH': str(folder)},
        )
        self.ways = self._answers.readline().strip().split('|')
        self.times: dict[str, list[float]] = {way: [] for way in self.ways}

    @property
    def _requests(self) -> IO[str]:
        assert self._process.stdin  # noqa: S101 - a pipe
        return self._process.stdin

    @property
    def _answers(self) -> IO[str]:
        assert self._process.stdout  # noqa: S101 - a pipe
        return self._process.stdout

    def run(self, way: str) -> float:
        """Do a work; return the time a pose [s]."""
        self._requests.write(f'{way}\n')
        self._requests.flush()
        return float(self._answers.readline())

    def measure(self, way: str) -> None:
        """Do a work and keep its time."""
        self.times[way].append(self.run(way))

    def end(self) -> None:
        """End it."""
        self._requests.close()
        self._process.wait()


def ratio(own: list[float], other: list[float]) -> float:
    """Return how many times as long one takes: the median over the rounds."""
    return median(a / b for a, b in zip(own, other, strict=True))


def main() -> int:
    """Print the figures; return 0 if all aims are met."""
    ours = Checkout(HERE.parent)
    others = [Checkout(Path(folder).resolve()) for folder in sys.argv[1:2]]
    both = [ours, *others]
    for checkout in both:
        for way in checkout.ways:
            checkout.run(way)
    for k in range(ROUNDS):
        for way in ours.ways:
            # In turn, and which is first in turn as well.
            for checkout in both[:: 1 if k % 2 == 0 else -1]:
                if way in checkout.ways:
                    checkout.measure(way)
    for checkout in both:
        checkout.end()
    print(f'{"us a pose, " + str(ROUNDS) + " rounds":24} {"here":>9} {"there":>9} {"ratio":>7}')
    for way, times in ours.times.items():
        there = others[0].times.get(way) if others else None
        beside = f' {median(there) * 1e6:9.4f} {ratio(times, there):7.3f}' if there else ''
        print(f'{way:24} {median(times) * 1e6:9.4f}{beside}')
    met = [
        is_met(f'{way} / {other}', ratio(ours.times[way], ours.times[other]), most)
        for way, other, most in AIMS
    ]
    met += [
        is_met(
            f'{way} here / there', ratio(ours.times[way], checkout.times[way]), MOST_OF_THE_OTHER
        )
        for checkout in others
        for way in HELD
    ]
    return exit_code(*met)


if __name__ == '__main__':
    sys.exit(main())
