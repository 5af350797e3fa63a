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
    turning_pairs = set()
    for start, end in bar.reachable_arcs():
        theta2 = (start + end) / 2 - (end - start) / 2 * np.cos(np.linspace(0, math.pi, 400))
        motions = []
        for sign in (1, -1):
            table = FourBar(*bar.geometry.lengths, sign).table(theta2)
            motions.append(np.array([table.theta2, table.theta3, table.theta4]))
        motion = motions[0]
        if end - start != 2 * math.pi:
            # At the ends of an arc the assemblies meet.
            motion = np.hstack([motion, motions[1][:, ::-1]])
        motion = np.unwrap(motion[:, ~np.isnan(motion).any(axis=0)])
        whole_turns = np.round((motion[:, -1] - motion[:, 0]) / (2 * math.pi)).tolist()
        turns = dict(zip(NAMES, (0, *whole_turns), strict=True))
        turning_pairs |= {(a, b) for a, b in product(NAMES, NAMES) if turns[a] != turns[b]}
    return turning_pairs


def refusal(end: str, angle: str = ', angle: deg', text: str = FOUR_BAR) -> str:
    """Return the one line with which a file of a four-bar is refused, without its name."""
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(text % (angle, end), 'four_bar.yaml')
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix('four_bar.yaml holds no linkage: ')
