"""The four-bar's course: equations, estimates, Z, transmission angle, mechanical advantage."""

import math
from pathlib import Path

import four_bar_equations as equations
from four_bars import COURSE, crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar, TransmissionExtremes, UnreachableError
import numpy as np
import pytest
from sample_linkages import apart
from yaml_tables import read_table

# L1 to L4 of the examples [mm], as they are computed with in the course.
EXAMPLE = FourBar(180.0, 80.0, 200.0, 150.0)
THETA2 = math.radians(60.0)
ITERATIONS = read_table(Path(__file__).with_name('iterations.yaml'))
angles = st.floats(-math.pi, math.pi)
State = tuple[float, float]


@pytest.mark.parametrize('printed', ITERATIONS)
def test_example_2_prints_f_phi_and_corrections(printed: dict[str, list[float]]) -> None:
    estimate, f, phi, correction = printed.values()
    x = np.radians(estimate)
    ours_f = equations.f(EXAMPLE.geometry, THETA2, x)
    ours_phi = equations.phi(EXAMPLE.geometry, x)
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
def test_equations_are_the_courses_negated(bar: FourBar, theta2: float, x: State) -> None:
    linkage, geometry = bar.linkage, bar.geometry
    for computed, expected in (
        (linkage.f(theta2, x), -equations.f(geometry, theta2, x)),
        (linkage.phi(theta2, x), -equations.phi(geometry, x)),
        (linkage.points(theta2, x)[:2], equations.points(geometry, theta2, x)[:2]),
    ):
        np.testing.assert_allclose(computed, expected, rtol=0, atol=4e-14)


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_driven_by_its_rocker_it_is_the_same_linkage(bar: FourBar, theta2: float) -> None:
    pose = solved(bar, theta2)
    sine = math.sin(pose.theta2 - pose.theta3)
    assume(abs(sine) > 0.05)
    ground, crank, coupler, rocker = bar.geometry.lengths
    sign = 1 if sine > 0 else -1
    # This sign at any angle, also beyond a change point.
    reverse = FourBar(ground, rocker, coupler, crank, sign, at_change_points='sign')
    reverse_pose = reverse.solve(math.pi - pose.theta4)
    assert apart(math.pi - reverse_pose.theta4, theta2) <= 1e-10
    assert apart(-reverse_pose.theta3, pose.theta3) <= 1e-10


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_the_clearance_is_of_the_diagonal_from_its_limits(bar: FourBar, theta2: float) -> None:
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
        table_row = [
            float(getattr(table, name)[index])
            for name in ('theta3', 'theta4', 'alpha', 'beta', 'z', 'transmission_angle')
        ]
        if math.isnan(table_row[0]):
            assert np.isnan([*table_row, table.mechanical_advantage[index]]).all()
            with pytest.raises(Exception, match='cannot be reached'):
                bar.solve(angle)
            continue
        pose = bar.closed_form(angle)
        angles = [pose.theta3, pose.theta4, pose.alpha, pose.beta, pose.z, pose.transmission_angle]
        assert table_row == pytest.approx(angles, abs=1e-7)
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


# Coupler and rocker cannot reach everything, on either side.
BOTH_LIMITS = (3.0, 4.0, 1.0, 4.0)


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_the_formula_is_the_angle_between_coupler_and_rocker(bar: FourBar, theta2: float) -> None:
    pose = solved(bar, theta2)
    mu = bar.transmission_angle(theta2)
    assert mu == pytest.approx(pose.transmission_angle, abs=1e-10)
    l_1, l_2, l_3, l_4 = bar.geometry.lengths
    cosine = l_3**2 + l_4**2 - l_1**2 - l_2**2 + 2 * l_1 * l_2 * math.cos(theta2)
    assert math.cos(mu) == pytest.approx(cosine / (2 * l_3 * l_4), abs=1e-12)


def test_it_keeps_its_digits_near_the_ends() -> None:
    # A and O4 are Z apart on a straight line: mu^2 = (Z^2 - (L3 - L4)^2) / (L3 L4), mu small.
    bar = FourBar(1.0 + 2.0**-40, 0.5, 1.25, 0.75)
    expected = math.sqrt((2.0**-40 * (1.0 + 2.0**-40)) / (1.25 * 0.75))
    assert bar.transmission_angle(0.0) == pytest.approx(expected, rel=1e-9)


