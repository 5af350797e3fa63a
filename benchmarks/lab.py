"""
Hold the lab's solver to the kinematics: scripts/benchmark lab, or lab.py [POSES] by itself.

Both solve random legs of every shipped linkage at random crank angles (10,000 poses by default,
with --full 100,000). The table has the largest distance between their points, and the number of
poses that close for one solver only. It needs node, and `test` in PYTHONPATH.
"""

import sys
import time

from klann_ros.kinematics import GeometryError, linkage_poses, shipped_linkage, shipped_linkages
from lab_solver import poses_in_node, varied_numbers
import numpy as np
from support.aims import sized

ANGLES = 100
# Coupled loops are followed all round for each leg.
COUPLED_ANGLES = sized(100, 1000)
# Sine of the transmission angle below which a pose is ill conditioned.
IN_LINE = 0.02


def compare(name: str, poses: int) -> str:
    """Return a row of the table."""
    base = shipped_linkage(name)
    rng = np.random.default_rng(1)
    angle_count = ANGLES if base.is_dyadic else COUPLED_ANGLES
    leg_count = max(1, poses // angle_count)
    numbers = varied_numbers(base.numbers, rng, leg_count, 0.1 if base.is_dyadic else 0.02)
    alphas = rng.uniform(-7.0, 7.0, (leg_count, angle_count))
    pairs = zip(numbers.tolist(), alphas.tolist(), strict=True)
    legs = [{'numbers': leg_numbers, 'alphas': leg_alphas} for leg_numbers, leg_alphas in pairs]
    start_time = time.perf_counter()
    lab_legs = poses_in_node({name: legs})[name]
    seconds = time.perf_counter() - start_time
    closed = jammed = refused = contradictions = 0
    max_distance = max_weighted_distance = 0.0
    for leg_numbers, leg_alphas, lab_poses in zip(numbers, alphas, lab_legs, strict=True):
        try:
            linkage = base.varied(dict(zip(base.dimensions, leg_numbers, strict=True)))
            leg_points = linkage_poses(linkage, leg_alphas, points=True).points
            assert leg_points is not None  # noqa: S101 - asked for
        except GeometryError:
            refused += 1
            contradictions += 'refused' not in lab_poses
            continue
        for lab_pose, points in zip(lab_poses, leg_points, strict=True):
            closes = not np.isnan(points).any()
            contradictions += ('points' in lab_pose) != closes
            jammed += not closes
            if closes and 'points' in lab_pose:
                closed += 1
                distance = np.abs(np.array(lab_pose['points']) - points).max()
                distance /= max(1.0, linkage.size)
                max_weighted_distance = max(max_weighted_distance, distance * lab_pose['sine'])
                if lab_pose['sine'] > IN_LINE:
                    max_distance = max(max_distance, distance)
    counts = f'{closed:9}{jammed:9}{refused:9}{contradictions:9}'
    return f'{name:18}{counts}{max_distance:12.1e}{max_weighted_distance:12.1e}{seconds:8.1f}'


if __name__ == '__main__':
    pose_count = int(sys.argv[1]) if len(sys.argv) > 1 else sized(100, 10_000, 100_000)
    heads = f'{"linkage":18}{"closed":>9}{"jammed":>9}{"refused":>9}{"disagree":>9}'
    print(f'{heads}{"apart/m":>12}{"* |sin|":>12}{"s":>8}')
    for linkage_name in shipped_linkages()[: sized(3, None)]:
        print(compare(linkage_name, pose_count), flush=True)
