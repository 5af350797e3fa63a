"""Transmission angle and mechanical advantage."""

import math

from four_bars import COURSE, crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar, TransmissionExtremes, UnreachableError
import pytest

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
    found = []
    for start, end in bar.reachable_arcs():
        angles = [start + (end - start) * k / 100 for k in range(101)]
        found += [bar.transmission_angle(theta2) for theta2 in angles]
    assert extremes.least <= min(found) + 1e-7
    assert extremes.greatest >= max(found) - 1e-7
    assert extremes.least == pytest.approx(min(found), abs=2e-2)
    assert extremes.greatest == pytest.approx(max(found), abs=2e-2)


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
    for least, greatest, good in ((40, 140, True), (39, 140, False), (40, 141, False)):
        ends = math.radians(least), (0.0,), math.radians(greatest), (math.pi,)
        assert TransmissionExtremes(*ends).good is good
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
def test_input_power_equals_output_power(
    bar: FourBar, theta2: float, rate: float, torque: float
) -> None:
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
