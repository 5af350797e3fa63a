"""
A linkage as a tree of bodies, and what closes its loops.

Every body hangs at a point that it shares with one before it, or slides along it; where two bodies
lead to the same point otherwise, an equality closes the loop.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from klann_ros.dynamics.motion import body_motion
from klann_ros.kinematics import Linkage, LinkageLeg
from klann_ros.kinematics.linkage.structure import FIXED, Structure


class TreeBody(NamedTuple):
    """Where a body hangs in the tree."""

    # Which one.
    body: int
    # The one before it, -1 for the ground.
    parent: int
    # Where it turns, or slides.
    point: str


class Closing(NamedTuple):
    """What closes a loop: a point to which two bodies lead."""

    # Which one.
    point: str
    # The two bodies, -1 being the ground; the second is pulled to the first.
    first: int
    body: int


def spanning_tree(linkage: Linkage) -> tuple[list[TreeBody], list[Closing]]:
    """Return how the bodies hang, each after its parent, and what closes the loops."""
    structure = linkage.structure
    visited: list[int] = [FIXED]
    tree: list[TreeBody] = []
    while len(tree) < len(structure.bodies):
        tree.append(next(_next_bodies(structure, visited)))
        visited.append(tree[-1].body)
    joined = {(h.point, h.parent, h.body) for h in tree if not structure.bodies[h.body].slides}
    closing = []
    for point, every in structure.owners.items():
        # One of its bodies has the point; the others hang at it, or are pulled to it.
        first = next((h.parent for h in tree if h.point == point and h.parent in every), every[0])
        closing += [
            Closing(point, first, j)
            for j in every
            if j != first and (point, first, j) not in joined
        ]
    return tree, closing


def joint_rates(linkage: Linkage, tree: Sequence[TreeBody], alpha: float) -> dict[int, float]:
    """Return what each body's joint in the tree does as the crank turns [rad/rad, m/rad]."""
    moving, leg = body_motion(linkage, alpha), LinkageLeg(linkage)
    sliding = leg.velocity(leg.closed_form(alpha), 1.0).joints
    rates = {}
    for j, parent, _ in tree:
        before = moving.rotation_1[parent, 0] if parent >= 0 else 0.0
        turns = float(moving.rotation_1[j, 0] - before)
        rates[j] = sliding[j] if linkage.structure.bodies[j].slides else turns
    return rates


def _next_bodies(structure: Structure, visited: list[int]) -> Iterator[TreeBody]:
    for j, body in enumerate(structure.bodies):
        along = structure.along[j]
        if j in visited:
            continue
        if along is not None:
            if along in visited:
                yield TreeBody(j, along, body.points[0])
            continue
        for point in body.points:
            parent = next((i for i in structure.owners[point] if i in visited), None)
            if parent is not None:
                yield TreeBody(j, parent, point)
