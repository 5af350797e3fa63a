"""
The defects that synthesis reports, held against traces of the motion, and its speed.

Each task is a random four-bar with four positions, in one of four with a position in the other
assembly mode. A trace by small steps of the crank is the truth.
"""

import sys
import time

from klann_ros.synthesis import burmester_points, PlanePose
import numpy as np
from support.aims import exit_code, SMOKE
from traced_four_bars import is_traced, random_task, with_positions

TASKS, FIVE_POSES = (20, 10) if SMOKE else (10_000, 1000)


def main() -> int:
    """Print the number of wrong verdicts and of missed dyads; return 0 if there is none."""
    rng = np.random.default_rng(7)
    wrong = sound = 0
    for k in range(TASKS):
        flip = int(rng.integers(1, 4)) if k % 4 == 0 else None
        linkage = with_positions(*random_task(rng, 4), flip)
        sound += linkage.is_sound
        wrong += linkage.is_sound != is_traced(linkage)
    print(f'{TASKS} tasks, {sound} without a defect: {wrong} wrong verdicts, aim 0')
    missed, seconds = 0, 0.0
    for _ in range(FIVE_POSES):
        linkage, thetas = random_task(rng, 5)
        positions = [linkage.at(theta) for theta in thetas]
        poses = [PlanePose(each.p, float(np.angle(each.b - each.a))) for each in positions]
        begin = time.perf_counter()
        dyads = burmester_points(poses)
        seconds += time.perf_counter() - begin
        for pivot, pin in ((linkage.o2, linkage.a), (linkage.o4, linkage.b)):
            missed += all(abs(d.pivot - pivot) + abs(d.pin - pin) > 1e-4 for d in dyads)
    mean = seconds / FIVE_POSES * 1e3
    print(f'{FIVE_POSES} tasks of five poses: {missed} dyads missed, aim 0; {mean:.1f} ms each')
    return exit_code(wrong == 0, missed == 0)


if __name__ == '__main__':
    sys.exit(main())
