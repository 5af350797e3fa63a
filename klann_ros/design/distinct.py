"""
Which legs are the same one: those whose joints move alike, relative to their size.

Names, the order of links, the place in the plane, the size, and a mirror image do not count;
neither does a rotation where requirements leave it free. Cognates have other bars: they differ.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from klann_ros.kinematics import Linkage, linkage_poses
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray
import numpy as np

# Crank angles of a shape, an even number, and the median distance of the joints of one leg from
# those of another up to which they are the same, relative to the rms distance from their centre.
# The median: near a dead point joints move far by a change below any workshop's tolerance.
SHAPE_ANGLES = 24
SAME_SHAPE = 0.01


@lru_cache(maxsize=4096)
def leg_shape(linkage: Linkage, *, can_turn: bool) -> ComplexArray:
    """
    Return the motion of all joints over a turn, shape (2, j, k), and its mirror image.

    Relative to their centre and their rms distance from it; with `can_turn` also to the direction
    of the crank's axle.
    """
    steps = np.arange(SHAPE_ANGLES)
    alphas = TURN / SHAPE_ANGLES * steps
    points = _points(linkage, alphas)
    centre = points.mean()
    direction = 1.0 + 0j
    # A mirror in the vertical makes alpha pi - alpha.
    mirrored_steps = SHAPE_ANGLES // 2 - steps
    if can_turn:
        axle = linkage.structure.points.index(linkage.structure.bodies[0].bars[0].start)
        direction = np.exp(1j * np.angle(points[axle, 0] - centre))
        points = _points(linkage, alphas + np.angle(direction))
        mirrored_steps = -steps
    # A leg that jams has no numbers.
    with np.errstate(invalid='ignore'):
        shape = (points - centre) / direction
        shape /= np.sqrt((np.abs(shape) ** 2).mean())
    mirror_image = np.conj(shape[:, mirrored_steps])
    return np.stack([shape, mirror_image if can_turn else -mirror_image])


def _points(linkage: Linkage, alphas: Any) -> ComplexArray:
    """Return the joints of a linkage, shape (j, k) [m]."""
    poses: Any = linkage_poses(linkage, alphas, points=True)
    return np.asarray((poses.points @ (1.0, 1j)).T, dtype=np.complex128)


def shape_distance(first: ComplexArray, second: ComplexArray) -> float:
    """Return the distance of two shapes: of the joint that is farthest from any of the other's."""
    # Of each joint from each, shape (2, j, j).
    distances = np.median(np.abs(first[0][None, :, None] - second[:, None]), axis=-1)
    farthest = np.maximum(distances.min(axis=2).max(axis=1), distances.min(axis=1).max(axis=1))
    return float(farthest.min())


def is_same_leg(linkage: Linkage, linkages: Iterable[Linkage], *, can_turn: bool) -> bool:
    """Return whether a leg is the same as one of others."""
    shape = leg_shape(linkage, can_turn=can_turn)
    for listed_linkage in linkages:
        if shape_distance(shape, leg_shape(listed_linkage, can_turn=can_turn)) <= SAME_SHAPE:
            return True
    return False
