"""Four-bars for the tests: strategies, comparison of poses, and the linkage's actual motion."""

import cmath
from itertools import product
import math
from sys import float_info

from hypothesis import assume, settings, strategies as st
from klann_ros.kinematics import (
    FourBar,
    FourBarPose,
    GeometryError,
    linkage_from_text,
    LinkageFileError,
    UnreachableError,
)
import pytest

COURSE = (0.180, 0.080, 0.200, 0.150)
# The same as a file; its units of angles, and how it is put together, are left open.
FOUR_BAR = """
name: four-bar
units: {length: mm%s}
pivots: {O2: [0, 0], O4: [180, 0]}
crank: crank
foot: B
bodies:
  crank: {bars: [{from: O2, to: A, length: 80}]}
  coupler: {bars: [{from: A, to: B, length: 200}]}
  rocker: {bars: [{from: O4, to: B, length: 150}]}
%s
"""
ULP = float_info.epsilon
NAMES = ('ground', 'crank', 'coupler', 'rocker')
# The machine may be busy: how long an example takes says nothing.
untimed = settings(max_examples=40)
assemblies = st.sampled_from([-1, 1])
crank_angles = st.floats(-50.0, 50.0)
lengths = st.tuples(*[st.floats(0.1, 1.0)] * 4)
# Whole numbers meet the change points of Grashof's law, kites and parallelograms.
whole_lengths = st.tuples(*[st.integers(1, 8)] * 4)


@st.composite
def four_bars(draw: st.DrawFn) -> FourBar:
    """Draw a linkage of any class, in any assembly."""
    try:
        return FourBar(*draw(st.one_of(lengths, whole_lengths)), draw(assemblies))
    except GeometryError:
        assume(False)
        raise


def solved(bar: FourBar, theta2: float, sine: float = 0.05) -> FourBarPose:
    """Return a pose that is not close to singular, or drop the example."""
    # With joint B on joint D the rocker's angle is undetermined.
    diagonal = cmath.rect(bar.geometry.crank, theta2) - bar.geometry.ground
    assume(abs(diagonal) > 1e-9 * bar.geometry.ground)
    try:
        pose = bar.solve(theta2)
    except UnreachableError:
        assume(False)
    assume(math.sin(pose.transmission_angle) > sine)
    return pose


def turns(bar: FourBar, start: tuple[float, float, float]) -> tuple[int, int, int]:
    """
    Return how often crank, coupler and rocker turn as the linkage goes through all its poses.

    The curve f = 0 in the space of the three angles is followed by its length from a start on
    it until it closes, straight on through change points, whatever drives the linkage.
    """
    l_1, *links = bar.geometry.lengths
    signs = (-1.0, -1.0, 1.0)

    def gradients(x: list[float]) -> tuple[list[float], list[float]]:
        rows = list(zip(signs, links, x, strict=True))
        return (
            [-s * link * math.sin(t) for s, link, t in rows],
            [s * link * math.cos(t) for s, link, t in rows],
        )

    def tangent(x: list[float], along: list[float]) -> list[float]:
        (a, b, c), (d, e, f) = gradients(x)
        v = [b * f - c * e, c * d - a * f, a * e - b * d]
        norm = math.copysign(math.hypot(*v), dot(v, along))
        return [component / norm for component in v]

    def corrected(x: list[float]) -> list[float]:
        for _ in range(4):
            (g, h), rows = gradients(x), list(zip(signs, links, x, strict=True))
            f_1 = l_1 + sum(s * link * math.cos(t) for s, link, t in rows)
            f_2 = sum(s * link * math.sin(t) for s, link, t in rows)
            if max(abs(f_1), abs(f_2)) < 1e-10 * l_1:
                break
            gg, gh, hh = dot(g, g), dot(g, h), dot(h, h)
            det = gg * hh - gh * gh
            p, q = (hh * f_1 - gh * f_2) / det, (gg * f_2 - gh * f_1) / det
            x = [t - p * u - q * v for t, u, v in zip(x, g, h, strict=True)]
        return x

    step = 0.031
    first = tangent(list(start), [1.0, 0.7, 0.3])
    x, along = list(start), first
    for count in range(4000):
        x = corrected([t + step * v for t, v in zip(x, along, strict=True)])
        along = tangent(x, along)
        back = [math.remainder(t - s, 2 * math.pi) for t, s in zip(x, start, strict=True)]
        if count > 3 and math.hypot(*back) < 0.8 * step and dot(first, along) > 0.9:
            whole = [(t - s) / (2 * math.pi) for t, s in zip(x, start, strict=True)]
            return round(whole[0]), round(whole[1]), round(whole[2])
    raise AssertionError('the motion does not close')


def turning_links(bar: FourBar) -> set[tuple[str, str]]:
    """Return the pairs of links that turn fully against each other in some actual motion."""
    found = set()
    for start in _starts(bar):
        angles = dict(zip(NAMES, (0, *turns(bar, start)), strict=True))
        found |= {(a, b) for a, b in product(NAMES, NAMES) if angles[a] != angles[b]}
    return found


def _starts(bar: FourBar) -> list[tuple[float, float, float]]:
    ground, crank, coupler, rocker = bar.geometry.lengths
    starts = []
    for arc, assembly in product(bar.reachable_arcs(), (-1, 1)):
        theta2 = arc[0] + 0.3719 * (arc[1] - arc[0])
        other = FourBar(*bar.geometry.lengths, assembly)
        starts.append((theta2, *other.closed_form(theta2).x))
    # Where two neighbours are folded onto the other two, those turn together.
    if ground == crank and coupler == rocker:
        starts.append((0.0, 1.0, 1.0))
    if ground == rocker and crank == coupler:
        starts.append((1.0, 1.0 + math.pi, math.pi))
    return starts


def dot(a: list[float], b: list[float]) -> float:
    return sum(p * q for p, q in zip(a, b, strict=True))


def refusal(end: str, angle: str = ', angle: deg', text: str = FOUR_BAR) -> str:
    """Return the one line with which a file of a four-bar is refused, without its name."""
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(text % (angle, end), 'four_bar.yaml')
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix('four_bar.yaml holds no linkage: ')
