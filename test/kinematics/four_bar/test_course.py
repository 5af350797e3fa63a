"""The four-bar's course: its equations, printed estimates, the diagonal Z, the rocker driving."""

import math
from pathlib import Path

import four_bar_equations as equations
from four_bars import crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar
from mechanisms import apart
import numpy as np
import pytest
import yaml

# L1 to L4 of the examples [mm], as they are computed with in the course.
EXAMPLE = FourBar(180.0, 80.0, 200.0, 150.0)
THETA2 = math.radians(60.0)
ITERATIONS = yaml.safe_load(
    Path(__file__).with_name('iterations.yaml').read_text(encoding='utf-8')
)
angles = st.floats(-math.pi, math.pi)


@pytest.mark.parametrize('printed', ITERATIONS)
def test_example_2_prints_f_phi_and_the_correction_of_each_estimate(
    printed: dict[str, list[float]],
) -> None:
    estimate, f, phi, correction = printed.values()
    x = np.radians(estimate)
    ours_f, ours_phi = equations.f(EXAMPLE.geometry, THETA2, x), equations.phi(EXAMPLE.geometry, x)
    places = 3 if abs(f[0]) > 1.0 else 6
    assert ours_f.round(places).tolist() == f
    assert ours_phi.round(3).ravel().tolist() == phi
    ours = -np.linalg.solve(ours_phi, ours_f)
    if estimate[0] != 21.5577:
        digits = 4 if places == 3 else 6
        assert ours.round(digits).tolist() == correction
    else:
        # f is printed with three digits here, and the correction made of those.
        np.testing.assert_allclose(ours, correction, rtol=0, atol=1e-8)


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
