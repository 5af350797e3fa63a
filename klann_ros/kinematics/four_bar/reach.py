"""Where a four-bar's crank can be: the arcs of crank angles at which coupler and rocker meet."""

from math import atan2, pi, sqrt

from klann_ros.kinematics.angles import TURN

from .grashof import Grashof, Lengths, ROTATES, tie

Arc = tuple[float, float]


def limits(lengths: Lengths) -> tuple[float, float]:
    """
    Return the least and the greatest |theta2| at which the linkage closes, in [0, pi] [rad].

    |A O4| grows with |theta2|, so the least is where coupler and rocker are folded, |A O4| =
    |L3 - L4|, and the greatest where they are stretched out, |A O4| = L3 + L4; 0 and pi where
    the crank passes without such a limit. Where they only touch it, at a change point, it passes.

    Parameters
    ----------
    lengths : tuple of float
        L1 to L4 [m], of a linkage that closes. Of the reversed linkage, L1, L4, L3, L2, it is
        pi - theta4 that is limited.

    """
    l_1, l_2, l_3, l_4 = lengths
    if Grashof(lengths).roles.crank == ROTATES:
        return 0.0, pi
    folded, stretched, rounding = abs(l_3 - l_4), l_3 + l_4, tie(lengths)
    passes_folded = abs(l_1 - l_2) >= folded - rounding
    passes_stretched = l_1 + l_2 <= stretched + rounding
    least = 0.0 if passes_folded else _opening(l_1, l_2, folded)
    greatest = pi if passes_stretched else _opening(l_1, l_2, stretched)
    return least, greatest


def reachable_arcs(lengths: Lengths) -> list[Arc]:
    """
    Return the arcs of crank angles at which the linkage closes; both assemblies have the same.

    Less 1e-12 of their length, since rounding decides what closes at their very ends.

    Parameters
    ----------
    lengths : tuple of float
        L1 to L4 [m], of a linkage that closes.

    Returns
    -------
    list of (float, float)
        Start and end of each arc, start < end, start in [0, 2 pi) [rad]; `[(0, 2 pi)]` for a
        crank that turns fully.

    """
    least, greatest = limits(lengths)
    if least == 0.0 and greatest == pi:
        return [(0.0, TURN)]
    if least == 0.0:
        arcs = [(TURN - greatest, TURN + greatest)]
    elif greatest == pi:
        arcs = [(least, TURN - least)]
    else:
        arcs = [(least, greatest), (TURN - greatest, TURN - least)]
    return [(start + (cut := 5e-13 * (end - start)), end - cut) for start, end in arcs]


def _opening(p: float, q: float, opposite: float) -> float:
    """
    Return the angle between two sides of a triangle, in [0, pi] [rad].

    From tan(angle / 2)^2 = (o - (p - q)) (o + (p - q)) / ((p + q - o) (p + q + o)), which keeps
    its digits near 0 and pi; the law of cosines loses half of them there.
    """
    near = (opposite - (p - q)) * (opposite + (p - q))
    far = (p + q - opposite) * (p + q + opposite)
    return 2.0 * atan2(sqrt(max(0.0, near)), sqrt(max(0.0, far)))
