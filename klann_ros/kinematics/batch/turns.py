"""
Whole turns of many linkages: the feet and their derivatives, of everything else the extremes.

With the links A and B of a dyad and d = |A + B|^2, the angle between them from one line is

    atan2(|A x B|, |A . B|),    A . B = (d - |A|^2 - |B|^2) / 2,

smallest where |A x B| is: it is computed there and at the neighbours alone.
"""

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray, with_short_repr
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import parabola_peak
from klann_ros.kinematics.validation import whole_number
from klann_ros.sanitize.text import refusal
import numpy as np

from .blockwise import changing_linkages
from .kernels import choose_kernel
from .poses import linkage_poses
from .program import compile_program, constants, PathTerms

# Poses solved before their extremes are taken: larger blocks leave the second-level cache.
TURNS_BLOCK = 32_768


@with_short_repr
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
    if not isinstance(variants, Variants):
        raise TypeError(refusal('variants', variants, 'Variants of a linkage'))
    alphas = np.arange(whole_number('count', count, 1), dtype=np.float64) * (TURN / count)
    if variants.base.two_circles and not changing_linkages(variants):
        return _pinned_turns(variants, alphas, choose_kernel(kernel, len(variants) * count), box)
    poses: Any = linkage_poses(
        variants, alphas, velocities=True, transmission_angles=True, points=box, kernel=kernel
    )
    from_line = np.minimum(poses.transmission_angles, pi - poses.transmission_angles)
    worst = np.full(len(variants), pi / 2.0)
    for angles in from_line.transpose(2, 0, 1):
        worst = np.minimum(worst, _minimum(np.take_along_axis(angles, _around_minimum(angles), 1)))
    return Turns(
        h=poses.h.transpose(2, 0, 1),
        h_1=poses.h_1.transpose(2, 0, 1),
        missing=(poses.reason != 0).mean(axis=1),
        transmission_angle=worst,
        box=np.ptp(poses.points, axis=(1, 2)).T if box else None,
    )


def _pinned_turns(variants: Variants, alphas: FloatArray, kernel: Any, box: bool) -> Turns:
    """Run the program of pinned dyads."""
    structure = variants.base.structure
    program = compile_program(structure, links=True, rates=True)
    terms = PathTerms(structure, *variants.vectors, variants.signs)
    count = len(variants)
    table = constants(program, terms, count)
    x, y = program.foot
    names = [x, y, program.rates[x], program.rates[y]]
    names += [*program.determinants, *program.distances]
    x_names, y_names = zip(*program.points, strict=True) if box else ((), ())
    step = max(1, TURNS_BLOCK // len(alphas))
    solver = kernel(program, (*names, *x_names, *y_names), step * len(alphas))
    crank = kernel.crank(alphas)
    dyads = range(len(program.distances))
    lengths = np.empty((len(dyads), 2, count, 1))
    for k in dyads:
        lengths[k, 0, :, 0], lengths[k, 1, :, 0] = terms.link_lengths(k)
    thresholds = terms.singular_determinants(count)[..., None]
    feet = np.empty((4, count, len(alphas)))
    worst = np.full(count, pi / 2.0)
    extents = np.empty((2, count)) if box else None
    with np.errstate(all='ignore'):
        for first in range(0, count, step):
            rows = slice(first, min(first + step, count))
            numbers, _ = solver.run(table, rows, crank)
            feet[:, rows] = numbers[:4]
            for k in dyads:
                determinants = np.abs(numbers[4 + k])
                distances = numbers[4 + len(dyads) + k]
                nearest = _around_minimum(determinants)
                cross = np.take_along_axis(determinants, nearest, 1)
                d = np.take_along_axis(distances, nearest, 1)
                r_a, r_b = lengths[k][:, rows]
                angles = np.arctan2(cross, np.abs(d - r_a * r_a - r_b * r_b) / 2.0)
                worst[rows] = np.minimum(worst[rows], _minimum(angles))
                threshold = thresholds[k, rows]
                if (cross[:, 1:2] <= threshold).any():
                    feet[2:, rows][:, determinants <= threshold] = np.nan
            if extents is not None:
                y_start = len(names) + len(x_names)
                extents[0, rows] = _extent(numbers[slice(len(names), y_start)])
                extents[1, rows] = _extent(numbers[y_start:])
    missing = np.isnan(feet[0]).mean(axis=1)
    return Turns(feet[:2], feet[2:], missing, worst, extents)


def _extent(coordinates: Sequence[FloatArray]) -> FloatArray:
    """Return the extent of the coordinates of all points over the turns, shape (n,) [m]."""
    high = np.max([coordinate.max(axis=1) for coordinate in coordinates], axis=0)
    low = np.min([coordinate.min(axis=1) for coordinate in coordinates], axis=0)
    return np.asarray(high - low)


def _around_minimum(samples: FloatArray) -> IndexArray:
    """Return the index of the minimum of each row, between its neighbours, shape (n, 3)."""
    middle = samples.argmin(axis=1)[:, None]
    return np.asarray((middle + np.array([-1, 0, 1])) % samples.shape[1], dtype=np.intp)


def _minimum(samples: FloatArray) -> FloatArray:
    """Return the minimum of functions by three samples around it, shape (n, 3)."""
    return -parabola_peak(*(-samples.T))
