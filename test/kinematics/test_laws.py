"""Laws that every linkage obeys: the two courses', those of files, dyadic or coupled."""

from collections.abc import Callable
from dataclasses import replace
import math
import pickle
from typing import Any

from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import (
    FourBar,
    ImmobileDirectionError,
    KinematicsError,
    KlannGeometry,
    Leg,
    Linkage,
    linkage_poses,
    SingularPoseError,
    Variants,
)
import numpy as np
import pytest
from sample_linkages import allowed, alphas, difference, fresh, leg_of, legs, NAMES, solved

AnyLeg = Leg[Any, Any]
rates = st.floats(-5.0, 5.0)
STEP = 1e-5
# Three examples of each linkage, on average.
FOR_EACH = settings(max_examples=3 * len(NAMES))


@FOR_EACH
@given(leg=legs(), alpha=alphas, data=st.data())
def test_phi_is_the_central_difference_of_f(leg: AnyLeg, alpha: float, data: Any) -> None:
    linkage = leg.linkage
    step = 1e-6
    n = len(linkage.joint_names) - 1
    x = np.array(data.draw(st.lists(st.floats(-3.0, 3.0), min_size=n, max_size=n)))
    columns = [
        (linkage.f(alpha, x + step * e) - linkage.f(alpha, x - step * e)) / (2 * step)
        for e in np.eye(n)
    ]
    np.testing.assert_allclose(linkage.phi(alpha, x), np.transpose(columns), rtol=0, atol=1e-9)
    by_alpha = (linkage.f(alpha + step, x) - linkage.f(alpha - step, x)) / (2 * step)
    np.testing.assert_allclose(linkage.f_alpha(alpha, x), by_alpha, rtol=0, atol=1e-9)


