"""Time a way when it is asked for: a name comes in on standard input, seconds a pose go out."""

from collections.abc import Callable, Sequence
from functools import partial
import math
import sys
from time import perf_counter
from typing import Literal

from klann_ros import kinematics
from klann_ros.kinematics import KlannGeometry
import numpy as np

SMOKE = '--smoke' in sys.argv
COUNT = 10_000 if SMOKE else 1_000_000
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
    made = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    kinematics.klann_poses(made, SWEEP, kernel=kernel)
    return 1000 * SWEEP.size


def objects_made(made: Sequence[KlannGeometry], kernel: Kernel) -> int:
    """Solve a thousand geometries that are there already."""
    kinematics.klann_poses(made, SWEEP, kernel=kernel)
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
    made = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    found: dict[str, Callable[[], int]] = {'klann warm': partial(warm, klann)}
    for name in ('jansen', 'stephenson', 'four_bar'):
        leg = kinematics.LinkageLeg(kinematics.shipped_linkage(name))
        leg.solve(0.0)
        found[f'{name} warm'] = partial(warm, leg, 1)
    kernels: tuple[Kernel, ...] = ('numpy', 'numba')
    for kernel in kernels:
        found[f'klann_poses {kernel}'] = partial(klann_turn, kernel)
        found[f'1000 legs x 72 {kernel}'] = partial(objects_made, made, kernel)
        found[f'objects x 72 {kernel}'] = partial(objects, kernel)
        if hasattr(kinematics, 'linkage_poses'):
            found[f'arrays x 72 {kernel}'] = partial(arrays, kernel)
            found[f'jansen bulk {kernel}'] = partial(linkage_turn, 'jansen', kernel)
    if hasattr(kinematics, 'linkage_poses'):
        found['stephenson bulk numpy'] = partial(linkage_turn, 'stephenson', 'numpy')
    return found


def main() -> None:
    """Answer each line that comes in."""
    found = ways()
    print(*found, sep='|', flush=True)
    for line in sys.stdin:
        begin = perf_counter()
        poses = found[line.strip()]()
        print((perf_counter() - begin) / poses, flush=True)


if __name__ == '__main__':
    main()
