"""
The geometric method: two circles a dyad, no iteration.

It shares no equation with the Newton solver, so each is the other's oracle. Coupled loops have no
closed form: theirs is the nearest pose of their branch, refined.
"""

from cmath import phase, rect
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .linkage import Linkage


def placed(linkage: 'Linkage', alpha: float) -> list[complex]:
    """
    Return the unit vectors of all bodies at a crank angle [rad], in the linkage's assembly.

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
        for j in block.unknowns:
            u[j] = rect(1.0, senses[j] * known[linkage.head_bodies.index(j) - 1])
    return u


def seed(linkage: 'Linkage', alpha: float) -> tuple[float, ...]:
    """Return the other angles at a crank angle [rad]; parameters and errors as `placed`."""
    u = placed(linkage, alpha)
    return tuple(s * phase(v) for s, v in zip(linkage.structure.senses[1:], u[1:], strict=True))
