"""
Whole turns of many linkages: the feet and their derivatives, of everything else the extremes.

With the links A and B of a dyad and d = |A + B|^2, the angle between them from one line is

    atan2(|A x B|, |A . B|),    A . B = (d - |A|^2 - |B|^2) / 2,

least where |A x B| is: it is computed there and at the neighbours alone.
"""

from math import pi
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import parabola_peak
import numpy as np

from .kernels import choose_kernel
from .poses import linkage_poses
from .program import compile_program, constants, PathTerms

# Poses solved before their extremes are taken: larger blocks leave the second-level cache.
TURNS_BLOCK = 32_768


class Turns(NamedTuple):
    """
    Turns of n linkages at k equal steps of the crank.

    `h`, shape (2, n, k), is the foot [m], NaN where a pose is missing, and `h_1` its derivative by
    the crank angle [m/rad], NaN at singular poses too. `missing` is the share of missing poses,
    `transmission_angle` the worst, from links in line [rad], shapes (n,); `box` the extents of all
    points, shape (2, n) [m].
    """

    h: FloatArray
    h_1: FloatArray
    missing: FloatArray
    transmission_angle: FloatArray
    box: FloatArray | None


def whole_turns(
    variants: Variants, count: int, *, box: bool = False, kernel: str | None = None
) -> Turns:
    """Return turns at `count` crank angles, the first of which is 0."""
    alphas = np.arange(count, dtype=np.float64) * (TURN / count)
    if variants.base.two_circles:
        return _pinned_turns(variants, alphas, choose_kernel(kernel, len(variants) * count), box)
    poses: Any = linkage_poses(
        variants, alphas, velocities=True, transmission_angles=True, points=box, kernel=kernel
    )
    inward = np.minimum(poses.transmission_angles, pi - poses.transmission_angles)
    least = [
        _least(np.take_along_axis(each, _around(each), 1)) for each in inward.transpose(2, 0, 1)
    ]
    return Turns(
        poses.h.transpose(2, 0, 1),
        poses.h_1.transpose(2, 0, 1),
        (poses.reason != 0).mean(axis=1),
        np.min(least, axis=0, initial=pi / 2.0),
        np.ptp(poses.points, axis=(1, 2)).T if box else None,
    )


def _pinned_turns(variants: Variants, alphas: FloatArray, kernel: Any, box: bool) -> Turns:
    """Run the program of pinned dyads."""
    structure, count, angles = variants.base.structure, len(variants), len(alphas)
    program = compile_program(structure, links=True, rates=True)
    terms = PathTerms(structure, *variants.vectors, variants.signs)
    own, dyads = constants(program, terms, count), range(len(program.distances))
    lengths = [[np.broadcast_to(np.abs(w), count) for w in terms.links(k)] for k in dyads]
    singular = [np.broadcast_to(terms.singular_determinant(k), count) for k in dyads]
    extents, points = np.empty((2 if box else 0, count)), len(program.points)
    names = [*program.foot, *(program.rates[name] for name in program.foot)]
    names += [*program.determinants, *program.distances]
    step = max(1, TURNS_BLOCK // angles)
    every = (*names, *(point[axis] for axis in range(len(extents)) for point in program.points))
    solver, crank = kernel(program, every, step * angles), kernel.crank(alphas)
    feet, least = np.empty((4, count, angles)), np.full(count, pi / 2.0)
    with np.errstate(all='ignore'):
        for first in range(0, count, step):
            rows = slice(first, min(first + step, count))
            numbers, _ = solver.run(own, rows, crank)
            feet[:, rows] = numbers[:4]
            for k in dyads:
                sines, distances = np.abs(numbers[4 + k]), numbers[4 + len(dyads) + k]
                near = _around(sines)
                at, d = (np.take_along_axis(of, near, 1) for of in (sines, distances))
                r_a, r_b = (length[rows, None] for length in lengths[k])
                between = np.arctan2(at, np.abs(d - r_a * r_a - r_b * r_b) / 2.0)
                least[rows] = np.minimum(least[rows], _least(between))
                limit = singular[k][rows]
                if (at[:, 1] <= limit).any():
                    feet[2:, rows][:, sines <= limit[:, None]] = np.nan
            for axis, extent in enumerate(extents):
                start = len(names) + axis * points
                some = numbers[slice(start, start + points)]
                high = np.max([number.max(axis=1) for number in some], axis=0)
                extent[rows] = high - np.min([number.min(axis=1) for number in some], axis=0)
    return Turns(
        feet[:2], feet[2:], np.isnan(feet[0]).mean(axis=1), least, extents if box else None
    )


def _around(values: FloatArray) -> IndexArray:
    """Return the place of the least of each row, between its neighbours, shape (n, 3)."""
    middle = values.argmin(axis=1)[:, None]
    return np.asarray((middle + np.array([-1, 0, 1])) % values.shape[1], dtype=np.intp)


def _least(three: FloatArray) -> FloatArray:
    """Return the least of functions of which three values around it are known, shape (n, 3)."""
    return -parabola_peak(*(-three.T))
