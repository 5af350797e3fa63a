"""Four-bars for the tests: strategies, comparison of poses, and the links that turn fully."""

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
import numpy as np
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


def turning_links(bar: FourBar) -> set[tuple[str, str]]:
    """Return the pairs of links that turn fully against each other in a closed motion."""
    found = set()
    for start, end in bar.reachable_arcs():
        theta2 = (start + end) / 2 - (end - start) / 2 * np.cos(np.linspace(0, math.pi, 400))
        tables = [FourBar(*bar.geometry.lengths, sign).table(theta2) for sign in (1, -1)]
        there, back = (np.array([t.theta2, t.theta3, t.theta4]) for t in tables)
        # At the ends of an arc the assemblies meet.
        path = there if end - start == 2 * math.pi else np.hstack([there, back[:, ::-1]])
        path = np.unwrap(path[:, ~np.isnan(path).any(axis=0)])
        whole = np.round((path[:, -1] - path[:, 0]) / (2 * math.pi)).tolist()
        turned = dict(zip(NAMES, (0, *whole), strict=True))
        found |= {(a, b) for a, b in product(NAMES, NAMES) if turned[a] != turned[b]}
    return found


def refusal(end: str, angle: str = ', angle: deg', text: str = FOUR_BAR) -> str:
    """Return the one line with which a file of a four-bar is refused, without its name."""
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(text % (angle, end), 'four_bar.yaml')
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix('four_bar.yaml holds no linkage: ')
