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
# Nearer to in line a pose itself is ill conditioned.
IN_LINE = 0.02


def compare(name: str, poses: int) -> str:
    """Return a row of the table."""
    base, rng = shipped_linkage(name), np.random.default_rng(1)
    angles, share = (ANGLES, 0.1) if base.is_dyadic else (COUPLED_ANGLES, 0.02)
    legs = max(1, poses // angles)
    numbers = varied_numbers(base.numbers, rng, legs, share)
    alphas = rng.uniform(-7.0, 7.0, (legs, angles))
    pairs = zip(numbers.tolist(), alphas.tolist(), strict=True)
    begin = time.perf_counter()
    found = poses_in_node({name: [{'numbers': one, 'alphas': at} for one, at in pairs]})[name]
    seconds = time.perf_counter() - begin
    closed = jammed = refused = apart = 0
    farthest = weighted = 0.0
    for row, at, ours in zip(numbers, alphas, found, strict=True):
        try:
            linkage = base.varied(dict(zip(base.dimensions, row, strict=True)))
            points = linkage_poses(linkage, at, points=True).points
            assert points is not None  # noqa: S101 - asked for
        except GeometryError:
            refused += 1
            apart += 'refused' not in ours
            continue
        for pose, theirs in zip(ours, points, strict=True):
            closes = not np.isnan(theirs).any()
            apart += ('points' in pose) != closes
            jammed += not closes
            if closes and 'points' in pose:
                closed += 1
                off = np.abs(np.array(pose['points']) - theirs).max() / max(1.0, linkage.size)
                weighted = max(weighted, off * pose['sine'])
                farthest = max(farthest, off if pose['sine'] > IN_LINE else 0.0)
    row = f'{name:18}{closed:9}{jammed:9}{refused:9}{apart:9}'
    return f'{row}{farthest:12.1e}{weighted:12.1e}{seconds:8.1f}'


if __name__ == '__main__':
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else sized(100, 10_000, 100_000)
    heads = f'{"linkage":18}{"closed":>9}{"jammed":>9}{"refused":>9}{"disagree":>9}'
    print(f'{heads}{"apart/m":>12}{"* |sin|":>12}{"s":>8}')
    for one in shipped_linkages()[: sized(3, None)]:
        print(compare(one, wanted), flush=True)
