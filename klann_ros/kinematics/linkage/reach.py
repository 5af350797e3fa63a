"""The reach of a linkage's crank: the arcs of crank angles where every loop closes."""

from cmath import phase
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from math import cos, inf, pi
from sys import float_info
from typing import Any

from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.errors import LoopsOpenError, UnreachableError
from klann_ros.kinematics.searches import peak
import numpy as np

from .blocks import Block
from .dyads import CONTACT_ROUNDING
from .linkage import as_linkage, Linkage
from .pose import closed_form_vectors

# Clearance samples over an arc.
SAMPLES_PER_ARC = 360
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
        crank that turns fully, empty for a linkage that closes nowhere.

    Raises
    ------
    TypeError
        `linkage` is none of these.

    """
    linkage = as_linkage(linkage)
    blocks = linkage.blocks
    arcs = [(0.0, TURN)]
    if not linkage.is_dyadic:
        arcs = [linkage.branch.arc]
        blocks = tuple(block for block in blocks if block.is_dyad)
    elif blocks[0].is_driven:
        arcs = driven_arcs(blocks[0])
        blocks = blocks[1:]
    if not blocks:
        return normalize_arcs(list(map(_trim_ends, arcs)) if linkage.is_dyadic else arcs)

    def clearance(alpha: float) -> float:
        """Return the clearance of the dyad that fails [m], else the smallest of all."""
        try:
            u = closed_form_vectors(linkage, alpha)
        except UnreachableError as error:
            # A dyad with coincident ends does not close, although its links are long enough.
            return min(-error.shortfall, -float_info.min)
        except LoopsOpenError:
            return -float_info.min
        return float(max(0.0, min(block.clearance(u) for block in blocks)))

    closed_arcs = []
    for arc in arcs:
        closed_arcs += arcs_inside(clearance, arc)
    return normalize_arcs(closed_arcs)


def path_arcs(linkage: Any) -> list[Arc]:
    """
    Return the arcs of path angles; parameters and errors as `reachable_arcs`.

    A linkage with change points that is back after several turns has them all: `[(0, 4 pi)]`.
    """
    linkage = as_linkage(linkage)
    arcs = reachable_arcs(linkage)
    return [(0.0, TURN * linkage.change_points.period)] if arcs == [(0.0, TURN)] else arcs


def closes_somewhere(linkage: Linkage) -> bool:
    """Return whether every loop closes at any crank angle."""
    # Nearly every linkage closes at one of a few angles; only the others are searched.
    for k in range(8):
        with suppress(UnreachableError, LoopsOpenError):
            closed_form_vectors(linkage, k * TURN / 8.0, linkage.assembly)
            return True
    return bool(reachable_arcs(linkage))


def driven_arcs(block: Block) -> list[Arc]:
    """Return the arcs where a dyad closes that the crank alone drives [rad]."""
    lengths = block.four_bar_lengths
    if not four_bar_closes(lengths):
        return []
    start, end = crank_limits(lengths) if lengths[0] else (0.0, pi)
    if start == 0.0 and end == pi:
        return [(0.0, TURN)]
    # The crank angle at which the crank points to the fixed end.
    terms, constant = block.rows[0]
    ground = block.structure.senses[0] * phase(-constant / terms[0])
    if start == 0.0:
        return [(ground - end, ground + end)]
    if end == pi:
        return [(ground + start, ground + TURN - start)]
    return [(ground + start, ground + end), (ground - end, ground - start)]


def four_bar_closes(lengths: Lengths) -> bool:
    """Return whether a four-bar closes at any crank angle, within rounding."""
    l_1, l_2, l_3, l_4 = lengths
    rounding = length_rounding(lengths)
    return l_1 + l_2 >= abs(l_3 - l_4) - rounding and abs(l_1 - l_2) <= l_3 + l_4 + rounding


def crank_limits(lengths: Lengths) -> tuple[float, float]:
    """
    Return the smallest and the largest crank angle of a four-bar, from the ground, in [0, pi].

    The distance A O4 grows with the angle [rad]. At the smallest, `abs(L3 - L4)`, coupler and
    rocker are folded, at the largest, `L3 + L4`, stretched out. The limits are 0 and pi without
    such an angle, and at a change point, which the crank passes. The reversed linkage, L1, L4,
    L3, L2, has limits of pi - theta4.
    """
    l_1, l_2, l_3, l_4 = lengths
    folded = abs(l_3 - l_4)
    stretched = l_3 + l_4
    rounding = length_rounding(lengths)
    passes_folded = abs(l_1 - l_2) >= folded - rounding
    passes_stretched = l_1 + l_2 <= stretched + rounding
    smallest = 0.0 if passes_folded else float(triangle_angle(l_1, l_2, folded))
    largest = pi if passes_stretched else float(triangle_angle(l_1, l_2, stretched))
    return smallest, largest


def length_rounding(lengths: Lengths) -> float:
    """Return the rounding of a difference of two sums of two lengths [m]."""
    return CONTACT_ROUNDING * max(lengths)


def _trim_ends(arc: Arc) -> Arc:
    """Return an arc without its very ends."""
    start, end = arc
    cut = 0.0 if end - start >= TURN else 5e-13 * (end - start)
    return start + cut, end - cut


def triangle_angle(p: Any, q: Any, opposite: Any) -> Any:
    """
    Return the angle between two sides of a triangle, in [0, pi] [rad]; numbers, or arrays.

    From tan(angle / 2)^2 = (o - (p - q)) (o + (p - q)) / ((p + q - o) (p + q + o)), which keeps
    its digits near 0 and pi; the law of cosines loses half of them there.
    """
    numerator = (opposite - (p - q)) * (opposite + (p - q))
    denominator = (p + q - opposite) * (p + q + opposite)
    sine = np.sqrt(np.maximum(0.0, numerator))
    return 2.0 * np.arctan2(sine, np.sqrt(np.maximum(0.0, denominator)))


def arcs_inside(clearance: Callable[[float], float], arc: Arc = (0.0, TURN)) -> list[Arc]:
    """
    Return the parts of an arc (start, end) [rad] where a clearance is not negative.

    It is a function of the angle; sampled, its peaks and dips between samples are searched, and
    its zeros are bisected to 1e-13 of the angle.
    """
    samples = _with_extrema(clearance, arc)
    arcs: list[Arc] = []
    start = samples[0][0] if samples[0][1] else None
    for (left, left_closes), (right, right_closes) in pairwise(samples):
        if right_closes and not left_closes:
            start = _boundary(clearance, right, left)
        elif left_closes and not right_closes and start is not None:
            arcs.append((start, _boundary(clearance, left, right)))
            start = None
    if start is not None:
        arcs.append((start, samples[-1][0]))
    return arcs


def _samples(arc: Arc) -> list[float]:
    """Return angles over an arc: the denser the nearer its ends, where clearances are steep."""
    middle = (arc[0] + arc[1]) / 2.0
    half = (arc[1] - arc[0]) / 2.0
    if 2.0 * half >= TURN:
        return [arc[0] + k * TURN / SAMPLES_PER_ARC for k in range(SAMPLES_PER_ARC + 1)]
    # At the very ends the first dyad is singular, and rounding decides whether it closes.
    half *= 1.0 - 1e-12
    return [middle - half * cos(pi * k / SAMPLES_PER_ARC) for k in range(SAMPLES_PER_ARC + 1)]


def _with_extrema(clearance: Callable[[float], float], arc: Arc) -> list[tuple[float, bool]]:
    """
    Return samples of an arc: the angle, and whether the clearance is not negative.

    They include the peaks and dips that two neighbours may hide.
    """
    angles = _samples(arc)
    start = angles[0]
    is_turn = angles[-1] - start >= TURN
    if is_turn:
        # A whole turn goes on before its first sample.
        angles.insert(0, angles[-2] - TURN)
    clearances = list(map(clearance, angles))
    samples = []
    for n in range(int(is_turn), len(angles)):
        samples.append((angles[n], clearances[n] >= 0.0))
    for n in range(1, len(angles) - 1):
        left, middle, right = clearances[slice(n - 1, n + 2)]
        if middle < 0.0 and left <= middle >= right:
            extremum = peak(clearance, angles[n - 1], angles[n + 1])
        # An infinite clearance, as of two lines, has no dip.
        elif 0.0 <= middle < inf and left >= middle <= right:
            extremum = peak(lambda alpha: -clearance(alpha), angles[n - 1], angles[n + 1])
        else:
            continue
        alpha = extremum if extremum >= start else extremum + TURN
        samples.append((alpha, clearance(alpha) >= 0.0))
    return sorted(samples)


def _boundary(clearance: Callable[[float], float], closes: float, fails: float) -> float:
    """Return the last angle that closes, by bisection."""
    while abs(closes - fails) > 1e-13 * max(1.0, abs(closes)):
        middle = (closes + fails) / 2.0
        if middle in (closes, fails):
            break
        if clearance(middle) >= 0.0:
            closes = middle
        else:
            fails = middle
    return closes


def normalize_arcs(arcs: list[Arc]) -> list[Arc]:
    """Bring the arcs' starts into [0, 2 pi), sort them, and join the two ends of the turn."""
    normalized = []
    for start, end in arcs:
        # A turn added and taken away again would cost the last digit.
        is_within = 0.0 <= start < TURN
        normalized.append(
            (start, end) if is_within else (start % TURN, start % TURN + (end - start))
        )
    normalized.sort()
    if len(normalized) > 1 and normalized[0][0] == 0.0 and normalized[-1][1] >= TURN:
        first_end = normalized[0][1]
        last_start = normalized[-1][0]
        normalized = [*normalized[1:-1], (last_start, first_end + TURN)]
    return normalized
