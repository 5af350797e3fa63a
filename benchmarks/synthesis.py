"""
The defects that synthesis reports, held against traces of the motion, and its missed solutions.

Each task is a random four-bar with four positions, in one of four with a position in the other
assembly mode. A trace by small steps of the crank is the truth. Poses and rotations of a random
four-bar are further tasks, whose solutions must contain that four-bar.
"""

import sys
import time

from klann_ros.synthesis import burmester_points, function_generators, PlacedFourBar, PlanePose
import numpy as np
from support.aims import exit_code, sized
from traced_four_bars import is_traced, random_task, with_positions

TASKS, RECOVERED = sized(20, 2000, 10_000), sized(10, 2000, 10_000)


def main() -> int:
    """Print the number of wrong verdicts and of missed solutions; return 0 if there is none."""
    rng = np.random.default_rng(7)
    wrong = sound = 0
    for k in range(TASKS):
        flip = int(rng.integers(1, 4)) if k % 4 == 0 else None
        linkage = with_positions(*random_task(rng, 4), flip)
        sound += linkage.is_sound
        wrong += linkage.is_sound != is_traced(linkage)
    print(f'{TASKS} tasks, {sound} without a defect: {wrong} wrong verdicts, aim 0')
    tasks = [with_positions(*random_task(rng, 5)) for _ in range(RECOVERED)]
    begin = time.perf_counter()
    dyads = sum(map(_missed_dyads, tasks))
    mean = (time.perf_counter() - begin) / RECOVERED * 1e3
    print(f'{RECOVERED} tasks of five poses: {dyads} dyads missed, aim 0; {mean:.1f} ms each')
    functions = sum(map(_missed_functions, tasks))
    print(f'{3 * RECOVERED} functions of three to five points: {functions} missed, aim 0')
    return exit_code(wrong == 0, dyads == 0, functions == 0)


def _missed_dyads(linkage: PlacedFourBar) -> int:
    poses = [PlanePose(p, float(np.angle(b - a))) for a, b, p in linkage.positions]
    dyads = burmester_points(poses)
    return sum(
        all(abs(dyad.pivot - pivot) + abs(dyad.pin - pin) > 1e-4 for dyad in dyads)
        for pivot, pin in zip((linkage.o2, linkage.o4), linkage.positions[0][:2], strict=True)
    )


def _missed_functions(linkage: PlacedFourBar) -> int:
    """Return how many tasks of three, four and five pairs of rotations lack the four-bar."""
    phi = np.array(linkage.thetas) - linkage.thetas[0]
    rockers = np.array([b - linkage.o4 for _, b, _ in linkage.positions])
    psi, ground = np.angle(rockers / rockers[0]), linkage.geometry.ground
    starts = {'input_start': linkage.thetas[0], 'output_start': float(np.angle(rockers[0]))}
    missed = 0
    for count, names in ((3, [*starts]), (4, ['input_start']), (5, [])):
        given = {name: starts[name] for name in names}
        found = function_generators(phi[:count], psi[:count], ground=ground, **given)
        wanted = linkage.geometry.lengths
        missed += not any(np.allclose(each.geometry.lengths, wanted, rtol=1e-4) for each in found)
    return missed


if __name__ == '__main__':
    sys.exit(main())
