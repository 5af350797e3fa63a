"""What only a four-bar has: the course's equations, its two drivers, the diagonal Z."""

import math

import four_bar_equations as equations
from four_bars import crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar
from mechanisms import apart
import numpy as np
import pytest

angles = st.floats(-math.pi, math.pi)


@untimed
@given(bar=four_bars(), theta2=crank_angles, x=st.tuples(angles, angles))
def test_the_linkage_has_the_courses_equations_turned_about(
    bar: FourBar, theta2: float, x: tuple[float, float]
) -> None:
    linkage, geometry = bar.linkage, bar.geometry
    for found, expected in (
        (linkage.f(theta2, x), -equations.f(geometry, theta2, x)),
        (linkage.phi(theta2, x), -equations.phi(geometry, x)),
        (linkage.points(theta2, x)[:2], equations.points(geometry, theta2, x)[:2]),
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-14)


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_driven_backwards_by_its_rocker_it_is_the_same_linkage(
    bar: FourBar, theta2: float
) -> None:
    pose = solved(bar, theta2)
    sine = math.sin(pose.theta2 - pose.theta3)
    assume(abs(sine) > 0.05)
    ground, crank, coupler, rocker = bar.geometry.lengths
    reverse = FourBar(ground, rocker, coupler, crank, 1 if sine > 0 else -1)
    other = reverse.solve(math.pi - pose.theta4)
    assert apart(math.pi - other.theta4, theta2) <= 1e-10
    assert apart(-other.theta3, pose.theta3) <= 1e-10


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_the_clearance_is_the_distance_of_the_diagonal_from_its_limits(
    bar: FourBar, theta2: float
) -> None:
    pose = solved(bar, theta2)
    _, a, _, o_4 = pose.points
    assert pose.z == pytest.approx(math.dist(a, o_4), abs=1e-13)
    l_3, l_4 = bar.geometry.coupler, bar.geometry.rocker
    expected = min(l_3 + l_4 - pose.z, pose.z - abs(l_3 - l_4))
    assert pose.clearance == pytest.approx(expected, abs=1e-13)
