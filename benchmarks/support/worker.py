"""Time a way when it is asked for: a name comes in on standard input, seconds a pose go out."""

import math
import sys
from time import perf_counter

from klann_ros import kinematics
import numpy as np

TURN = [math.radians(k) for k in range(1, 361)]
MILLION = 2 * math.pi / 1e6 * np.arange(1, 1_000_001)
SWEEP = np.linspace(0.0, 2 * math.pi, 72)
LENGTHS = 0.35 * (1 + 1e-6 * np.arange(100_000))


def warm(leg, turns=5):
    """Solve some turns one pose after the other."""
    solve = leg.solve
    for _ in range(turns):
        for alpha in TURN:
            solve(alpha)
    return turns * len(TURN)


def klann_turn(kernel):
    """Solve a million angles of one leg."""
    kinematics.klann_poses(kinematics.KlannGeometry(), MILLION, kernel=kernel)
    return MILLION.size


def linkage_turn(name, kernel):
    """Solve a million angles of one linkage, or fewer where the loops are coupled."""
    alphas = MILLION[::100] if name == 'stephenson' else MILLION
    kinematics.linkage_poses(kinematics.shipped_linkage(name), alphas, kernel=kernel)
    return alphas.size


def objects(kernel):
    """Make a thousand geometries as objects, one by one, and solve them."""
    made = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    kinematics.klann_poses(made, SWEEP, kernel=kernel)
    return 1000 * SWEEP.size


def objects_made(made, kernel):
    """Solve a thousand geometries that are there already."""
    kinematics.klann_poses(made, SWEEP, kernel=kernel)
    return 1000 * SWEEP.size


def arrays(kernel):
    """Solve the same, and 99,000 more, from an array of one of their lengths."""
    base = kinematics.KlannGeometry().linkage
    variants = kinematics.Variants(base, {'l_bc': LENGTHS})
    kinematics.linkage_poses(variants, SWEEP, kernel=kernel)
    return LENGTHS.size * SWEEP.size


def ways():
    """Return what this checkout can do, by name."""
    klann = kinematics.KlannLeg()
    klann.solve(0.0)
    made = [kinematics.KlannGeometry(l_bc=float(length)) for length in LENGTHS[:1000]]
    found = {'klann warm': lambda: warm(klann)}
    for name in ('jansen', 'stephenson', 'four_bar'):
        leg = kinematics.LinkageLeg(kinematics.shipped_linkage(name))
        leg.solve(0.0)
        found[f'{name} warm'] = lambda leg=leg: warm(leg, 1)
    for kernel in ('numpy', 'numba'):
        found[f'klann_poses {kernel}'] = lambda kernel=kernel: klann_turn(kernel)
        found[f'1000 legs x 72 {kernel}'] = lambda kernel=kernel: objects_made(made, kernel)
        found[f'objects x 72 {kernel}'] = lambda kernel=kernel: objects(kernel)
        if hasattr(kinematics, 'linkage_poses'):
            found[f'arrays x 72 {kernel}'] = lambda kernel=kernel: arrays(kernel)
            found[f'jansen bulk {kernel}'] = lambda kernel=kernel: linkage_turn('jansen', kernel)
    if hasattr(kinematics, 'linkage_poses'):
        found['stephenson bulk numpy'] = lambda: linkage_turn('stephenson', 'numpy')
    return found


def main():
    """Answer each line that comes in."""
    found = ways()
    print(*found, sep='|', flush=True)
    for line in sys.stdin:
        begin = perf_counter()
        poses = found[line.strip()]()
        print((perf_counter() - begin) / poses, flush=True)


if __name__ == '__main__':
    main()
