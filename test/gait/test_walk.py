"""A body on its feet: where it rests, and how far it walks."""

from cmath import rect
from dataclasses import replace
from math import pi
from pathlib import Path

from change_point_linkages import change_point_linkage
from hypothesis import example, given, settings, strategies as st
from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, GaitFigures, NoWalkerError, walk_figures
from klann_ros.gait.stance import (
    BodyStep,
    dissipation_hessian,
    edge_distance,
    foot_motion,
    FootMotion,
    gravity_aligned,
    inverse,
    minimize_slip,
    MotionPrior,
    product,
    spring_loads,
    support,
    zero_moment_point,
)
from klann_ros.kinematics import linkage_poses
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import Robot, robot_of
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
ANGLES = st.floats(-50.0, 50.0)
EIGHT = Feet(robot_of(str(CONFIG / 'walker8_two_motors.yaml')), foot_radius=0.004)


@pytest.fixture(scope='module')
def six() -> Robot:
    return robot_of(str(CONFIG / 'walker6.yaml'))


@pytest.fixture(scope='module')
def feet(six: Robot) -> Feet:
    return Feet(six)


@pytest.fixture(scope='module')
def walk(six: Robot) -> GaitFigures:
    return walk_figures(six)


@given(st.lists(ANGLES, min_size=2, max_size=2))
def test_a_single_pose_is_that_of_many(angles: list[float]) -> None:
    poses = EIGHT.at(angles)
    feet, rolled, centre = EIGHT.pose(angles)
    assert np.array(feet) == pytest.approx(poses.feet, abs=1e-15)
    assert np.array(rolled) == pytest.approx(poses.rolled, abs=1e-15)
    assert centre == pytest.approx(poses.centre, abs=1e-15)


def test_walker6_walks_as_its_stance_predicts(walk: GaitFigures) -> None:
    # 0.1501 m/s at 1 rad/s is what a generator of its own got by least squares over the stance.
    assert walk.speed == pytest.approx(0.1501, rel=0.015)
    assert walk.stride == pytest.approx(2.0 * pi * walk.speed)


def test_walker6_stands_as_its_file_states(walk: GaitFigures) -> None:
    tripods = sum(list(walk.support_patterns().values())[:2])
    assert tripods == pytest.approx(0.978, abs=0.001)
    assert walk.stable_fraction == 1.0
    assert np.degrees([walk.greatest_pitch, walk.greatest_roll]).max() < 1.0
    assert walk.height_variation == pytest.approx(0.019, abs=0.0005)
    assert (walk.loads > 0.0).mean(axis=0) == pytest.approx(np.full(6, 0.5), abs=0.003)


def test_walker4_tips_as_its_file_states() -> None:
    walk = walk_figures(robot_of(str(CONFIG / 'walker4.yaml')))
    assert np.degrees(walk.greatest_roll) == pytest.approx(27.2, abs=0.5)
    assert np.median((walk.loads > 0.0).sum(axis=1)) == 3


def test_a_walker_is_warned_of_that_walks_backwards_or_hardly_stands(
    six: Robot, walk: GaitFigures
) -> None:
    assert walk.warnings == []
    assert six.body is not None
    nose_heavy = replace(six, body=replace(six.body, centre=(1.5, 0.0, 0.115)))
    (warning,) = walk_figures(nose_heavy, samples=90).warnings
    assert 'statically unstable for 56% of a turn' in warning
    legs = [
        replace(leg, mount=replace(leg.mount, rpy=(-leg.mount.rpy[0], 0.0, leg.mount.rpy[2])))
        for leg in six.legs
    ]
    upside_down = walk_figures(replace(six, legs=tuple(legs)), samples=90)
    assert any('walks backwards' in warning for warning in upside_down.warnings)


def test_a_symmetric_walker_drives_straight(walk: GaitFigures) -> None:
    assert walk.advance[-1, 2] == pytest.approx(0.0, abs=1e-9)
    assert abs(walk.advance[-1, 1]) < 0.005 * walk.stride


def test_the_second_half_of_the_turn_mirrors_the_first(walk: GaitFigures) -> None:
    half = len(walk.alphas) // 2
    assert np.roll(walk.height, half) == pytest.approx(walk.height, abs=1e-9)
    # All but where it tips over, which is an instant.
    assert np.mean(np.isclose(np.roll(walk.roll, half), -walk.roll, atol=1e-6)) > 0.99


