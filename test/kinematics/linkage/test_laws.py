"""Laws that every linkage obeys, dyadic or coupled."""

from dataclasses import replace
import math
import pickle

from hypothesis import assume, given, strategies as st
from klann_ros.kinematics import (
    GeometryError,
    KinematicsError,
    Linkage,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
)
import numpy as np
import pytest

BASES = [shipped_linkage(name).description for name in shipped_linkages()]
alphas = st.floats(-50.0, 50.0)


@st.composite
def linkages(draw: st.DrawFn) -> LinkageLeg:
    """Draw a shipped linkage with every bar and pivot changed by up to 5 %."""
    base = draw(st.sampled_from(BASES))
    factors = st.floats(0.95, 1.05)
    bodies = tuple(
        replace(body, bars=tuple(replace(b, vector=b.vector * draw(factors)) for b in body.bars))
        for body in base.bodies
    )
    pivots = {name: place * draw(factors) for name, place in base.pivots.items()}
    try:
        return LinkageLeg(Linkage(replace(base, bodies=bodies, pivots=pivots)))
    except GeometryError:
        assume(False)
        raise


def solved(leg: LinkageLeg, alpha: float) -> LinkagePose:
    """Return a pose that is not close to singular, or drop the example."""
    try:
        pose = leg.solve(alpha)
    except KinematicsError:
        assume(False)
        raise
    assume(min(pose.sines) > 0.05)
    return pose


@given(leg=linkages(), alpha=alphas, data=st.data())
def test_phi_is_the_central_difference_of_f(
    leg: LinkageLeg, alpha: float, data: st.DataObject
) -> None:
    linkage = leg.linkage
    n = len(linkage.joint_names) - 1
    x = np.array(data.draw(st.lists(st.floats(-3.0, 3.0), min_size=n, max_size=n)))
    step = 1e-6
    columns = [
        (linkage.f(alpha, x + step * e) - linkage.f(alpha, x - step * e)) / (2 * step)
        for e in np.eye(n)
    ]
    np.testing.assert_allclose(linkage.phi(alpha, x), np.transpose(columns), rtol=0, atol=1e-9)
    by_alpha = (linkage.f(alpha + step, x) - linkage.f(alpha - step, x)) / (2 * step)
    np.testing.assert_allclose(linkage.f_alpha(alpha, x), by_alpha, rtol=0, atol=1e-9)


