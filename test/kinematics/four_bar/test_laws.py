"""Laws that every four-bar obeys: derivatives, similarity, mirroring."""

import math

from four_bars import apart, COURSE, crank_angles, four_bars, solved, untimed
from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import FourBar, FourBarPose, SingularPoseError
from klann_ros.kinematics.four_bar import equations
import numpy as np
import pytest

angles = st.floats(-math.pi, math.pi)
rates = st.floats(-10.0, 10.0)
STEP = 1e-5


def scaled(bar: FourBar, factor: float, assembly: int = 1) -> FourBar:
    geometry = bar.geometry
    return FourBar(*(factor * n for n in geometry.lengths), assembly * geometry.assembly)


def well(bar: FourBar, theta2: float) -> FourBarPose:
    """Return a pose whose derivatives are not steep, of links about 1 m long."""
    pose = solved(bar, theta2, sine=0.3)
    assume(max(map(abs, pose.coefficients)) < 10.0)
    return pose


@untimed
@given(bar=four_bars(), theta2=crank_angles, x=st.tuples(angles, angles))
def test_phi_is_the_central_difference_of_f(
    bar: FourBar, theta2: float, x: tuple[float, float]
) -> None:
    step, g = 1e-6, bar.geometry
    columns = [
        (equations.f(g, theta2, x + step * e) - equations.f(g, theta2, x - step * e)) / (2 * step)
        for e in np.eye(2)
    ]
    np.testing.assert_allclose(equations.phi(g, x), np.transpose(columns), rtol=0, atol=1e-7)
    along = equations.f(g, theta2 + step, x) - equations.f(g, theta2 - step, x)
    np.testing.assert_allclose(
        equations.f_theta2(g, theta2), along / (2 * step), rtol=0, atol=1e-7
    )


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_a_solved_pose_closes_the_loop_and_keeps_the_lengths(bar: FourBar, theta2: float) -> None:
    pose = solved(bar, theta2)
    size = max(bar.geometry.lengths)
    assert np.linalg.norm(equations.f(bar.geometry, theta2, pose.x)) <= 4e-15 * size
    o_2, a, b, o_4 = pose.points
    found = [math.dist(o_2, o_4), math.dist(o_2, a), math.dist(a, b), math.dist(b, o_4)]
    np.testing.assert_allclose(found, bar.geometry.lengths, rtol=0, atol=1e-14 * size)


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_both_methods_give_the_same_coefficients(bar: FourBar, theta2: float) -> None:
    pose, other = solved(bar, theta2), bar.closed_form(theta2)
    np.testing.assert_allclose(pose.coefficients, other.coefficients, rtol=1e-8, atol=1e-9)


@untimed
@given(bar=four_bars(), theta2=crank_angles, rate=rates, u=rates, v=rates)
def test_velocity_is_the_difference_of_poses(
    bar: FourBar, theta2: float, rate: float, u: float, v: float
) -> None:
    pose = well(bar, theta2)
    velocity = bar.velocity(pose, rate)
    before, after = well(bar, theta2 - STEP), well(bar, theta2 + STEP)
    for ours, a, b in zip(velocity[1:3], before.x, after.x, strict=True):
        slope = math.remainder(b - a, 2 * math.pi) / (2 * STEP)
        assert ours == pytest.approx(slope * rate, abs=1e-4)
    slope = (after.points - before.points) / (2 * STEP)
    np.testing.assert_allclose(velocity.points, slope * rate, rtol=0, atol=1e-3)
    p, q = before.coupler_point(u, v), after.coupler_point(u, v)
    slope = (np.array(q) - p) / (2 * STEP)
    np.testing.assert_allclose(velocity.coupler_point(u, v), slope * rate, rtol=0, atol=1e-3)
    assert velocity.theta2 == rate


@untimed
@given(bar=four_bars(), theta2=crank_angles, motion=st.tuples(rates, rates), u=rates, v=rates)
def test_acceleration_is_the_difference_of_velocities(
    bar: FourBar, theta2: float, motion: tuple[float, float], u: float, v: float
) -> None:
    rate, change = motion
    pose = well(bar, theta2)
    acceleration = bar.acceleration(pose, rate, change)
    # The crank goes through theta2 at this rate, with this acceleration.
    before, after = (
        bar.velocity(well(bar, theta2 + s * rate + s * s * change / 2), rate + s * change)
        for s in (-STEP, STEP)
    )
    slopes = (np.array(after[:3]) - before[:3]) / (2 * STEP)
    size = 1.0 + np.abs(slopes).max()
    np.testing.assert_allclose(acceleration[:3], slopes, rtol=0, atol=1e-4 * size)
    slopes = (after.points - before.points) / (2 * STEP)
    size = 10.0 * (size + np.abs(slopes).max())
    np.testing.assert_allclose(acceleration.points, slopes, rtol=0, atol=1e-4 * size)
    slope = (np.array(after.coupler_point(u, v)) - before.coupler_point(u, v)) / (2 * STEP)
    np.testing.assert_allclose(acceleration.coupler_point(u, v), slope, rtol=0, atol=1e-3 * size)
    assert acceleration.velocity == bar.velocity(pose, rate)


@untimed
@given(bar=four_bars(), theta2=crank_angles, factor=st.sampled_from([0.001, 0.5, 3.0, 1000.0]))
def test_scaled_lengths_scale_the_points_and_keep_the_angles(
    bar: FourBar, theta2: float, factor: float
) -> None:
    pose, size = solved(bar, theta2), max(bar.geometry.lengths)
    other = solved(scaled(bar, factor), theta2)
    atol = 1e-12 * factor * size
    np.testing.assert_allclose(other.points, factor * pose.points, rtol=0, atol=atol)


@untimed
@given(bar=four_bars(), theta2=crank_angles)
def test_a_mirrored_linkage_has_the_other_assembly(bar: FourBar, theta2: float) -> None:
    pose = solved(bar, theta2)
    other = solved(scaled(bar, 1.0, -1), -theta2)
    np.testing.assert_allclose(other.points, pose.points * [1, -1], rtol=0, atol=1e-11)
    assert max(apart(a, -b) for a, b in zip(pose.x, other.x, strict=True)) <= 1e-11


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
    assert pose.clearance > 0.0
    assert pose.condition >= 1.0


@pytest.mark.parametrize('method', ['solve', 'closed_form'])
def test_a_singular_pose_has_no_velocity(method: str) -> None:
    bar = FourBar(0.3, 0.1, 0.3, 0.1)
    pose = getattr(bar, method)(0.0)
    for motion in (bar.velocity, lambda *args: bar.acceleration(*args, 0.0)):
        with pytest.raises(SingularPoseError, match='is singular'):
            motion(pose, 1.0)
    # The next solve does without its tangent.
    assert bar.solve(0.1).iterations > 0


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_a_rate_or_acceleration_that_is_none_is_refused(value: float) -> None:
    bar = FourBar(*COURSE)
    pose = bar.solve(1.0)
    with pytest.raises(ValueError, match=r'rate = .* must be finite'):
        bar.velocity(pose, value)
    with pytest.raises(ValueError, match=r'acceleration = .* must be finite'):
        bar.acceleration(pose, 1.0, value)


def test_the_points_are_a_copy() -> None:
    pose = FourBar(*COURSE).solve(1.0)
    expected = pose.points.tolist()
    pose.points[1] = 0.0
    assert pose.points.tolist() == expected