@FOR_EACH
@given(leg=legs(), alpha=alphas)
def test_a_solved_pose_closes_and_keeps_every_bar(leg: AnyLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    linkage = leg.linkage
    assert pose.residual <= 1e-14
    assert np.abs(linkage.f(alpha, pose.x)).max() <= 1e-14
    structure = linkage.structure
    points = dict(zip(structure.points, pose.points, strict=True))
    for name, place in zip(structure.pivots, linkage.pivots, strict=True):
        assert complex(*points[name]) == place
    for (body, bar), vector in zip(structure.bars, linkage.bars, strict=True):
        length = math.dist(points[bar.start], points[bar.end])
        if structure.bodies[body].bars[0] is bar and structure.bodies[body].slides:
            frame = structure.frames[body]
            way = pose.joints[body] * vector * (1.0 if frame < 0 else pose.vectors[frame])
            assert complex(*(points[bar.end] - points[bar.start])) == pytest.approx(way, abs=1e-13)
        else:
            assert length == pytest.approx(abs(vector), abs=1e-13)
    np.testing.assert_allclose(points[structure.foot], pose.h, rtol=0, atol=1e-14)


@FOR_EACH
@given(leg=legs(), alpha=alphas)
def test_both_methods_give_the_same_pose(leg: AnyLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    geometric_pose = leg.closed_form(alpha)
    assert difference(pose, geometric_pose) <= allowed(pose)
    np.testing.assert_allclose(pose.points, geometric_pose.points, rtol=0, atol=allowed(pose))
    coefficients = geometric_pose.coefficients
    np.testing.assert_allclose(pose.coefficients, coefficients, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(pose.sines, geometric_pose.sines, rtol=0, atol=1e-9)


@FOR_EACH
@given(leg=legs(), alpha=alphas)
def test_a_pose_is_in_its_assembly_as_good_as_its_angles(leg: AnyLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    for block, sign in zip(leg.linkage.blocks, leg.assembly, strict=True):
        assert block.sine(pose.vectors) * sign > 0
    np.testing.assert_allclose(pose.sines, np.sin(pose.transmission_angles), atol=1e-14)
    assert pose.distance_to_singularity == min(pose.clearances) > 0.0
    assert pose.condition >= 1.0


@given(leg=legs(), alpha=alphas, factors=st.lists(st.floats(0.98, 1.02), min_size=3, max_size=3))
def test_many_at_once_are_the_same_as_one_by_one(leg: AnyLeg, alpha: float, factors: Any) -> None:
    name = next(iter(leg.linkage.dimensions))
    variants = Variants(leg.linkage, {name: leg.linkage.dimensions[name] * np.array(factors)})
    crank_angles = np.array([alpha, alpha + 1.0])
    # Of numba's kernels batch/test_velocities.py claims the same.
    poses = linkage_poses(variants, crank_angles, angles=True, points=True, kernel='numpy')
    for i, j in np.ndindex(*poses.reason.shape):
        if variants.refused[i]:
            continue
        try:
            pose = leg_of(variants[i]).closed_form(crank_angles[j])
        except KinematicsError:
            continue
        # A branch may end between the two ways to it.
        assume(min(pose.sines) > 1e-3)
        assert poses.reason[i, j] == 0
        limit = allowed(pose)
        np.testing.assert_allclose(poses.h[i, j], pose.h, rtol=0, atol=limit)
        np.testing.assert_allclose(poses.points[i, j], pose.points, rtol=0, atol=limit)
        assert np.abs(np.sin(poses.angles[i, j] - pose.x)).max() <= limit


@FOR_EACH
@given(leg=legs(), alpha=alphas, rate=rates, spin=rates)
def test_motion_is_differences_of_poses(
    leg: AnyLeg, alpha: float, rate: float, spin: float
) -> None:
    # Differences are off by a third derivative, which grows with a power of 1 / sine.
    pose = solved(leg, alpha, 0.2)

    def pose_at(time: float) -> Any:
        return solved(leg, alpha + rate * time + spin * time**2 / 2, 0.2)

    earlier, later = pose_at(-STEP), pose_at(STEP)
    velocity = leg.velocity(pose, rate)
    acceleration = leg.acceleration(pose, rate, spin)
    scale = max(1.0, *map(abs, pose.coefficients)) ** 5
    rates_of_points = (later.points - earlier.points) / (2 * STEP)
    np.testing.assert_allclose(velocity.points, rates_of_points, rtol=0, atol=1e-7 * scale)
    first = leg.velocity(earlier, rate - spin * STEP)
    last = leg.velocity(later, rate + spin * STEP)
    for attribute in ('points', 'joints', 'h'):
        change = np.subtract(getattr(last, attribute), getattr(first, attribute)) / (2 * STEP)
        derivative = getattr(acceleration, attribute)
        np.testing.assert_allclose(derivative, change, rtol=1e-6, atol=1e-6 * scale)
    assert velocity.joints[0] == rate
    assert acceleration.joints[0] == spin


@FOR_EACH
@given(leg=legs(), alpha=alphas, rate=rates, change=rates)
def test_bars_keep_their_length_and_pivots_rest(
    leg: AnyLeg, alpha: float, rate: float, change: float
) -> None:
    pose = solved(leg, alpha)
    structure = leg.linkage.structure
    acceleration = leg.acceleration(pose, rate, change)
    velocity = acceleration.velocity
    pivots = [*map(structure.points.index, structure.pivots)]
    for motion in (velocity, acceleration):
        limit = 1e-13 * (1.0 + np.abs(motion.points).max())
        np.testing.assert_allclose(motion.points[leg.linkage.foot], motion.h, rtol=0, atol=limit)
        assert not motion.points[pivots].any()
    p = pose.points
    v = velocity.points
    a = acceleration.points
    scale = 1e-12 * (1.0 + abs(v).max() ** 2 + abs(a).max())
    for number, (_, bar) in enumerate(structure.bars):
        if number not in structure.lines:
            i, j = structure.points.index(bar.start), structure.points.index(bar.end)
            link, turning, changing = p[j] - p[i], v[j] - v[i], a[j] - a[i]
            assert link @ turning == pytest.approx(0.0, abs=scale)
            assert link @ changing + turning @ turning == pytest.approx(0.0, abs=scale)


@FOR_EACH
@given(leg=legs(), alpha=alphas, force=st.tuples(*[st.floats(-100.0, 100.0)] * 2), rate=rates)
def test_crank_and_foot_do_no_work(leg: AnyLeg, alpha: float, force: Any, rate: float) -> None:
    pose = solved(leg, alpha)
    velocity = leg.velocity(pose, rate).h
    power = leg.crank_torque(pose, force) * rate + np.dot(force, velocity)
    scale = 1e-12 * (1.0 + np.linalg.norm(force) * np.linalg.norm(velocity))
    assert power == pytest.approx(0.0, abs=scale)


@FOR_EACH
@given(leg=legs(), alpha=alphas, force=st.floats(-1e3, 1e3), direction=st.floats(-3.2, 3.2))
def test_a_force_takes_the_torque_it_balances(
    leg: AnyLeg, alpha: float, force: float, direction: float
) -> None:
    pose = solved(leg, alpha)
    u = math.cos(direction), math.sin(direction)
    h_1 = leg.velocity(pose, 1.0).h
    assume(abs(np.dot(u, h_1)) > 1e-3 * np.linalg.norm(h_1))
    torque = leg.crank_torque(pose, (force * u[0], force * u[1]))
    back = leg.foot_force(pose, torque, (-7 * u[0], -7 * u[1]))
    assert back == pytest.approx(-force, rel=1e-9, abs=1e-9)


def test_across_its_path_the_foot_balances_any_force() -> None:
    leg = fresh('sem104')
    pose = leg.solve(1.0)
    x_1, y_1 = leg.velocity(pose, 1.0).h
    with pytest.raises(ImmobileDirectionError, match=r'dH/dalpha = \(.*\) m/rad') as caught:
        leg.foot_force(pose, 1.0, (-1e300 * y_1, 1e300 * x_1))
    assert caught.value.h_1 == (x_1, y_1)
    assert math.hypot(*caught.value.direction) == pytest.approx(1.0)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


# Similarity.


def turned_about(linkage: Linkage) -> Linkage:
    """Return it with every angle but the crank's measured the other way round."""
    crank, *driven = linkage.structure.bodies
    bodies = (crank, *(body._replace(clockwise=not body.clockwise) for body in driven))
    structure = replace(linkage.structure, bodies=bodies)
    start = None
    if linkage.start_guess is not None:
        pairs = zip(linkage.structure.bodies[1:], linkage.start_guess[1:], strict=True)
        start = [linkage.start_guess[0], *(x if body.slides else -x for body, x in pairs)]
    return Linkage(structure, linkage.numbers, assembly=linkage.assembly, start=start)


@pytest.mark.parametrize(
    ('change', 'crank', 'points'),
    [
        (lambda linkage: linkage.scaled(0.001), 1, (0.001, 0.001)),
        (lambda linkage: linkage.scaled(1000.0), 1, (1000.0, 1000.0)),
        (Linkage.mirrored, -1, (1.0, -1.0)),
        (turned_about, 1, (1.0, 1.0)),
        (lambda linkage: linkage.varied({}), 1, (1.0, 1.0)),
    ],
    ids=['small', 'large', 'mirrored', 'clockwise', 'the same'],
)
@settings(max_examples=30)
@given(leg=legs(), alpha=alphas)
def test_a_similar_linkage_moves_alike(
    change: Callable[[Linkage], Linkage], crank: int, points: Any, leg: AnyLeg, alpha: float
) -> None:
    pose = solved(leg, alpha, 0.1)
    similar_leg = leg_of(change(leg.linkage))
    similar_pose = solved(similar_leg, crank * alpha, 0.09)
    motion = leg.acceleration(pose, 2.0, 3.0)
    similar_motion = similar_leg.acceleration(similar_pose, crank * 2.0, crank * 3.0)
    factor = max(map(abs, points))
    for original, similar, digits in (
        (pose.points, similar_pose.points, 1e-12),
        (motion.velocity.points, similar_motion.velocity.points, 1e-9),
        (motion.points, similar_motion.points, 1e-8),
    ):
        limit = digits * factor * (1.0 + np.abs(original).max())
        np.testing.assert_allclose(similar, original * points, rtol=0, atol=limit)
    if leg.linkage.is_dyadic:
        clearances = np.divide(similar_pose.clearances, factor)
        np.testing.assert_allclose(clearances, pose.clearances, rtol=1e-9, atol=1e-11)


# Where it has been, and where it can be.


@settings(max_examples=100)
@given(leg=legs(0.3), steps=st.lists(alphas, min_size=2, max_size=10))
def test_after_jumps_of_any_size_the_pose_is_the_closed_forms(leg: AnyLeg, steps: Any) -> None:
    for alpha in steps:
        try:
            expected = leg.closed_form(alpha)
        except KinematicsError as error:
            assume(getattr(error, 'shortfall', 1.0) > 1e-12)
            last_pose = leg.last
            with pytest.raises(type(error)) as caught:
                leg.solve(alpha)
            assert caught.value.args == error.args
            assert leg.last is last_pose
        else:
            # With the ends of a dyad together but for rounding, its links point anywhere.
            assume(min(expected.sines) > 1e-6 or min(expected.clearances) < 1e-9)
            pose = leg.solve(alpha)
            assert difference(pose, expected) <= allowed(expected)
            assert pose.crank_angle == alpha


@pytest.mark.parametrize('name', NAMES)
def test_whole_turns_close(name: str) -> None:
    leg = fresh(name)
    turns = 1000
    (start, end), *_ = leg.reachable_arcs()
    alpha = (start + end) / 2
    first = leg.solve(alpha)
    again = leg.solve(alpha + turns * 2 * math.pi)
    assert difference(first, again) <= 1e-11
    assert again.crank_angle == alpha + turns * 2 * math.pi


@settings(max_examples=40)
@given(leg=legs(0.3))
def test_it_is_solvable_exactly_on_its_reachable_arcs(leg: AnyLeg) -> None:
    arcs = leg.reachable_arcs()
    turn = 2 * math.pi
    edges = [edge for arc in arcs for edge in arc]
    for alpha in np.linspace(0.0, turn, 37).tolist():
        inside = any(a <= alpha <= b or a <= alpha + turn <= b for a, b in arcs)
        near = any(abs(math.remainder(alpha - edge, turn)) < 1e-6 for edge in edges)
        if near and arcs != [(0.0, turn)]:
            continue
        try:
            leg.solve(alpha)
        except KinematicsError:
            assert not inside
        else:
            assert inside


@settings(max_examples=30)
@given(leg=legs(0.3))
def test_the_singularity_is_at_the_ends_of_the_arcs(leg: AnyLeg) -> None:
    arcs = leg.reachable_arcs()
    assume(leg.linkage.is_dyadic and arcs not in ([(0.0, 2 * math.pi)], []))
    for start, end in arcs:
        # The very end may be rounded out of reach.
        inside = min(1e-11, (end - start) / 4)
        for alpha in (start + inside, end - inside):
            assert abs(leg.closed_form(alpha).distance_to_singularity) <= 1e-9


@pytest.mark.parametrize('method', ['solve', 'closed_form'])
def test_a_singular_pose_has_no_motion_and_transmits_nothing_known(method: str) -> None:
    # |BD| reaches its greatest length just where BC and DC are in line.
    stretched = KlannGeometry(l_bc=0.12 + math.hypot(0.35, 0.09) - 0.14 + 1e-16).linkage
    for leg, alpha in (
        (
            leg_of(stretched.at_every_change_point('sign')),
            math.atan2(-0.09, 0.35) + math.pi + 1e-9,
        ),
        (FourBar(0.18, 0.08, 0.18, 0.08, at_change_points='sign'), 0.0),
    ):
        pose = getattr(leg, method)(alpha)
        for motion, arguments in (
            (leg.velocity, (1.0,)),
            (leg.acceleration, (1.0, 0.0)),
            (leg.crank_torque, ((1.0, 0.0),)),
            (leg.foot_force, (1.0, (1.0, 0.0))),
        ):
            with pytest.raises(SingularPoseError, match='is singular'):
                motion(pose, *arguments)
        # The next solve does without its tangent.
        assert leg.solve(alpha + 0.1).iterations > 0


@FOR_EACH
@given(leg=legs(), alpha=alphas)
def test_pickles_are_restored_equal(leg: AnyLeg, alpha: float) -> None:
    pose = solved(leg, alpha)
    again = pickle.loads(pickle.dumps(pose))  # noqa: S301 - our own
    assert again == pose
    assert pickle.loads(pickle.dumps(leg)).solve(alpha).h == pytest.approx(pose.h)  # noqa: S301


def test_a_pose_of_another_linkage_is_refused_and_one_of_an_equal_one_is_not() -> None:
    klann, jansen = fresh('sem104'), fresh('jansen')
    pose = jansen.solve(1.0)
    for ask in (
        lambda: klann.velocity(pose, 1.0),
        lambda: klann.acceleration(pose, 1.0, 0.0),
        lambda: klann.crank_torque(pose, (0.0, 1.0)),
        lambda: klann.foot_force(pose, 1.0, (0.0, 1.0)),
    ):
        with pytest.raises(ValueError, match=r"another linkage, 'Jansen leg' with m, j, b"):
            ask()
    klann_pose, equal_pose = klann.solve(1.0), fresh('sem104').solve(1.0)
    assert klann.velocity(equal_pose, 1.0).h == klann.velocity(klann_pose, 1.0).h


@pytest.mark.parametrize('name', NAMES)
def test_a_pose_and_its_motion_are_shown_in_a_line(name: str) -> None:
    leg = fresh(name)
    pose = leg.closed_form(leg.reachable_arcs()[0][0] + 0.5)
    for line in (repr(pose), repr(leg.velocity(pose, 1.0))):
        assert len(line) < 300
        assert all(f'{joint}=' in line for joint in leg.joint_names)
        assert 'h=(' in line
