"""Arcs of crank angles: where a function of the crank angle is not negative."""

from collections.abc import Callable
from itertools import pairwise
from math import cos, inf, pi

from .angles import TURN

# How often a clearance is sampled over an arc.
SAMPLES = 360
GOLDEN = (5.0**0.5 - 1.0) / 2.0

Arc = tuple[float, float]


def arcs_inside(clearance: Callable[[float], float], arc: Arc = (0.0, TURN)) -> list[Arc]:
    """
    Return the parts of an arc (start, end) [rad] at which a clearance is not negative.

    It is a function of the angle; sampled, its peaks and dips between samples are searched, and
    its zeros are bisected to 1e-13 of the angle.
    """
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


def _with_extrema(clearance: Callable[[float], float], samples: list[float]) -> list[float]:
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
        # What has no limit, as where two lines meet, has no dip.
        elif 0.0 <= value < inf and before >= value <= after:
            found.append(_peak(lambda alpha: -clearance(alpha), left, right))
    turned = (alpha if alpha >= first else alpha + TURN for alpha in found)
    return sorted([*(alpha for alpha in samples if alpha >= first), *turned])


def _peak(function: Callable[[float], float], left: float, right: float) -> float:
    """Return where a function with one peak between two angles is greatest (golden section)."""
    while right - left > 1e-9:
        a, b = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
        if function(a) > function(b):
            right = b
        else:
            left = a
    return (left + right) / 2.0


def _boundary(clearance: Callable[[float], float], closes: float, fails: float) -> float:
    """Return the last angle that closes, by bisection."""
    while abs(closes - fails) > 1e-13 * max(1.0, abs(closes)):
        middle = (closes + fails) / 2.0
        if middle in (closes, fails):
            break
        closes, fails = (middle, fails) if clearance(middle) >= 0.0 else (closes, middle)
    return closes


def normal(arcs: list[Arc]) -> list[Arc]:
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
