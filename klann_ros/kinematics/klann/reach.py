"""Where a leg's crank can be: the arcs of crank angles at which both dyads close."""

from itertools import pairwise
from math import acos, atan2, cos, hypot, pi
from sys import float_info
from typing import TYPE_CHECKING

from klann_ros.kinematics.angles import TURN

from .closed_form import clearances

if TYPE_CHECKING:
    from collections.abc import Callable

    from .geometry import KlannGeometry

# How often the second dyad's clearance is sampled over an arc of the first.
SAMPLES = 360
GOLDEN = (5.0**0.5 - 1.0) / 2.0

Arc = tuple[float, float]


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

    """

    def inside(alpha: float) -> float:
        return _clearance(geometry, alpha)

    first_dyad = _first_dyad_arcs(geometry)
    return _normal([arc for first in first_dyad for arc in _arcs_inside(inside, first)])


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


def _arcs_inside(clearance: 'Callable[[float], float]', arc: Arc) -> list[Arc]:
    """Return the parts of an arc at which the clearance is not negative."""
    samples = _with_extrema(clearance, _samples(arc))
    arcs: list[Arc] = []
    start = samples[0] if clearance(samples[0]) >= 0.0 else None
    for left, right in pairwise(samples):
        closes_left, closes_right = clearance(left) >= 0.0, clearance(right) >= 0.0
        if closes_right and not closes_left:
            start = _boundary(clearance, right, left)
        elif closes_left and not closes_right and start is not None:
            arcs.append((start, _boundary(clearance, left, right)))
            start = None
    if start is not None:
        arcs.append((start, samples[-1]))
    return arcs


def _samples(arc: Arc) -> list[float]:
    """Return angles over an arc: the denser the nearer its ends, where clearances are steep."""
    middle, half = (arc[0] + arc[1]) / 2.0, (arc[1] - arc[0]) / 2.0
    if 2.0 * half >= TURN:
        return [arc[0] + k * TURN / SAMPLES for k in range(SAMPLES + 1)]
    # At the very ends the first dyad is in line, and rounding decides whether it closes.
    half *= 1.0 - 1e-12
    return [middle - half * cos(pi * k / SAMPLES) for k in range(SAMPLES + 1)]


def _with_extrema(clearance: 'Callable[[float], float]', samples: list[float]) -> list[float]:
    """Add the peaks and dips that the samples on their two sides may hide."""
    first, last = samples[0], samples[-1]
    if last - first >= TURN:
        # A whole turn goes on before its first sample.
        samples = [samples[-2] - TURN, *samples]
    values = [clearance(alpha) for alpha in samples]
    found = []
    neighbours = zip(samples, samples[2:], values, values[1:], values[2:], strict=False)
    for left, right, before, value, after in neighbours:
        if value < 0.0 and before <= value >= after:
            found.append(_peak(clearance, left, right))
        elif value >= 0.0 and before >= value <= after:
            found.append(_peak(lambda alpha: -clearance(alpha), left, right))
    turned = (alpha if alpha >= first else alpha + TURN for alpha in found)
    return sorted([*(alpha for alpha in samples if alpha >= first), *turned])


def _peak(function: 'Callable[[float], float]', left: float, right: float) -> float:
    """Return where a function with one peak between two angles is greatest (golden section)."""
    while right - left > 1e-9:
        a, b = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
        if function(a) > function(b):
            right = b
        else:
            left = a
    return (left + right) / 2.0


def _boundary(clearance: 'Callable[[float], float]', closes: float, fails: float) -> float:
    """Return the last angle that closes, by bisection."""
    while abs(closes - fails) > 1e-13 * max(1.0, abs(closes)):
        middle = (closes + fails) / 2.0
        if middle in (closes, fails):
            break
        closes, fails = (middle, fails) if clearance(middle) >= 0.0 else (closes, middle)
    return closes


def _normal(arcs: list[Arc]) -> list[Arc]:
    """Bring the arcs' starts into [0, 2 pi), sort them, and join the two ends of the turn."""
    turned = sorted(
        # A turn added and taken away again would cost the last digit.
        (start, end) if 0.0 <= start < TURN else (start % TURN, start % TURN + (end - start))
        for start, end in arcs
    )
    if len(turned) > 1 and turned[0][0] == 0.0 and turned[-1][1] >= TURN:
        first, last = turned[0], turned[-1]
        turned = [*turned[1:-1], (last[0], first[1] + TURN)]
    return turned
