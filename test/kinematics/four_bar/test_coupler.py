"""What only a four-bar has: its two drivers, points of its coupler, the diagonal Z."""

import math

import four_bar_equations as equations
from four_bars import crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar
from mechanisms import apart
import numpy as np
import pytest

angles = st.floats(-math.pi, math.pi)
rates = st.floats(-5.0, 5.0)
STEP = 1e-5


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
@given(bar=four_bars(), theta2=crank_angles, u=rates, v=rates)
def test_a_coupler_point_moves_with_a_and_b(
    bar: FourBar, theta2: float, u: float, v: float
) -> None:
    pose = solved(bar, theta2)
    _, a, b, _ = pose.points
    coupler, atol = bar.geometry.coupler, 1e-12 * max(bar.geometry.lengths)
    np.testing.assert_allclose(pose.coupler_point(0.0, 0.0), a, rtol=0, atol=atol)
    np.testing.assert_allclose(pose.coupler_point(coupler, 0.0), b, rtol=0, atol=atol)
    ab = (b - a) / coupler
    left = np.array([-ab[1], ab[0]])
    expected = a + u * ab + v * left
    np.testing.assert_allclose(pose.coupler_point(u, v), expected, rtol=0, atol=1e-10)


@untimed
@given(bar=four_bars(), theta2=crank_angles, rate=rates, u=rates, v=rates)
def test_the_motion_of_a_coupler_point_is_the_difference_of_its_places(
    bar: FourBar, theta2: float, rate: float, u: float, v: float
) -> None:
    before, pose, after = (solved(bar, theta2 + step, sine=0.3) for step in (-STEP, 0.0, STEP))
    assume(max(map(abs, pose.coefficients)) < 10.0)
    slope = np.subtract(after.coupler_point(u, v), before.coupler_point(u, v)) / (2 * STEP)
    velocity = bar.velocity(pose, rate)
    np.testing.assert_allclose(velocity.coupler_point(u, v), slope * rate, rtol=0, atol=1e-3)
    first, last = (bar.velocity(p, rate).coupler_point(u, v) for p in (before, after))
    slope = np.subtract(last, first) / (2 * STEP) * rate
    limit = 1e-3 * (1.0 + np.abs(slope).max()) * (1.0 + rate * rate)
    acceleration = bar.acceleration(pose, rate, 0.0)
    np.testing.assert_allclose(acceleration.coupler_point(u, v), slope, rtol=0, atol=limit)
    assert velocity.joints == (velocity.theta2, velocity.theta3, velocity.theta4)


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
