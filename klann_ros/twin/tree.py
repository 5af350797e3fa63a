"""
The bodies of a leg as a tree, and the points where its loops close.

Each body is attached at a point that it shares with an earlier one, or slides along it; where two
bodies lead to the same point otherwise, a loop closes.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from klann_ros.dynamics import body_motion
from klann_ros.kinematics import FIXED, Linkage, LinkageLeg, Structure


class TreeBody(NamedTuple):
    """The place of a body in the tree."""

    body: int
    # Its parent, -1 for the ground.
    parent: int
    # Its point on the axis or the line.
    point: str


class Closing(NamedTuple):
    """The closing of a loop: a point to which two bodies lead."""

    point: str
    # The two bodies, -1 being the ground; the second is constrained to the first.
    first: int
    body: int


def spanning_tree(linkage: Linkage) -> tuple[list[TreeBody], list[Closing]]:
    """Return the tree, each body after its parent, and the closings of the loops."""
    structure = linkage.structure
    visited: list[int] = [FIXED]
    tree: list[TreeBody] = []
    while len(tree) < len(structure.bodies):
        tree.append(next(_next_bodies(structure, visited)))
        visited.append(tree[-1].body)
    joined = {(h.point, h.parent, h.body) for h in tree if not structure.bodies[h.body].slides}
    closing = []
    for point, owners in structure.owners.items():
        # One of its bodies has the point; the others are attached or constrained to it.
        parents = (h.parent for h in tree if h.point == point and h.parent in owners)
        first = next(parents, owners[0])
        for body in owners:
            is_joined = body == first or (point, first, body) in joined
            closing += [] if is_joined else [Closing(point, first, body)]
    return tree, closing


def _next_bodies(structure: Structure, visited: Sequence[int]) -> Iterator[TreeBody]:
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


def joint_rates(linkage: Linkage, tree: Sequence[TreeBody], alpha: float) -> dict[int, float]:
    """Return the rates of the tree's joints per crank rate [rad/rad, m/rad]."""
    moving, leg = body_motion(linkage, alpha), LinkageLeg(linkage)
    sliding = leg.velocity(leg.closed_form(alpha), 1.0).joints
    rates = {}
    for j, parent, _ in tree:
        parent_rate = moving.rotation_1[parent, 0] if parent >= 0 else 0.0
        turns = float(moving.rotation_1[j, 0] - parent_rate)
        rates[j] = sliding[j] if linkage.structure.bodies[j].slides else turns
    return rates
