"""
Time poses of the Klann leg, one by one and by the million: ours, SciPy's fsolve and pylinkage.

All solve the same leg in the same run, in turn and several times. What counts is the ratio of the
times a pose, since the machine's speed drifts. pylinkage and fsolve are slow, so they solve fewer
poses; the first column says how many. The errors are those of H, against 80-bit arithmetic.
"""

import math
import sys

from klann_ros.kinematics import klann_poses, KlannGeometry, KlannLeg
import numba
import numpy as np
from support import extended
from support.aims import exit_code, sized
from support.fsolve_leg import FsolveLeg
from support.pylinkage_leg import PylinkageLeg
from support.rounds import Aim, report, run, Way

ROUNDS_OF_A_TURN, ROUNDS_OF_A_MILLION = sized(1, 41), sized(1, 9)
MILLION = sized(100_000, 1_000_000)
GEOMETRY = KlannGeometry.sem104()


@numba.njit  # type: ignore[untyped-decorator]
def sines_and_cosines(alphas: np.ndarray) -> float:
    """Take what no pose can do without, and do nothing with it but to add it up."""
    total = 0.0
    for k in range(alphas.size):
        total += math.cos(alphas[k]) + math.sin(alphas[k])
    return total


def one_by_one() -> bool:
    """Solve a turn in steps of 1 deg, each pose started from the one before."""
    alphas = [math.radians(k) for k in range(1, 361)]
    leg, fsolve = KlannLeg(GEOMETRY), FsolveLeg(GEOMETRY)
    pylinkage = PylinkageLeg(GEOMETRY, math.radians(1))
    ways = [
        Way('KlannLeg.solve', 360, lambda: [leg.solve(alpha).h for alpha in alphas]),
        Way('KlannLeg.closed_form', 360, lambda: [leg.closed_form(alpha).h for alpha in alphas]),
        Way('pylinkage step', 360, lambda: pylinkage.feet(360)),
        Way('SciPy fsolve', 360, lambda: fsolve.feet(alphas)),
    ]
    aims = [
        Aim('KlannLeg.solve', 'pylinkage step', 0.45),
        Aim('KlannLeg.solve', 'SciPy fsolve', 0.15),
    ]
    run(ways, extended.feet(GEOMETRY, np.array(alphas)), ROUNDS_OF_A_TURN)
    print(f'One pose at a time, warm started, {ROUNDS_OF_A_TURN} rounds in turn')
    return report(ways, aims)


def by_the_million() -> bool:
    """Solve a million poses of one leg, with H into an array that is there already."""
    step = 2 * math.pi / MILLION
    # pylinkage starts at 0 and makes a step first; it adds its steps up.
    alphas = step * np.arange(1, MILLION + 1)
    out, sums = np.empty((MILLION, 2)), list[float]()
    step_leg, fast_leg = PylinkageLeg(GEOMETRY, step), PylinkageLeg(GEOMETRY, step)

    def ours(kernel: str, **more: bool) -> Way:
        name = ' '.join(['klann_poses', kernel, *(f'+ {what}' for what in more)])
        return Way(
            name, MILLION, lambda: klann_poses(GEOMETRY, alphas, out=out, kernel=kernel, **more).h
        )

    ways = [
        ours('numba'),
        ours('numpy'),
        *(ours(kernel, angles=True) for kernel in ('numba', 'numpy')),
        *(ours(kernel, points=True) for kernel in ('numba', 'numpy')),
        Way(
            'sines and cosines alone, numba',
            MILLION,
            lambda: sums.append(sines_and_cosines(alphas)),
        ),
        Way('pylinkage step', 10_000, lambda: step_leg.feet(10_000)),
        Way('pylinkage step_fast', 100_000, lambda: fast_leg.feet_fast(100_000)),
    ]
    aims = [
        Aim('klann_poses numba', 'pylinkage step', 1 / 25),
        Aim('klann_poses numba', 'sines and cosines alone, numba', 2.5),
        Aim('klann_poses numpy', 'pylinkage step', 1 / 5),
        Aim('klann_poses numba', 'pylinkage step_fast'),
        Aim('klann_poses numpy', 'pylinkage step_fast'),
    ]
    run(ways, extended.feet(GEOMETRY, alphas), ROUNDS_OF_A_MILLION)
    print(f'\nA million poses, {ROUNDS_OF_A_MILLION} rounds in turn')
    return report(ways, aims)


def main() -> int:
    """Print both tables; return 0 if every aim is met."""
    met = [one_by_one(), by_the_million()]
    return exit_code(*met)


if __name__ == '__main__':
    sys.exit(main())