@settings(max_examples=40, deadline=None)
@given(angle=ANGLES)
def test_the_feet_are_where_the_linkage_puts_them(feet: Feet, angle: float) -> None:
    positions = feet.at([angle]).feet
    for foot, leg in zip(positions, feet.robot.legs, strict=True):
        expected = leg.mount.transform(linkage_poses(leg.linkage, leg.crank_angles(angle)).h)
        assert foot == pytest.approx(expected, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(
    feet=st.lists(
        st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.1, 0.1)),
        min_size=3,
        max_size=7,
    )
)
# A normal whose square is 0 in floating point.
@example(feet=[(0.0, 0.0, 0.0), (1e-143, 0.0, 0.0), (0.0, 1e-143, 0.0)])
def test_no_foot_is_below_the_plane_that_a_body_rests_on(
    feet: list[tuple[float, float, float]],
) -> None:
    body_support = support(feet, (0.0, 0.0, 0.5))
    if body_support is None:
        return
    heights = np.array(feet) @ body_support.normal + body_support.height
    assert heights.min() > -1e-9
    assert np.abs(heights[list(body_support.feet)]).max() < 2e-6
    assert sum(body_support.loads) == pytest.approx(1.0)
    assert body_support.margin >= 0.0
    # What carries is around what is below the centre.
    carried = np.array(body_support.loads) @ np.array(feet)[list(body_support.feet)]
    assert np.cross((0.0, 0.0, 0.5) - carried, body_support.normal) == pytest.approx(
        [0.0] * 3, abs=2e-6
    )


def test_a_body_stays_on_the_feet_that_hold_it_until_it_has_to_tip() -> None:
    # A foot at each end, and two in the middle that are lower: it leans forwards or back.
    feet = [(1.0, 0.0, -0.2), (0.0, 0.3, -0.3), (0.0, -0.3, -0.3), (-1.0, 0.0, -0.2)]
    forwards, back = (0, 1, 2), (1, 2, 3)
    for x, expected in ((0.01, forwards), (-0.01, back)):
        body_support = support(feet, (x, 0.0, 0.0))
        assert body_support.facet == expected
    held = support(feet, (-0.01, 0.0, 0.0), forwards)
    assert held.facet == forwards
    tipped = support(feet, (-0.05, 0.0, 0.0), forwards)
    assert tipped.facet == back


@pytest.mark.parametrize(
    ('pitch', 'facet'),
    [(0.09, (1, 2, 3)), (-0.08, (0, 1, 2)), (0.02, (1, 2, 3)), (0.4, (1, 2, 3))],
)
def test_a_seesaw_rests_on_the_feet_that_its_measured_attitude_shows(
    pitch: float, facet: tuple[int, int, int]
) -> None:
    # It may rest on either end, tipped by 0.1 rad; small differences show nothing.
    seesaw = [(-1.0, 0.0, -0.2), (0.0, 0.3, -0.3), (0.0, -0.3, -0.3), (1.0, 0.0, -0.2)]
    body_support = support(seesaw, (0.0, 0.0, 0.0), (1, 2, 3), (0.0, pitch), 0.09)
    assert body_support.facet == facet


def test_a_body_does_not_lie_down_on_raised_feet_that_would_hold_it_lower() -> None:
    feet = Feet(robot_of(str(CONFIG / 'walker8_two_motors.yaml')))
    angles = np.random.default_rng(0).uniform(0.0, 2.0 * pi, (200, 2))
    placed = feet.at(angles)
    tilts = []
    for points, centre in zip(placed.feet.tolist(), placed.centre.tolist(), strict=True):
        body_support = support(points, centre)
        tilts.append(np.arccos(body_support.normal[2]))
    assert np.degrees(max(tilts)) < 3.0


def test_a_body_that_no_foot_holds_keeps_its_velocity() -> None:
    # Two feet that carry the same are dragged against each other; one that carries more sticks.
    prior = MotionPrior(0.1, 0.0, (0.1, 0.0, 0.0, 0.1, 0.0, 1e18))
    for loads, speed in (((0.5, 0.5), 0.1), ((0.6, 0.4), 0.3)):
        feet = [FootMotion(-0.3, 0.2j, loads[0]), FootMotion(0.3, -0.2j, loads[1])]
        assert minimize_slip(feet, 1e-3, prior).motion == pytest.approx(speed, abs=0.01)


