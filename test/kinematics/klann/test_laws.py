"""Laws that every leg obeys: derivatives, similarity, mirroring."""

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
from klann_ros.kinematics.klann.geometry import COORDINATES, LENGTHS
import numpy as np
import pytest
from strategies import crank_angles, legs

states = st.tuples(*[st.floats(-math.pi, math.pi)] * 4)


def solved(geometry: KlannGeometry, alpha: float) -> KlannPose:
    """Return a pose that is not close to singular, or drop the example."""
    try:
        pose = KlannLeg(geometry).solve(alpha)
    except UnreachableError:
        assume(False)
    assume(min(math.sin(angle) for angle in pose.transmission_angles) > 0.05)
    return pose


@given(geometry=legs(), alpha=crank_angles, x=states)
def test_phi_is_the_central_difference_of_f(
    geometry: KlannGeometry, alpha: float, x: tuple[float, ...]
) -> None:
    step = 1e-6
    columns = [
        (equations.f(geometry, alpha, x + step * e) - equations.f(geometry, alpha, x - step * e))
        / (2 * step)
        for e in np.eye(4)
    ]
    np.testing.assert_allclose(
        equations.phi(geometry, x), np.transpose(columns), rtol=0, atol=1e-9
    )


@given(geometry=legs(), alpha=crank_angles)
def test_a_solved_pose_closes_both_loops(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    residual = np.linalg.norm(equations.f(geometry, alpha, pose.x))
    assert residual <= 1e-14
    assert pose.residual == pytest.approx(residual, abs=1e-14)


@given(geometry=legs(), alpha=crank_angles)
def test_the_points_keep_every_length_and_bend(geometry: KlannGeometry, alpha: float) -> None:
    a, b, c, d, e, f, g, h = solved(geometry, alpha).points
    pairs = [(a, b), (b, c), (d, c), (c, g), (e, f), (f, g), (g, h)]
    lengths = [math.dist(p, q) for p, q in pairs]
    np.testing.assert_allclose(lengths, [getattr(geometry, name) for name in LENGTHS], atol=1e-13)

    def bend(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        (x1, y1), (x2, y2) = q - p, r - q
        return math.atan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)

    assert math.sin(bend(b, c, g) - geometry.angle_bcg) == pytest.approx(0, abs=1e-12)
    assert math.sin(bend(f, g, h) + geometry.angle_fgh) == pytest.approx(0, abs=1e-12)


@given(geometry=legs(), alpha=crank_angles)
def test_h_is_the_last_point(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    np.testing.assert_allclose(pose.h, pose.points[7], rtol=0, atol=1e-14)


@given(geometry=legs(), alpha=crank_angles)
def test_the_assembly_holds(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    signs = math.sin(pose.gamma + pose.beta), math.sin(pose.delta + pose.theta)
    assert tuple(int(math.copysign(1, s)) for s in signs) == geometry.assembly


@given(geometry=legs(), alpha=crank_angles, rate=st.floats(-10.0, 10.0))
def test_velocity_is_the_difference_of_poses(
    geometry: KlannGeometry, alpha: float, rate: float
) -> None:
    leg = KlannLeg(geometry)
    pose = solved(geometry, alpha)
    velocity = leg.velocity(pose, rate)
    step = 1e-6
    before, after = solved(geometry, alpha - step), solved(geometry, alpha + step)
    angles = np.array(
        [math.remainder(b - a, 2 * math.pi) for a, b in zip(before.x, after.x, strict=True)]
    )
    scale = max(1.0, *map(abs, pose.coefficients)) ** 3 * 1e-6
    np.testing.assert_allclose(velocity[1:5], angles / (2 * step) * rate, rtol=1e-6, atol=scale)
    foot = (np.array(after.h) - before.h) / (2 * step) * rate
    np.testing.assert_allclose(velocity.h, foot, rtol=1e-6, atol=scale)
    assert velocity.alpha == rate


@given(geometry=legs(), alpha=crank_angles)
def test_both_methods_give_the_same_coefficients(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    other = KlannLeg(geometry).closed_form(alpha)
    np.testing.assert_allclose(pose.coefficients, other.coefficients, rtol=1e-8, atol=1e-9)


@given(geometry=legs(), alpha=crank_angles, factor=st.sampled_from([0.001, 0.5, 3.0, 1000.0]))
def test_scaled_lengths_scale_the_points_and_keep_the_angles(
    geometry: KlannGeometry, alpha: float, factor: float
) -> None:
    pose = solved(geometry, alpha)
    numbers = {name: factor * getattr(geometry, name) for name in LENGTHS + COORDINATES}
    scaled = solved(replace(geometry, **numbers), alpha)
    np.testing.assert_allclose(scaled.points, factor * pose.points, rtol=0, atol=1e-12 * factor)


@given(geometry=legs(), alpha=crank_angles)
def test_a_mirrored_leg_has_mirrored_points(geometry: KlannGeometry, alpha: float) -> None:
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
    np.testing.assert_allclose(other.points, pose.points * [-1, 1], rtol=0, atol=1e-12)


@pytest.mark.parametrize('method', ['solve', 'closed_form'])
def test_a_singular_pose_has_no_velocity(method: str) -> None:
    # BD reaches its greatest length just where BC and DC are in line.
    geometry = KlannGeometry(l_bc=0.12 + math.hypot(0.35, 0.09) - 0.14 + 1e-16)
    leg = KlannLeg(geometry)
    singular = math.atan2(-0.09, 0.35) + math.pi
    pose = getattr(leg, method)(singular + 1e-9)
    with pytest.raises(SingularPoseError, match='is singular'):
        leg.velocity(pose, 1.0)
    # The next solve does without its tangent.
    assert leg.solve(singular + 0.1).iterations > 0


@pytest.mark.parametrize('rate', [math.nan, math.inf, None, '1'])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    leg = KlannLeg()
    with pytest.raises(ValueError, match=r'alpha_rate = .* must be finite'):
        leg.velocity(leg.solve(1.0), rate)


def test_the_points_are_a_copy() -> None:
    pose = KlannLeg().solve(1.0)
    pose.points[7] = 0.0
    assert pose.points[7].tolist() == pytest.approx(pose.h)
