"""Velocities and accelerations of a pose: the derivatives of what `solve` answers."""

from dataclasses import replace
import math

from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import (
    KlannGeometry,
    KlannLeg,
    KlannPose,
    SingularPoseError,
    UnreachableError,
)
from klann_ros.kinematics.klann import equations
from klann_ros.kinematics.klann.acceleration import second_coefficients
from klann_ros.kinematics.klann.geometry import COORDINATES, LENGTHS
import numpy as np
import pytest
from strategies import crank_angles, legs

rates = st.floats(-10.0, 10.0)
STEP = 1e-5


def solved(geometry: KlannGeometry, alpha: float) -> KlannPose:
    """Return a pose that is not close to singular, or drop the example."""
    try:
        pose = KlannLeg(geometry).solve(alpha)
    except UnreachableError:
        assume(False)
    assume(min(pose.sines) > 0.1)
    return pose


def neighbours(geometry: KlannGeometry, alpha: float) -> tuple[KlannPose, KlannPose]:
    return solved(geometry, alpha - STEP), solved(geometry, alpha + STEP)


def roughness(pose: KlannPose) -> float:
    """Return what a central difference of a derivative may be off by, as third ones are large."""
    return 1e-6 * max(1.0, *map(abs, pose.coefficients)) ** 5