@untimed
@given(bar=four_bars())
def test_the_extremes_are_the_extremes(bar: FourBar) -> None:
    extremes = bar.transmission_extremes
    transmission_angles = []
    for start, end in bar.reachable_arcs():
        angles = [start + (end - start) * k / 100 for k in range(101)]
        transmission_angles += [bar.transmission_angle(theta2) for theta2 in angles]
    assert extremes.least <= min(transmission_angles) + 1e-7
    assert extremes.greatest >= max(transmission_angles) - 1e-7
    assert extremes.least == pytest.approx(min(transmission_angles), abs=2e-2)
    assert extremes.greatest == pytest.approx(max(transmission_angles), abs=2e-2)


@pytest.mark.parametrize('lengths', [COURSE, BOTH_LIMITS, (0.5, 0.3, 0.4, 0.35)])
def test_the_extremes_are_at_their_angles(lengths: tuple[float, ...]) -> None:
    bar = FourBar(*lengths)
    extremes = bar.transmission_extremes
    for theta2 in extremes.least_at:
        inside = theta2 * (1 + 1e-12)
        assert bar.transmission_angle(inside) == pytest.approx(extremes.least, abs=1e-5)
    for theta2 in extremes.greatest_at:
        inside = theta2 * (1 - 1e-12)
        assert bar.transmission_angle(inside) == pytest.approx(extremes.greatest, abs=1e-5)


def test_good_is_from_40_to_140_degrees() -> None:
    for min_degrees, max_degrees, is_good in ((40, 140, True), (39, 140, False), (40, 141, False)):
        ends = math.radians(min_degrees), (0.0,), math.radians(max_degrees), (math.pi,)
        assert TransmissionExtremes(*ends).good is is_good
    course = FourBar(*COURSE).transmission_extremes
    assert (course.least_at, course.greatest_at) == ((0.0,), (math.pi,))
    assert math.degrees(course.least) == pytest.approx(28.955, abs=1e-3)
    assert not course.good
    assert FourBar(0.3, 0.05, 0.25, 0.2).transmission_extremes.good


def test_at_the_ends_of_the_reach_it_is_0_and_180_degrees() -> None:
    extremes = FourBar(*BOTH_LIMITS).transmission_extremes
    assert (extremes.least, extremes.greatest) == (0.0, math.pi)
    assert extremes.least_at[0] == -extremes.least_at[1]
    assert extremes.greatest_at[0] == -extremes.greatest_at[1]
    assert not extremes.good


def test_an_unreachable_angle_has_no_transmission_angle() -> None:
    for method in ('transmission_angle', 'mechanical_advantage'):
        with pytest.raises(UnreachableError, match='A and O4'):
            getattr(FourBar(*BOTH_LIMITS), method)(math.pi)


@untimed
@given(bar=four_bars(), theta2=crank_angles, rate=st.floats(0.1, 10.0), torque=st.floats(0.1, 9.0))
def test_power_is_kept(bar: FourBar, theta2: float, rate: float, torque: float) -> None:
    pose = solved(bar, theta2)
    assume(abs(pose.coefficients[1]) > 1e-6)
    velocity = bar.velocity(pose, rate)
    power = torque * velocity.theta2
    t_4 = bar.mechanical_advantage(theta2) * torque
    assert t_4 * velocity.theta4 == pytest.approx(power, rel=1e-6)


def test_it_is_infinite_where_the_rocker_stands_still() -> None:
    # Crank and coupler point up, 3 m; with L1 = 4 m the rocker is 5 m long.
    bar = FourBar(4.0, 1.0, 2.0, 5.0)
    assert bar.mechanical_advantage(math.pi / 2) == math.inf


@pytest.mark.parametrize('side', [-1, 1])
def test_it_changes_its_sign_there(side: int) -> None:
    bar = FourBar(*COURSE)
    limit = bar.rocker_limits.stretched.theta2
    assert bar.mechanical_advantage(limit + side * 1e-3) * side > 100.0


def test_it_is_zero_where_coupler_and_rocker_are_in_line() -> None:
    bar = FourBar(*BOTH_LIMITS)
    for point in bar.dead_points():
        near = point.angle * (1 - 1e-15 if point.kind == 'stretched' else 1 + 1e-15)
        assert abs(bar.mechanical_advantage(near)) < 1e-6
    # |A O4| = 5 m = L3 + L4 with a right angle at O2.
    assert FourBar(4.0, 3.0, 2.0, 3.0).mechanical_advantage(math.pi / 2) == 0.0


def test_it_is_nothing_at_a_change_point() -> None:
    assert math.isnan(FourBar(0.3, 0.1, 0.3, 0.1).mechanical_advantage(0.0))


def test_a_parallelogram_passes_torque_on_as_it_is() -> None:
    bar = FourBar(0.3, 0.1, 0.3, 0.1)
    assert bar.mechanical_advantage(1.0) == pytest.approx(1.0, abs=1e-14)