@given(leg=linkages(), alpha=alphas)
def test_a_solved_pose_keeps_every_bar(leg: LinkageLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    assert pose.residual <= 1e-14
    assert np.abs(leg.linkage.f(alpha, pose.x)).max() <= 1e-14
    description = leg.linkage.description
    points = dict(zip(description.points, pose.points, strict=True))
    for name, place in description.pivots.items():
        assert complex(*points[name]) == place
    for body in description.bodies:
        for bar in body.bars:
            assert math.dist(points[bar.start], points[bar.end]) == pytest.approx(
                abs(bar.vector), abs=1e-13
            )
    np.testing.assert_allclose(points[description.foot], pose.h, rtol=0, atol=1e-15)


@given(leg=linkages(), alpha=alphas)
def test_the_coefficients_are_those_of_the_whole_jacobian(leg: LinkageLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    linkage = leg.linkage
    expected = np.linalg.solve(linkage.phi(alpha, pose.x), -linkage.f_alpha(alpha, pose.x))
    np.testing.assert_allclose(pose.coefficients, expected, rtol=1e-9, atol=1e-10)


@given(leg=linkages(), alpha=alphas, rate=st.floats(-5.0, 5.0), spin=st.floats(-5.0, 5.0))
def test_velocity_and_acceleration_are_differences_of_poses(
    leg: LinkageLeg, alpha: float, rate: float, spin: float
) -> None:
    step = 1e-5
    pose = solved(leg, alpha)
    # Differences are off by a third derivative, which grows with a power of 1 / sine.
    assume(min(pose.sines) > 0.2)

    def at(time: float) -> LinkagePose:
        return solved(leg, alpha + rate * time + spin * time**2 / 2)

    before, after = at(-step), at(step)
    velocity, acceleration = leg.velocity(pose, rate), leg.acceleration(pose, rate, spin)
    scale = max(1.0, *map(abs, pose.coefficients)) ** 5
    np.testing.assert_allclose(
        velocity.points, (after.points - before.points) / (2 * step), rtol=0, atol=1e-7 * scale
    )
    change = leg.velocity(after, rate + spin * step).points
    change = change - leg.velocity(before, rate - spin * step).points
    np.testing.assert_allclose(
        acceleration.points, change / (2 * step), rtol=1e-6, atol=1e-6 * scale
    )
    joints = np.array(leg.velocity(after, rate + spin * step).joints)
    joints -= leg.velocity(before, rate - spin * step).joints
    np.testing.assert_allclose(
        acceleration.joints, joints / (2 * step), rtol=1e-6, atol=1e-6 * scale
    )
    np.testing.assert_array_equal(velocity.points[leg.linkage.foot], velocity.h)


@given(leg=linkages(), alpha=alphas, force=st.tuples(*[st.floats(-100.0, 100.0)] * 2))
def test_the_crank_does_the_work_that_the_foot_takes(
    leg: LinkageLeg, alpha: float, force: tuple[float, float]
) -> None:
    pose = solved(leg, alpha)
    torque = leg.crank_torque(pose, force)
    rate = 2.0
    power = torque * rate + np.dot(force, leg.velocity(pose, rate).h)
    assert power == pytest.approx(0.0, abs=1e-11)


@given(leg=linkages(), alpha=alphas, factor=st.sampled_from([0.001, 3.0, 1000.0]))
def test_scaled_lengths_scale_the_points(leg: LinkageLeg, alpha: float, factor: float) -> None:
    pose = solved(leg, alpha)
    base = leg.linkage.description
    bodies = tuple(
        replace(body, bars=tuple(replace(b, vector=b.vector * factor) for b in body.bars))
        for body in base.bodies
    )
    pivots = {name: place * factor for name, place in base.pivots.items()}
    scaled = LinkageLeg(Linkage(replace(base, bodies=bodies, pivots=pivots)))
    np.testing.assert_allclose(
        solved(scaled, alpha).points, factor * pose.points, rtol=0, atol=1e-12 * factor
    )


@given(leg=linkages(), alpha=alphas)
def test_a_mirrored_linkage_has_mirrored_points(leg: LinkageLeg, alpha: float) -> None:
    """Mirrored in the x axis: pivots and bends conjugate, every angle changes its sign."""
    pose = solved(leg, alpha)
    base = leg.linkage.description
    bodies = tuple(
        replace(body, bars=tuple(replace(b, vector=b.vector.conjugate()) for b in body.bars))
        for body in base.bodies
    )
    mirrored = LinkageLeg(
        Linkage(
            replace(
                base,
                bodies=bodies,
                pivots={name: place.conjugate() for name, place in base.pivots.items()},
                start={name: -angle for name, angle in base.start.items()},
            )
        )
    )
    other = solved(mirrored, -alpha)
    np.testing.assert_allclose(other.points, pose.points * [1, -1], rtol=0, atol=1e-12)


@given(leg=linkages(), alpha=alphas)
def test_clockwise_angles_are_the_others_with_the_other_sign(
    leg: LinkageLeg, alpha: float
) -> None:
    pose = solved(leg, alpha)
    base = leg.linkage.description
    crank, *others = base.bodies
    turned = LinkageLeg(
        Linkage(
            replace(
                base,
                bodies=(crank, *(replace(b, clockwise=not b.clockwise) for b in others)),
                start={n: a if n == crank.angle else -a for n, a in base.start.items()},
            )
        )
    )
    other = solved(turned, alpha)
    np.testing.assert_allclose(np.sin(np.add(other.x, pose.x)), 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(other.points, pose.points, rtol=0, atol=1e-12)


@given(leg=linkages(), alpha=alphas, steps=st.lists(st.floats(-4.0, 4.0), max_size=6))
def test_wherever_the_crank_has_been_the_pose_is_the_same(
    leg: LinkageLeg, alpha: float, steps: list[float]
) -> None:
    pose = solved(leg, alpha)
    for step in steps:
        try:
            leg.solve(alpha + step)
        except KinematicsError:
            continue
    again = leg.solve(alpha)
    allowed = 1e-11 / min(pose.sines)
    np.testing.assert_allclose(again.points, pose.points, rtol=0, atol=allowed)
    leg.reset()
    np.testing.assert_allclose(leg.solve(alpha).points, pose.points, rtol=0, atol=allowed)


@given(leg=linkages())
def test_it_is_solved_where_its_arcs_say_and_nowhere_else(leg: LinkageLeg) -> None:
    arcs = leg.reachable_arcs()
    assert arcs
    turn = 2 * math.pi
    for alpha in np.linspace(0.0, turn, 73).tolist():
        inside = any(a <= alpha <= b or a <= alpha + turn <= b for a, b in arcs)
        edges = [edge for arc in arcs for edge in arc]
        if (
            arcs != [(0.0, turn)]
            and min(abs(math.remainder(alpha - e, turn)) for e in edges) < 1e-6
        ):
            continue
        try:
            leg.solve(alpha)
        except KinematicsError:
            assert not inside
        else:
            assert inside


def test_a_failed_solve_leaves_the_last_pose() -> None:
    base = shipped_linkage('four_bar').description
    pivots = {**base.pivots, 'O4': complex(0.3)}
    leg = LinkageLeg(Linkage(replace(base, pivots=pivots)))
    pose = leg.solve(1.0)
    (start, end), *_ = leg.reachable_arcs()
    with pytest.raises(KinematicsError, match='dyad 1 does not close, A and O4 are'):
        leg.solve((end + start + 2 * math.pi) / 2)
    assert leg.last is pose


@given(leg=linkages(), alpha=alphas)
def test_what_is_pickled_comes_back_equal(leg: LinkageLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    again = pickle.loads(pickle.dumps(pose))  # noqa: S301 - our own
    assert again == pose
    assert pickle.loads(pickle.dumps(leg)).solve(alpha).h == pytest.approx(pose.h)  # noqa: S301


def test_coupled_loops_say_where_their_branch_ends() -> None:
    base = shipped_linkage('stephenson').description
    crank = replace(
        base.crank, bars=tuple(replace(b, vector=2.8 * b.vector) for b in base.crank.bars)
    )
    leg = LinkageLeg(Linkage(replace(base, bodies=(crank, *base.bodies[1:]))))
    ((start, end),) = leg.reachable_arcs()
    assert end - start < 2 * math.pi
    for inside, outside in ((start + 1e-6, start - 1e-6), (end - 1e-6, end + 1e-6)):
        assert leg.solve(inside).residual <= 1e-14
        with pytest.raises(KinematicsError) as caught:
            leg.solve(outside)
        assert 'the coupled loops of block 1 do not close' in str(caught.value)
        assert caught.value.nearest == pytest.approx((inside + outside) / 2, abs=1e-8)