@given(geometry=legs(), alpha=crank_angles, rate=rates)
def test_acceleration_is_the_difference_of_velocities(
    geometry: KlannGeometry, alpha: float, rate: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    # At the constant rate the crank passes from the one neighbour to the other.
    before, after = (leg.velocity(p, rate) for p in neighbours(geometry, alpha))
    acceleration = leg.acceleration(pose, rate, 0.0)
    scale = rate * rate * roughness(pose) + 1e-9
    for got, first, last in zip(acceleration[1:5], before[1:5], after[1:5], strict=True):
        assert got == pytest.approx((last - first) / (2 * STEP) * rate, rel=1e-6, abs=scale)
    foot = (np.array(after.h) - before.h) / (2 * STEP) * rate
    np.testing.assert_allclose(acceleration.h, foot, rtol=1e-6, atol=scale)
    assert acceleration.alpha == 0.0


@given(geometry=legs(), alpha=crank_angles)
def test_the_points_move_as_their_differences(geometry: KlannGeometry, alpha: float) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    before, after = neighbours(geometry, alpha)
    scale = roughness(pose)
    velocity = (after.points - before.points) / (2 * STEP)
    np.testing.assert_allclose(leg.velocity(pose, 1.0).points, velocity, rtol=0, atol=scale)
    first, last = (leg.velocity(p, 1.0).points for p in (before, after))
    np.testing.assert_allclose(
        leg.acceleration(pose, 1.0, 0.0).points, (last - first) / (2 * STEP), rtol=0, atol=scale
    )


@given(geometry=legs(), alpha=crank_angles, rate=rates, change=rates)
def test_the_foot_is_the_last_point_and_the_pivots_rest(
    geometry: KlannGeometry, alpha: float, rate: float, change: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    for moving in (leg.velocity(pose, rate), leg.acceleration(pose, rate, change)):
        assert moving.points.shape == (8, 2)
        np.testing.assert_allclose(moving.points[7], moving.h, rtol=1e-13, atol=1e-13)
        assert not moving.points[[0, 3, 4]].any()


@given(geometry=legs(), alpha=crank_angles, rate=rates, change=rates)
def test_no_link_changes_its_length(
    geometry: KlannGeometry, alpha: float, rate: float, change: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    p = pose.points
    acceleration = leg.acceleration(pose, rate, change)
    v, a = acceleration.velocity.points, acceleration.points
    for i, j in ((0, 1), (1, 2), (3, 2), (2, 6), (4, 5), (5, 6), (6, 7), (1, 6), (5, 7)):
        link, turning, changing = p[j] - p[i], v[j] - v[i], a[j] - a[i]
        scale = 1e-12 * (1.0 + abs(v).max() ** 2 + abs(a).max())
        assert link @ turning == pytest.approx(0.0, abs=scale)
        assert link @ changing + turning @ turning == pytest.approx(0.0, abs=scale)


@given(geometry=legs(), alpha=crank_angles, rate=rates, change=rates)
def test_in_reverse_the_velocity_flips_and_the_acceleration_stays(
    geometry: KlannGeometry, alpha: float, rate: float, change: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    there, back = leg.velocity(pose, rate), leg.velocity(pose, -rate)
    assert there[:5] == tuple(-value for value in back[:5])
    assert there.points.tolist() == (-back.points).tolist()
    there, back = leg.acceleration(pose, rate, change), leg.acceleration(pose, -rate, change)
    assert there[:6] == back[:6]


@given(geometry=legs(), alpha=crank_angles, rate=rates, change=rates)
def test_both_parts_of_an_acceleration_add_up(
    geometry: KlannGeometry, alpha: float, rate: float, change: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    steady, driven = leg.acceleration(pose, rate, 0.0), leg.velocity(pose, change)
    total = leg.acceleration(pose, rate, change)
    np.testing.assert_allclose(total.points, steady.points + driven.points, rtol=1e-9, atol=1e-9)


@given(geometry=legs(), alpha=crank_angles)
def test_the_coefficients_solve_the_loops_differentiated_twice(
    geometry: KlannGeometry, alpha: float
) -> None:
    pose = solved(geometry, alpha)
    phi, f_2 = (
        equations.phi(geometry, pose.x),
        equations.f_2(geometry, alpha, pose.x, pose.coefficients),
    )
    scale = 1e-13 * (1.0 + abs(f_2).max())
    np.testing.assert_allclose(phi @ second_coefficients(pose), -f_2, rtol=1e-10, atol=scale)


@given(geometry=legs(), alpha=crank_angles, factor=st.sampled_from([0.001, 3.0, 1000.0]))
def test_scaled_lengths_scale_the_motion(
    geometry: KlannGeometry, alpha: float, factor: float
) -> None:
    leg, pose = KlannLeg(geometry), solved(geometry, alpha)
    numbers = {name: factor * getattr(geometry, name) for name in LENGTHS + COORDINATES}
    scaled = KlannLeg(replace(geometry, **numbers))
    motion, other = (
        leg.acceleration(pose, 2.0, 3.0),
        scaled.acceleration(scaled.solve(alpha), 2.0, 3.0),
    )
    for part, scaled_part in ((motion, other), (motion.velocity, other.velocity)):
        limit = 1e-9 * factor * (1.0 + abs(part.points).max())
        np.testing.assert_allclose(scaled_part.points, factor * part.points, rtol=0, atol=limit)


@given(geometry=legs(), alpha=crank_angles)
def test_a_mirrored_leg_moves_mirrored(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    mirrored = replace(
        geometry,
        x_d=-geometry.x_d,
        x_e=-geometry.x_e,
        angle_bcg=-geometry.angle_bcg,
        angle_fgh=-geometry.angle_fgh,
        assembly=tuple(-sign for sign in geometry.assembly),
    )
    other = solved(mirrored, math.pi - alpha)
    motion = KlannLeg(geometry).acceleration(pose, 2.0, 3.0)
    # The mirrored crank turns the other way.
    reflected = KlannLeg(mirrored).acceleration(other, -2.0, -3.0)
    limit = 1e-8 * (1.0 + abs(motion.points).max())
    np.testing.assert_allclose(reflected.points, motion.points * [-1, 1], rtol=0, atol=limit)


def test_both_methods_have_the_same_acceleration() -> None:
    leg = KlannLeg()
    for k in range(36):
        alpha = k * math.pi / 18
        newton = leg.acceleration(leg.solve(alpha), 1.0, 0.5)
        geometric = leg.acceleration(leg.closed_form(alpha), 1.0, 0.5)
        np.testing.assert_allclose(newton[:5], geometric[:5], rtol=0, atol=1e-11)


def test_a_singular_pose_has_no_acceleration() -> None:
    leg = KlannLeg(KlannGeometry(l_bc=0.12 + math.hypot(0.35, 0.09) - 0.14 + 1e-16))
    pose = leg.closed_form(math.atan2(-0.09, 0.35) + math.pi + 1e-9)
    with pytest.raises(SingularPoseError, match='is singular'):
        leg.acceleration(pose, 1.0, 0.0)


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_by_its_name(value: float) -> None:
    leg = KlannLeg()
    pose = leg.solve(1.0)
    with pytest.raises(ValueError, match=r'alpha_rate = .* must be finite'):
        leg.acceleration(pose, value, 0.0)
    with pytest.raises(ValueError, match=r'alpha_acceleration = .* must be finite'):
        leg.acceleration(pose, 0.0, value)
