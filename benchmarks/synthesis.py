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

TASKS = sized(20, 2000, 10_000)
RECOVERED = sized(10, 2000, 10_000)


def main() -> int:
    """Print the number of wrong verdicts and of missed solutions; return 0 if there is none."""
    rng = np.random.default_rng(7)
    wrong_verdicts = sound = 0
    for k in range(TASKS):
        flip = int(rng.integers(1, 4)) if k % 4 == 0 else None
        linkage = with_positions(*random_task(rng, 4), flip)
        sound += linkage.is_sound
        wrong_verdicts += linkage.is_sound != is_traced(linkage)
    print(f'{TASKS} tasks, {sound} without a defect: {wrong_verdicts} wrong verdicts, aim 0')
    linkages = [with_positions(*random_task(rng, 5)) for _ in range(RECOVERED)]
    start_time = time.perf_counter()
    dyads = sum(map(_count_missed_dyads, linkages))
    mean = (time.perf_counter() - start_time) / RECOVERED * 1e3
    print(f'{RECOVERED} tasks of five poses: {dyads} dyads missed, aim 0; {mean:.1f} ms each')
    functions = sum(map(_count_missed_functions, linkages))
    print(f'{3 * RECOVERED} functions of three to five points: {functions} missed, aim 0')
    return exit_code(wrong_verdicts == 0, dyads == 0, functions == 0)


def _count_missed_dyads(linkage: PlacedFourBar) -> int:
    poses = [PlanePose(p, float(np.angle(b - a))) for a, b, p in linkage.positions]
    dyads = np.array([(dyad.pivot, dyad.pin) for dyad in burmester_points(poses)]).reshape(-1, 2)
    a, b, _ = linkage.positions[0]
    missed = 0
    for pivot, pin in ((linkage.o2, a), (linkage.o4, b)):
        distances = np.abs(dyads - (pivot, pin)).sum(axis=1)
        missed += distances.min(initial=np.inf) > 1e-4
    return missed


def _count_missed_functions(linkage: PlacedFourBar) -> int:
    """Return how many tasks of three, four and five pairs of rotations lack the four-bar."""
    phi = np.array(linkage.thetas) - linkage.thetas[0]
    rockers = np.array([b for _, b, _ in linkage.positions]) - linkage.o4
    psi = np.angle(rockers / rockers[0])
    input_start = {'input_start': linkage.thetas[0]}
    both_starts = {**input_start, 'output_start': float(np.angle(rockers[0]))}
    lengths = linkage.geometry.lengths
    missed = 0
    for count, starts in ((3, both_starts), (4, input_start), (5, {})):
        four_bars = function_generators(
            phi[:count], psi[:count], ground=linkage.geometry.ground, **starts
        )
        missed += not any(np.allclose(f.geometry.lengths, lengths, rtol=1e-4) for f in four_bars)
    return missed


if __name__ == '__main__':
    sys.exit(main())
