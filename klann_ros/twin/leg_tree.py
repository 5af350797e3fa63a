"""
A linkage as a tree of bodies, and what closes its loops.

Every body hangs at a point that it shares with one before it, or slides along it; where two bodies
lead to the same point otherwise, an equality closes the loop.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from klann_ros.dynamics.motion import motion
from klann_ros.kinematics import Linkage, LinkageLeg
from klann_ros.kinematics.linkage.structure import FIXED, Structure


class Hung(NamedTuple):
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


def tree(linkage: Linkage) -> tuple[list[Hung], list[Closing]]:
    """Return how the bodies hang, each after its parent, and what closes the loops."""
    structure = linkage.structure
    placed: list[int] = [FIXED]
    hung: list[Hung] = []
    while len(hung) < len(structure.bodies):
        hung.append(next(_next_hung(structure, placed)))
        placed.append(hung[-1].body)
    joined = {(h.point, h.parent, h.body) for h in hung if not structure.bodies[h.body].slides}
    closing = []
    for point, every in structure.owners.items():
        # One of its bodies has the point; the others hang at it, or are pulled to it.
        first = next((h.parent for h in hung if h.point == point and h.parent in every), every[0])
        closing += [
            Closing(point, first, j)
            for j in every
            if j != first and (point, first, j) not in joined
        ]
    return hung, closing


def joint_rates(linkage: Linkage, hung: Sequence[Hung], alpha: float) -> dict[int, float]:
    """Return what each body's joint in the tree does as the crank turns [rad/rad, m/rad]."""
    moving, leg = motion(linkage, alpha), LinkageLeg(linkage)
    sliding = leg.velocity(leg.closed_form(alpha), 1.0).joints
    rates = {}
    for j, parent, _ in hung:
        before = moving.turning_1[parent, 0] if parent >= 0 else 0.0
        turns = float(moving.turning_1[j, 0] - before)
        rates[j] = sliding[j] if linkage.structure.bodies[j].slides else turns
    return rates


def _next_hung(structure: Structure, placed: list[int]) -> Iterator[Hung]:
    for j, body in enumerate(structure.bodies):
        along = structure.along[j]
        if j in placed:
            continue
        if along is not None:
            if along in placed:
                yield Hung(j, along, body.points[0])
            continue
        for point in body.points:
            parent = next((i for i in structure.owners[point] if i in placed), None)
            if parent is not None:
                yield Hung(j, parent, point)