def test_the_covariance_is_the_inverse_information_of_feet_and_prior() -> None:
    feet = [
        FootMotion(0.0, 1j * position, load)
        for position, load in ((0.5 + 0.3j, 0.6), (-0.4 + 0.1j, 0.4))
    ]
    prior = MotionPrior(0.01, 0.0, (2.0, 0.5, 0.0, 3.0, 0.0, 1.0))
    step = minimize_slip(feet, 100.0, prior)
    information = np.array([[2.0, 0.5, 0.0], [0.5, 3.0, 0.0], [0.0, 0.0, 1.0]])
    for _, arm, load in feet:
        slip = np.array([[1.0, 0.0, arm.real], [0.0, 1.0, arm.imag]])
        information += load / 100.0 * slip.T @ slip
    a, b, c, d, e, f = step.covariance
    assert np.array([[a, b, c], [b, d, e], [c, e, f]]) == pytest.approx(
        np.linalg.inv(information), rel=1e-5
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_friction_informs_by_the_curvature_of_the_dissipation(seed: int, count: int) -> None:
    numbers = np.random.default_rng(seed)
    creep = 0.05
    small = 1e-3
    motions, arms = numbers.normal(size=(2, count, 2)) @ (1.0, 1j)
    loads, motion = numbers.random(count), numbers.normal(size=3)

    def dissipation(x: float, y: float, yaw: float) -> float:
        return float(loads @ np.hypot(abs(motions + x + 1j * y + yaw * arms), creep))

    def curvature(a: FloatArray, b: FloatArray) -> float:
        corners = ((1, 1), (-1, -1), (1, -1), (-1, 1))
        p, q, r, s = (dissipation(*(motion + i * a + j * b)) for i, j in corners)
        return (p + q - r - s) / (4.0 * small * small)

    feet = [FootMotion(*foot) for foot in zip(motions, arms, loads, strict=True)]
    step = BodyStep(complex(*motion[:2]), float(motion[2]))
    axes = small * np.eye(3)
    expected = [curvature(axes[i], axes[j]) for i in range(3) for j in range(i, 3)]
    assert dissipation_hessian(feet, step, creep) == pytest.approx(expected, rel=0.05, abs=0.05)


def test_four_feet_that_touch_share_the_weight() -> None:
    square = [(1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0)]
    body_support = support(square, (0.0, 0.0, 1.0))
    assert body_support.loads == pytest.approx([0.25] * 4)
    assert body_support.margin == pytest.approx(1.0)
    aside = support(square, (0.0, 0.9, 1.0))
    assert np.array(aside.loads) @ np.array(square)[list(aside.feet)] == pytest.approx([0, 0.9, 0])
    assert aside.margin == pytest.approx(0.1)


@pytest.mark.parametrize(
    ('feet', 'centre', 'distance'),
    [
        ([0, 1, 1j], -3 - 4j, 5.0),
        ([0, 1, 1j], 0.2 + 0.3j, 0.2),
        ([0, 0, 1, 1j], 0.4 - 0.1j, 0.1),
        ([0, 1, 1 + 1j, 1j], 0.5 + 0.5j, 0.5),
    ],
)
def test_the_edge_of_the_feet_is_that_of_their_hull(
    feet: list[complex], centre: complex, distance: float
) -> None:
    assert edge_distance(feet, centre) == pytest.approx(distance)


def test_a_body_beside_its_feet_does_not_rest() -> None:
    assert support([(0, 0, 0), (1, 0, 0), (0, 1, 0)], (0.6, 0.6, 1.0)) is None


def test_attitude_levels_the_feet_that_carry() -> None:
    feet = [(0.5, 0.4, -0.30), (0.4, -0.4, -0.35), (-0.5, 0.1, -0.31)]
    body_support = support(feet, (0.0, 0.0, 0.0))
    level = gravity_aligned(feet, body_support.roll, body_support.pitch)
    sides = [np.linalg.norm(np.subtract(feet[i], feet[i - 1])) for i in range(3)]
    # Seen from above, what lies level is as long as it is.
    assert [abs(level[i] - level[i - 1]) for i in range(3)] == pytest.approx(sides)
    assert body_support.height == pytest.approx(0.32, abs=0.02)


def test_feet_that_give_way_share_the_load_and_a_raised_foot_carries_none() -> None:
    square = [1.0 + 1.0j, 1.0 - 1.0j, -1.0 + 1.0j, -1.0 - 1.0j]
    assert spring_loads(square, [0.0] * 4, 0j) == pytest.approx([0.25] * 4)
    for heights, over in (([0.0] * 4, 0.3 - 0.2j), ([0.0, 1e-4, 0.0, 0.0], 0.1)):
        loads = np.array(spring_loads(square, heights, over))
        assert loads.sum() == pytest.approx(1.0)
        assert loads @ np.array(square) == pytest.approx(over, abs=1e-9)
    raised = spring_loads(square, [0.0, 0.01, 0.0, 0.0], -0.1 + 0.1j)
    assert raised == pytest.approx([0.5 - 0.05, 0.0, 0.1, 0.5 - 0.05], abs=1e-9)
    # Beside the feet: on the edge.
    assert sum(spring_loads(square, [0.0] * 4, 1.5)) == pytest.approx(1.0)


@settings(max_examples=60, deadline=None)
@given(
    x=st.floats(-0.01, 0.01),
    y=st.floats(-0.01, 0.01),
    yaw=st.floats(-0.02, 0.02),
    loads=st.lists(st.floats(0.05, 1.0), min_size=3, max_size=3),
)
def test_feet_that_agree_do_not_slip(x: float, y: float, yaw: float, loads: list[float]) -> None:
    # The body moves by (x, y, yaw) over feet that stand still.
    positions = [0.4 + 0.2j, 0.3 - 0.3j, -0.5 + 0.1j]
    feet = [
        foot_motion(position, (position - complex(x, y)) * rect(1.0, -yaw), load)
        for position, load in zip(positions, loads, strict=True)
    ]
    step = minimize_slip(feet, 1e-5)
    assert step.motion == pytest.approx(complex(x, y), abs=3e-4)
    assert step.yaw == pytest.approx(yaw, abs=3e-4)
    assert step.slid < 1e-4


def slid_by(steps: tuple[complex, ...], loads: tuple[float, ...]) -> list[FootMotion]:
    places = (0.5 + 0.3j, -0.5 + 0.3j, -0.3j)
    feet = zip(places, steps, loads, strict=True)
    return [foot_motion(position, position + step, load) for position, step, load in feet]


def test_the_foot_that_carries_more_than_half_sticks_while_the_others_slip() -> None:
    steps = (-0.01, 0.0, -0.02)
    feet = slid_by(steps, (0.1, 0.2, 0.7))
    no_yaw = MotionPrior(information=(0.0, 0.0, 0.0, 0.0, 0.0, 1e18))
    step = minimize_slip(feet, 1e-5, no_yaw)
    assert (step.motion, step.yaw) == pytest.approx((0.02, 0.0), abs=2e-4)
    assert step.slid == pytest.approx(0.1 * 0.01 + 0.2 * 0.02, rel=2e-2)


def test_a_mirrored_motion_is_mirrored() -> None:
    steps = (-0.01 + 0.01j, 0.0j, -0.02 + 0.0j)
    feet = slid_by(steps, (0.3, 0.4, 0.3))
    mirrored = [FootMotion(m.conjugate(), -arm.conjugate(), load) for m, arm, load in feet]
    step = minimize_slip(feet, 1e-5)
    mirrored_step = minimize_slip(mirrored, 1e-5)
    assert mirrored_step.motion.conjugate() == pytest.approx(step.motion)
    assert (-mirrored_step.yaw, mirrored_step.slid) == pytest.approx((step.yaw, step.slid))


@pytest.mark.parametrize('acceleration', [0.0, 2.0, -1.0 + 0.5j])
def test_gravity_and_inertia_have_no_moment_about_the_zero_moment_point(
    acceleration: complex,
) -> None:
    centre, height = 0.1 - 0.05j, 0.4
    point = zero_moment_point(centre, height, acceleration)
    arm = (centre.real - point.real, centre.imag - point.imag, height)
    moment = np.cross(arm, (-acceleration.real, -acceleration.imag, -GRAVITY))
    assert moment[:2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_round_soles_roll_without_sliding(six: Robot) -> None:
    # A foot that is a ball advances the body by what its leg turns as well.
    plain = walk_figures(six)
    round_ = walk_figures(six, foot_radius=0.015)
    assert round_.height.mean() == pytest.approx(plain.height.mean() + 0.015, abs=1e-4)
    assert 0.9 < round_.speed / plain.speed < 1.0 or 1.0 < round_.speed / plain.speed < 1.1


@pytest.mark.parametrize('name', ['sem104', 'jansen'])
def test_one_leg_is_refused_as_a_walker(name: str) -> None:
    with pytest.raises(NoWalkerError, match=f'{name}.* is no walker: it has 1 leg'):
        walk_figures(robot_of(name))


def test_legs_of_several_turns_are_refused(six: Robot) -> None:
    linkage = change_point_linkage('two_turns')
    legs = tuple(replace(leg, linkage=linkage, masses=None) for leg in six.legs)
    with pytest.raises(NoWalkerError, match='is back only after several turns of its crank'):
        Feet(replace(six, legs=legs))


def test_legs_that_drive_to_the_sides_only_are_refused(six: Robot) -> None:
    legs = [
        replace(leg, mount=replace(leg.mount, rpy=(pi / 2.0, 0.0, pi / 2.0))) for leg in six.legs
    ]
    with pytest.raises(NoWalkerError, match='the legs of crank drive the robot nowhere'):
        Feet(replace(six, legs=tuple(legs)))


def test_inverse_and_product_are_those_of_matrices() -> None:
    entries = (5.0, 0.3, -0.7, 4.0, 0.9, 3.0)
    matrix = np.zeros((3, 3))
    matrix[np.triu_indices(3)] = entries
    matrix += np.triu(matrix, 1).T
    assert product(entries, (0.4, -1.3, 2.1)) == pytest.approx(matrix @ (0.4, -1.3, 2.1))
    assert inverse(entries) == pytest.approx(np.linalg.inv(matrix)[np.triu_indices(3)])
