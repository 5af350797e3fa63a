"""Arcs of crank angles: where a function of the crank angle is not negative."""

from collections.abc import Callable
from itertools import pairwise
from math import cos, inf, pi
from typing import NamedTuple

from .angles import TURN

# Clearance samples over an arc.
SAMPLES_PER_ARC = 360
GOLDEN_RATIO = (5.0**0.5 - 1.0) / 2.0

Arc = tuple[float, float]


class ArcSample(NamedTuple):
    """A crank angle [rad], and whether its clearance is not negative."""

    alpha: float
    closes: bool


def arcs_inside(clearance: Callable[[float], float], arc: Arc = (0.0, TURN)) -> list[Arc]:
    """
    Return the parts of an arc (start, end) [rad] where a clearance is not negative.

    It is a function of the angle; sampled, its peaks and dips between samples are searched, and
    its zeros are bisected to 1e-13 of the angle.
    """
    samples = _with_extrema(clearance, _samples(arc))
    arcs: list[Arc] = []
    start = samples[0].alpha if samples[0].closes else None
    for left, right in pairwise(samples):
        if right.closes and not left.closes:
            start = _boundary(clearance, right.alpha, left.alpha)
        elif left.closes and not right.closes and start is not None:
            arcs.append((start, _boundary(clearance, left.alpha, right.alpha)))
            start = None
    if start is not None:
        arcs.append((start, samples[-1].alpha))
    return arcs


def _samples(arc: Arc) -> list[float]:
    """Return angles over an arc: the denser the nearer its ends, where clearances are steep."""
    middle, half = (arc[0] + arc[1]) / 2.0, (arc[1] - arc[0]) / 2.0
    if 2.0 * half >= TURN:
        return [arc[0] + k * TURN / SAMPLES_PER_ARC for k in range(SAMPLES_PER_ARC + 1)]
    # At the very ends the first dyad is singular, and rounding decides whether it closes.
    half *= 1.0 - 1e-12
    return [middle - half * cos(pi * k / SAMPLES_PER_ARC) for k in range(SAMPLES_PER_ARC + 1)]


def _with_extrema(clearance: Callable[[float], float], angles: list[float]) -> list[ArcSample]:
    """Sample a clearance at angles, and at the peaks and dips that those on two sides may hide."""
    first, last = angles[0], angles[-1]
    if last - first >= TURN:
        # A whole turn goes on before its first sample.
        angles = [angles[-2] - TURN, *angles]
    values = [clearance(alpha) for alpha in angles]
    found = []
    neighbours = zip(angles, angles[2:], values, values[1:], values[2:], strict=False)
    for left, right, before, value, after in neighbours:
        if value < 0.0 and before <= value >= after:
            found.append(_peak(clearance, left, right))
        # An infinite clearance, as of two lines, has no dip.
        elif 0.0 <= value < inf and before >= value <= after:
            found.append(_peak(lambda alpha: -clearance(alpha), left, right))
    turned = (alpha if alpha >= first else alpha + TURN for alpha in found)
    pairs = zip(angles, values, strict=True)
    samples = [ArcSample(alpha, value >= 0.0) for alpha, value in pairs if alpha >= first]
    return sorted([*samples, *(ArcSample(alpha, clearance(alpha) >= 0.0) for alpha in turned)])


def _peak(function: Callable[[float], float], left: float, right: float) -> float:
    """Return where a function with one peak between two angles is greatest (golden section)."""
    a, b = right - GOLDEN_RATIO * (right - left), left + GOLDEN_RATIO * (right - left)
    at_a, at_b = function(a), function(b)
    while right - left > 1e-9:
        if at_a > at_b:
            right, b, at_b = b, a, at_a
            a = right - GOLDEN_RATIO * (right - left)
            at_a = function(a)
        else:
            left, a, at_a = a, b, at_b
            b = left + GOLDEN_RATIO * (right - left)
            at_b = function(b)
    return (left + right) / 2.0


def _boundary(clearance: Callable[[float], float], closes: float, fails: float) -> float:
    """Return the last angle that closes, by bisection."""
    while abs(closes - fails) > 1e-13 * max(1.0, abs(closes)):
        middle = (closes + fails) / 2.0
        if middle in (closes, fails):
            break
        closes, fails = (middle, fails) if clearance(middle) >= 0.0 else (closes, middle)
    return closes


def normalize_arcs(arcs: list[Arc]) -> list[Arc]:
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
