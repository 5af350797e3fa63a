"""The reach of a linkage's crank: the arcs of crank angles where every loop closes."""

from cmath import phase
from math import atan2, pi, sqrt
from sys import float_info
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc, arcs_inside, normalize_arcs
from klann_ros.kinematics.errors import LoopsOpenError, UnreachableError

from .blocks import Block
from .linkage import as_linkage, Linkage
from .pose import closed_form_vectors

Lengths = tuple[float, float, float, float]


def reachable_arcs(linkage: Any) -> list[Arc]:
    """
    Return the arcs of crank angles where every loop closes in the linkage's assembly mode.

    Of a dyad that the crank alone drives they follow in closed form, less 1e-12 of their length,
    since rounding decides what closes at their very ends; within them the others' clearance is
    searched for its zeros, and these are bisected to 1e-12 rad.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.

    Returns
    -------
    list of (float, float)
        Start and end of each arc, start < end, start in [0, 2 pi) [rad]; `[(0, 2 pi)]` for a
        crank that turns fully, empty where nothing closes.

    Raises
    ------
    TypeError
        `linkage` is none of these.

    """
    linkage = as_linkage(linkage)
    first, rest = linkage.blocks[0], linkage.blocks[1:]
    if not linkage.is_dyadic:
        arcs = [linkage.branch.arc]
        rest = tuple(block for block in linkage.blocks if block.is_dyad)
    elif is_driven(first):
        arcs = driven_arcs(first)
    else:
        arcs, rest = [(0.0, TURN)], linkage.blocks
    if not rest:
        return normalize_arcs([_trim_ends(arc) for arc in arcs] if linkage.is_dyadic else arcs)

    def clearance(alpha: float) -> float:
        """Return the clearance of the dyad that fails [m], else the least of all."""
        try:
            u = closed_form_vectors(linkage, alpha)
        except UnreachableError as error:
            # Where the ends of a dyad coincide nothing closes, although nothing is short.
            return min(-error.shortfall, -float_info.min)
        except LoopsOpenError:
            return -float_info.min
        return float(max(0.0, min(block.clearance(u) for block in rest)))

    return normalize_arcs([found for arc in arcs for found in arcs_inside(clearance, arc)])


def closes_somewhere(linkage: Linkage) -> bool:
    """Return whether every loop closes at any crank angle."""
    # Nearly every linkage closes at one of a few angles; only the others are searched.
    return any(_closes_at(linkage, k * TURN / 8.0) for k in range(8)) or bool(
        reachable_arcs(linkage)
    )


def is_driven(block: Block) -> bool:
    """Return whether a block is a dyad of two links whose ends the crank alone moves."""
    (terms, _), *others = block.rows
    return not others and not block.slides and {0, *block.unknowns} == terms.keys()


def driven_arcs(block: Block) -> list[Arc]:
    """Return the arcs where a dyad closes that the crank alone drives [rad]."""
    terms, constant = block.rows[0]
    a, b = block.unknowns
    lengths = abs(constant), abs(terms[0]), abs(terms[a]), abs(terms[b])
    if not four_bar_closes(lengths):
        return []
    least, greatest = crank_limits(lengths) if constant else (0.0, pi)
    # Where the crank points to the fixed end.
    toward = block.structure.senses[0] * phase(-constant / terms[0])
    if least == 0.0 and greatest == pi:
        return [(0.0, TURN)]
    if least == 0.0:
        return [(toward - greatest, toward + greatest)]
    if greatest == pi:
        return [(toward + least, toward + TURN - least)]
    return [(toward + least, toward + greatest), (toward - greatest, toward - least)]


def four_bar_closes(lengths: Lengths) -> bool:
    """Return whether a four-bar closes at any crank angle, within rounding."""
    l_1, l_2, l_3, l_4 = lengths
    rounding = length_rounding(lengths)
    return l_1 + l_2 >= abs(l_3 - l_4) - rounding and abs(l_1 - l_2) <= l_3 + l_4 + rounding


def crank_limits(lengths: Lengths) -> tuple[float, float]:
    """
    Return the least and the greatest crank angle of a four-bar, from the ground.

    Both are in [0, pi] [rad]. |A O4| grows with the angle, so the least is where coupler and
    rocker are folded, |A O4| = |L3 - L4|, and the greatest where they are stretched out, |A O4| =
    L3 + L4; 0 and pi where the crank passes without such a limit. Where they only touch it, at a
    change point, it passes. Of the reversed linkage, L1, L4, L3, L2, it is pi - theta4 that is
    limited.
    """
    l_1, l_2, l_3, l_4 = lengths
    folded, stretched, rounding = abs(l_3 - l_4), l_3 + l_4, length_rounding(lengths)
    passes_folded = abs(l_1 - l_2) >= folded - rounding
    passes_stretched = l_1 + l_2 <= stretched + rounding
    least = 0.0 if passes_folded else triangle_angle(l_1, l_2, folded)
    greatest = pi if passes_stretched else triangle_angle(l_1, l_2, stretched)
    return least, greatest


def length_rounding(lengths: Lengths) -> float:
    """Return the rounding of a difference of two sums of two lengths [m]."""
    return 4.0 * float_info.epsilon * max(lengths)


def _closes_at(linkage: Linkage, alpha: float) -> bool:
    try:
        closed_form_vectors(linkage, alpha)
    except (UnreachableError, LoopsOpenError):
        return False
    return True


def _trim_ends(arc: Arc) -> Arc:
    """Return an arc without its very ends."""
    start, end = arc
    cut = 0.0 if end - start >= TURN else 5e-13 * (end - start)
    return start + cut, end - cut


def triangle_angle(p: float, q: float, opposite: float) -> float:
    """
    Return the angle between two sides of a triangle, in [0, pi] [rad].

    From tan(angle / 2)^2 = (o - (p - q)) (o + (p - q)) / ((p + q - o) (p + q + o)), which keeps
    its digits near 0 and pi; the law of cosines loses half of them there.
    """
    near = (opposite - (p - q)) * (opposite + (p - q))
    far = (p + q - opposite) * (p + q + opposite)
    return 2.0 * atan2(sqrt(max(0.0, near)), sqrt(max(0.0, far)))
