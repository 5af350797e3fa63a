"""Where a leg's crank can be: the arcs of crank angles at which both dyads close."""

from math import acos, atan2, hypot, pi
from sys import float_info
from typing import TYPE_CHECKING

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc, arcs_inside, normal

from .closed_form import clearances

if TYPE_CHECKING:
    from .geometry import KlannGeometry


def reachable_arcs(geometry: 'KlannGeometry') -> list[Arc]:
    """
    Return the arcs of crank angles at which both dyads close in the geometry's assembly.

    The first dyad's arcs follow from |BD| in closed form, less 1e-12 of their length, since
    rounding decides what closes at their very ends; within them the second dyad's clearance is
    searched for its zeros, and they are bisected to 1e-12 rad.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.

    Returns
    -------
    list of (float, float)
        Start and end of each arc, start < end, start in [0, 2 pi) [rad]; `[(0, 2 pi)]` for a
        crank that turns fully, empty where nothing closes.

    Raises
    ------
    TypeError
        `geometry` is no KlannGeometry.

    """

    def inside(alpha: float) -> float:
        return _clearance(geometry, alpha)

    try:
        first_dyad = _first_dyad_arcs(geometry)
    except AttributeError:
        # The class itself is not known here: it asks whether its legs close.
        msg = f'geometry = {geometry!r} is refused: it must be a KlannGeometry'
        raise TypeError(msg) from None
    return normal([arc for first in first_dyad for arc in arcs_inside(inside, first)])


def closes_somewhere(geometry: 'KlannGeometry') -> bool:
    """Return whether there is a crank angle at all at which both dyads close."""
    # Nearly every leg closes at one of a few angles; only the others are searched.
    quick = (k * TURN / 8.0 for k in range(8))
    return any(_clearance(geometry, alpha) >= 0.0 for alpha in quick) or bool(
        reachable_arcs(geometry)
    )


def _clearance(geometry: 'KlannGeometry', alpha: float) -> float:
    """Return the clearance of the dyad that fails, or else of the second [m]."""
    first, second = clearances(geometry, alpha)
    # Where B and D coincide nothing closes, although the distance is within reach.
    return min(first, -float_info.min) if second is None else second


def _first_dyad_arcs(geometry: 'KlannGeometry') -> list[Arc]:
    """
    Return the arcs at which dyad 1 closes.

    |BD|^2 = L_AB^2 + |AD|^2 - 2 L_AB |AD| cos(alpha - phi), with phi the direction from A to D.
    """
    g = geometry
    ad, direction = hypot(g.x_d, g.y_a), atan2(-g.y_a, g.x_d)
    if ad == 0.0:
        return [(0.0, TURN)] if abs(g.l_bc - g.l_dc) <= g.l_ab <= g.l_bc + g.l_dc else []

    def opening(reach: float) -> float:
        cosine = (g.l_ab**2 + ad**2 - reach**2) / (2.0 * g.l_ab * ad)
        return acos(min(1.0, max(-1.0, cosine)))

    nearest, farthest = abs(g.l_ab - ad), g.l_ab + ad
    folded, stretched = abs(g.l_bc - g.l_dc), g.l_bc + g.l_dc
    if farthest < folded or nearest > stretched:
        return []
    low, high = opening(folded), opening(stretched)
    if low == 0.0 and high == pi:
        return [(0.0, TURN)]
    if low == 0.0:
        return [(direction - high, direction + high)]
    if high == pi:
        return [(direction + low, direction + TURN - low)]
    return [(direction + low, direction + high), (direction - high, direction - low)]
