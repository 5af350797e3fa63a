"""
Time a pose of each linkage, compared with the Klann leg and with another checkout.

    python3 benchmarks/linkages.py [CHECKOUT]

Each checkout is a process of its own, and they are asked in turn for the same work; what counts is
the ratio within a round, since the machine's speed drifts.
"""

from collections.abc import Callable, Sequence
from functools import partial
import math
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
from time import perf_counter
from typing import IO, Literal

from klann_ros import kinematics
from klann_ros.kinematics import KlannGeometry
import numpy as np
from support.aims import exit_code, is_met, sized, SMOKE

HERE, WORKER = Path(__file__).resolve().parent, 'worker'
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
# Maximum ratio to the time of the other checkout for the same poses.
MAX_CHECKOUT_RATIO = 1.05
HELD = (
    'klann warm',
    *(f'{poses} {kernel}' for poses in ('klann_poses', '1000 legs x 72')
      for kernel in ('numpy', 'numba')),
)  # fmt: skip


# The poses that each checkout solves in its own process.
COUNT = sized(10_000, 1_000_000)
Kernel = Literal['numpy', 'numba']

TURN = [math.radians(k) for k in range(1, 361)]
ANGLES = 2 * math.pi / COUNT * np.arange(1, COUNT + 1)
SWEEP = np.linspace(0.0, 2 * math.pi, 72)
LENGTHS = 0.35 * (1 + 1e-6 * np.arange(COUNT // 10))


def warm(leg: kinematics.KlannLeg | kinematics.LinkageLeg, turns: int = 5) -> int:
    """Solve some turns one pose after the other."""
    solve = leg.solve
    for _ in range(turns):
        for alpha in TURN:
            solve(alpha)
    return turns * len(TURN)


def klann_turn(kernel: Kernel) -> int:
    """Solve a million angles of one leg."""
    kinematics.klann_poses(kinematics.KlannGeometry(), ANGLES, kernel=kernel)
    return ANGLES.size


def linkage_turn(name: str, kernel: Kernel) -> int:
    """Solve a million angles of one linkage, or fewer where the loops are coupled."""
    alphas = ANGLES[::100] if name == 'stephenson' else ANGLES
    kinematics.linkage_poses(kinematics.shipped_linkage(name), alphas, kernel=kernel)
    return alphas.size


def objects(kernel: Kernel) -> int:
    """Make a thousand geometries as objects, one by one, and solve them."""
    legs = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    kinematics.klann_poses(legs, SWEEP, kernel=kernel)
    return 1000 * SWEEP.size


def existing_objects(legs: Sequence[KlannGeometry], kernel: Kernel) -> int:
    """Solve a thousand geometries that are there already."""
    kinematics.klann_poses(legs, SWEEP, kernel=kernel)
    return 1000 * SWEEP.size


def arrays(kernel: Kernel) -> int:
    """Solve the same, and 99,000 more, from an array of one of their lengths."""
    base = kinematics.KlannGeometry().linkage
    variants = kinematics.Variants(base, {'l_bc': LENGTHS})
    kinematics.linkage_poses(variants, SWEEP, kernel=kernel)
    return LENGTHS.size * SWEEP.size


def ways() -> dict[str, Callable[[], int]]:
    """Return what this checkout can do, by name."""
    klann = kinematics.KlannLeg()
    klann.solve(0.0)
    legs = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    calls: dict[str, Callable[[], int]] = {'klann warm': partial(warm, klann)}
    for name in ('jansen', 'stephenson', 'four_bar'):
        leg = kinematics.LinkageLeg(kinematics.shipped_linkage(name))
        leg.solve(0.0)
        calls[f'{name} warm'] = partial(warm, leg, 1)
    kernels: tuple[Kernel, ...] = ('numpy', 'numba')
    for kernel in kernels:
        calls[f'klann_poses {kernel}'] = partial(klann_turn, kernel)
        calls[f'1000 legs x 72 {kernel}'] = partial(existing_objects, legs, kernel)
        calls[f'objects x 72 {kernel}'] = partial(objects, kernel)
        if hasattr(kinematics, 'linkage_poses'):
            calls[f'arrays x 72 {kernel}'] = partial(arrays, kernel)
            calls[f'jansen bulk {kernel}'] = partial(linkage_turn, 'jansen', kernel)
    if hasattr(kinematics, 'linkage_poses'):
        calls['stephenson bulk numpy'] = partial(linkage_turn, 'stephenson', 'numpy')
    return calls


def work() -> None:
    """Time a way whenever its name comes in on standard input; print the seconds a pose."""
    calls = ways()
    print(*calls, sep='|', flush=True)
    for line in sys.stdin:
        begin = perf_counter()
        poses = calls[line.strip()]()
        print((perf_counter() - begin) / poses, flush=True)


class Checkout:
    """A checkout at work in a process of its own."""

    def __init__(self, folder: Path) -> None:
        """Start it."""
        self._process = subprocess.Popen(
            [sys.executable, __file__, WORKER, *(['--smoke'] if SMOKE else [])],
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


def ratio(times: list[float], reference: list[float]) -> float:
    """Return the ratio of the times to a reference: the median over the rounds."""
    return median(a / b for a, b in zip(times, reference, strict=True))


def main() -> int:
    """Print the figures; return 0 if all aims are met."""
    this = Checkout(HERE.parent)
    checkouts_there = [Checkout(Path(folder).resolve()) for folder in sys.argv[1:2]]
    checkouts = [this, *checkouts_there]
    for checkout in checkouts:
        for way in checkout.ways:
            checkout.run(way)
    for k in range(ROUNDS):
        for way in this.ways:
            # In turn, and which is first in turn as well.
            for checkout in checkouts[:: 1 if k % 2 == 0 else -1]:
                if way in checkout.ways:
                    checkout.measure(way)
    for checkout in checkouts:
        checkout.end()
    print(f'{"us a pose, " + str(ROUNDS) + " rounds":24} {"here":>9} {"there":>9} {"ratio":>7}')
    for way, times in this.times.items():
        reference = checkouts_there[0].times.get(way) if checkouts_there else None
        line = f'{way:24} {median(times) * 1e6:9.4f}'
        if reference:
            line += f' {median(reference) * 1e6:9.4f} {ratio(times, reference):7.3f}'
        print(line)
    met = [
        is_met(f'{way} / {base}', ratio(this.times[way], this.times[base]), max_ratio)
        for way, base, max_ratio in AIMS
    ]
    met += [
        is_met(
            f'{way} here / there', ratio(this.times[way], checkout.times[way]), MAX_CHECKOUT_RATIO
        )
        for checkout in checkouts_there
        for way in HELD
    ]
    return exit_code(*met)


if __name__ == '__main__':
    if sys.argv[1:] == [WORKER]:
        work()
    else:
        sys.exit(main())
