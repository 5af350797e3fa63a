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


def test_the_course_alpha_and_beta_give_theta4_all_round_in_both_assemblies() -> None:
    for sign in (1, -1):
        bar = FourBar(*EXAMPLE.geometry.lengths, sign)
        for theta2 in np.radians(np.arange(-180.0, 540.0, 7.0)).tolist():
            pose = bar.solve(theta2)
            theta4 = math.pi - (sign * pose.alpha + pose.beta)
            assert math.remainder(theta4 - pose.theta4, math.tau) == pytest.approx(0.0, abs=1e-12)
            above = 0.0 <= pose.beta <= math.pi
            assert above == (math.sin(theta2) >= 0.0)
            assert 0.0 <= pose.alpha <= math.pi


@pytest.mark.parametrize('bar', [EXAMPLE, FourBar(0.3, 0.25, 0.2, 0.24), FourBar(2, 1, 2, 1, -1)])
def test_the_table_equals_the_single_poses(bar: FourBar) -> None:
    theta2 = np.radians(np.arange(0.0, 360.0, 15.0)).reshape(4, 6)
    table = bar.table(theta2)
    for index, angle in np.ndenumerate(theta2):
        row = [
            float(getattr(table, name)[index])
            for name in ('theta3', 'theta4', 'alpha', 'beta', 'z', 'transmission_angle')
        ]
        if math.isnan(row[0]):
            assert np.isnan([*row, table.mechanical_advantage[index]]).all()
            with pytest.raises(Exception, match='cannot be reached'):
                bar.solve(angle)
            continue
        pose = bar.closed_form(angle)
        own = [pose.theta3, pose.theta4, pose.alpha, pose.beta, pose.z, pose.transmission_angle]
        assert row == pytest.approx(own, abs=1e-7)
        assert float(table.mechanical_advantage[index]) == pytest.approx(
            bar.mechanical_advantage(angle), rel=1e-6, nan_ok=True
        )
    assert not table.theta4.flags.writeable


def test_a_table_is_shown_as_one() -> None:
    lines = str(EXAMPLE.table([0.0, THETA2])).splitlines()
    assert lines[0].split() == [
        *('theta2', 'theta3', 'theta4', 'alpha', 'beta', 'Z', 'mu', 'T4/T2')
    ]
    assert lines[3].split()[:5] == ['60.00', '21.56', '72.14', '81.53', '26.33']
    assert str(EXAMPLE.table(np.zeros(150))).endswith('... and 50 more')
    assert len(str(EXAMPLE.table(1.0)).splitlines()) == 3
