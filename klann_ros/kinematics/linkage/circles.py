"""
The geometric method: two circles a dyad, or what `dyads` has for it, and no iteration.

It shares no equation with the Newton solver, so each is the other's oracle. Coupled loops have no
closed form: theirs is the nearest pose of their branch, refined.
"""

from cmath import rect

from . import joints
from .linkage import Linkage


def placed(linkage: Linkage, alpha: float) -> list[complex]:
    """
    Return the vectors of all bodies at a crank angle [rad], in the linkage's assembly.

    An UnreachableError says which dyad does not close there, a LoopsOpenError which loops.
    """
    senses = linkage.structure.senses
    u = [rect(1.0, senses[0] * alpha), *[0j] * (len(senses) - 1)]
    known: tuple[float, ...] | None = None
    for block, sign in zip(linkage.blocks, linkage.assembly, strict=True):
        if block.is_dyad:
            a, b = block.unknowns
            u[a], u[b] = block.place(u, alpha, sign)
            continue
        if known is None:
            known = linkage.branch.x(alpha)
        x = [alpha, *[0.0] * (len(senses) - 1)]
        for j in linkage.head_bodies[1:]:
            x[j] = known[linkage.head_bodies.index(j) - 1]
        moved = joints.vectors(linkage.structure, x)
        for j in block.unknowns:
            u[j] = complex(moved[j])
    return u


def seed(linkage: Linkage, alpha: float) -> tuple[float, ...]:
    """Return the other coordinates at a crank angle; parameters and errors as `placed`."""
    u, structure = placed(linkage, alpha), linkage.structure
    return tuple(float(joints.coordinate(structure, u, j)) for j in range(1, len(u)))
