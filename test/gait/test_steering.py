"""Rates of the cranks for a motion of the body, and by the phase in which it turns."""

from dataclasses import replace
from math import pi
from pathlib import Path

from hypothesis import given, settings, strategies as st
from klann_ros.gait import Feet, Rates, Steering, Twist2D, walk_figures
from klann_ros.gait.stance import body_displacement, Facet, stance_pose, StancePose, support
from klann_ros.gait.steering import MAP_POINTS, phase_map, phase_twists, TurnPlan
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import robot_of
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
DT = 0.01
SPEEDS = st.floats(-0.3, 0.3)


@pytest.fixture(scope='module')
def steering() -> Steering:
    return Steering(Feet(robot_of(str(CONFIG / 'walker6_two_motors.yaml'))))


@settings(max_examples=60, deadline=None)
@given(linear=SPEEDS, angular=SPEEDS)
def test_the_way_back_from_rates_to_a_motion_is_exact(
    steering: Steering, linear: float, angular: float
) -> None:
    wanted = Twist2D(linear, angular)
    assert steering.motion(steering.rates(wanted)) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize('name', ['walker6_two_motors', 'walker8_two_motors', 'walker_jansen'])
def test_left_and_right_mirror_each_other_and_forwards_and_back(name: str) -> None:
    steering = Steering(Feet(robot_of(str(CONFIG / f'{name}.yaml')), foot_radius=0.004))
    for linear, angular in ((0.1, 0.05), (0.1, 0.01), (0.02, 0.05), (0.0, 0.05)):
        left, right = (
            steering.rates(Twist2D(linear, yaw_rate)) for yaw_rate in (angular, -angular)
        )
        back = steering.rates(Twist2D(-linear, angular))
        assert (left.left, left.right) == pytest.approx((right.right, right.left), abs=1e-9)
        assert (left.left, left.right) == pytest.approx((-back.right, -back.left), abs=1e-9)
        assert left.right > left.left
        # Opposite legs are half a turn apart in the gait.
        for left_crank, right_crank in ((0.3, -1.1), (2.0, 5.0)):
            rates = steering.planned_rates(Twist2D(linear, angular), [left_crank, right_crank])
            mirrored_rates = steering.planned_rates(
                Twist2D(linear, -angular), [right_crank + pi, left_crank + pi]
            )
            assert rates == pytest.approx((mirrored_rates.right, mirrored_rates.left), abs=1e-9)


def test_an_asymmetric_walker_steers_by_its_own_sides() -> None:
    robot = robot_of(str(CONFIG / 'walker8_two_motors.yaml'))
    front, *other_legs = robot.legs
    x, y, z = front.mount.xyz
    moved_leg = replace(front, mount=replace(front.mount, xyz=(x + 0.1, y + 0.1, z)))
    steering = Steering(Feet(replace(robot, legs=(moved_leg, *other_legs))))
    left, right = (steering.rates(Twist2D(0.05, w)) for w in (0.02, -0.02))
    assert abs(left.left - right.right) > 1e-3
    for wanted in (Twist2D(0.05, 0.02), Twist2D(0.05, -0.02)):
        assert steering.motion(steering.rates(wanted)) == pytest.approx(wanted, abs=1e-9)


def test_the_map_has_the_motion_of_the_stance(steering: Steering) -> None:
    feet = steering.feet
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * pi, (20, 2))
    step = 1e-5
    ground = np.array([0.0, 0.0, feet.at(phases).feet[..., 2].min(axis=1).mean()])

    def pose(cranks: FloatArray, facet: Facet | None = None) -> StancePose:
        placed = feet.at(cranks)
        points, centre = (placed.feet - ground).tolist(), (placed.centre - ground).tolist()
        body_support = support(points, centre, facet)
        assert body_support is not None
        return stance_pose(points, placed.rolled.tolist(), body_support)

    (twists,) = phase_twists(feet, np.eye(2), phases, (-1.0, 1.0))
    for cranks, twist in zip(phases, twists, strict=True):
        facet = pose(cranks).support.facet
        half_step = step * np.array([-1.0, 1.0])
        displacement = body_displacement(
            pose(cranks - half_step, facet), pose(cranks + half_step, facet)
        )
        exact = displacement.motion.real / (2.0 * step), displacement.yaw / (2.0 * step)
        assert twist == pytest.approx(exact, rel=0.01, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize('name', ['walker6_two_motors', 'walker_jansen'])
def test_the_mean_motion_has_converged(name: str) -> None:
    feet = Feet(robot_of(str(CONFIG / f'{name}.yaml')))
    sides = np.array([np.abs(feet.sides + side) / 2.0 * feet.senses for side in (1.0, -1.0)])
    coarse, fine = (
        [twists.mean(axis=(0, 1)) for twists in phase_map(feet, sides, points)]
        for points in (MAP_POINTS, 3 * MAP_POINTS)
    )
    for coarse_mean, fine_mean in zip(coarse, fine, strict=True):
        assert abs(coarse_mean - fine_mean).max() < 0.005 * abs(fine_mean).max()


def test_straight_on_both_sides_turn_alike(steering: Steering) -> None:
    rates = steering.rates(Twist2D(0.15, 0.0))
    assert rates.left == pytest.approx(rates.right)
    assert rates.left == pytest.approx(0.15 / steering.speed)
    assert steering.motion(Rates(-1.0, -1.0)).linear == pytest.approx(-steering.speed)
    # Of the steps of a turn, one after the other.
    gait_speed = walk_figures(steering.feet.robot).speed
    assert steering.speed == pytest.approx(gait_speed, rel=0.005)


def test_on_the_spot_it_goes_to_the_phase_in_which_it_turns_and_stays(steering: Steering) -> None:
    """Left and right a quarter turn ahead, where their feet hold the body against its turn."""
    cranks = [pi / 2.0, pi / 2.0]
    wanted = Twist2D(0.0, 0.1)
    p = []
    for _ in range(1000):
        left, right = steering.planned_rates(wanted, cranks, on_spot=True)
        assert left <= right
        cranks = [cranks[0] + left * DT, cranks[1] + right * DT]
        p.append(sum(cranks) / 2.0 % pi)
    assert min(p[-1], pi - p[-1]) < 0.1
    assert abs(p[-1] - p[-100]) < 1e-3


@pytest.mark.parametrize('wanted', [Twist2D(0.1, 0.03), Twist2D(0.05, -0.09)])
def test_in_a_curve_the_plan_has_the_commanded_means(steering: Steering, wanted: Twist2D) -> None:
    """Of the speed from both sides, and of the yaw from their difference."""
    straight, turning = phase_map(steering.feet, np.eye(2))
    p = q = linear = angular = 0.0
    seconds = 200.0
    for _ in range(round(seconds / DT)):
        left, right = steering.planned_rates(wanted, [p - q, p + q])
        i, j = (int(angle / (2.0 * pi) * MAP_POINTS) % MAP_POINTS for angle in (p, q))
        dp = (left + right) / 2.0 * DT
        dq = (right - left) / 2.0 * DT
        linear += straight[i, j, 0] * dp
        angular += turning[i, j, 1] * dq
        p += dp
        q += dq
    assert (linear / seconds, angular / seconds) == pytest.approx(tuple(wanted), rel=0.15)


def test_legs_that_cannot_turn_it_have_no_plan() -> None:
    zero = np.zeros((8, 8))
    ones = np.ones((8, 8))
    assert not TurnPlan(ones, zero, zero).is_possible
    assert TurnPlan(ones, ones, zero).rates(0.3, 0.4, 0.5, 0.2) == pytest.approx((0.5, 0.2))


@settings(max_examples=60, deadline=None)
@given(walking=SPEEDS, turning=st.sampled_from([0.1, -0.3]), crossed=st.floats(-9.0, 9.0))
def test_on_the_spot_walking_leaves_the_yaw_rate(
    walking: float, turning: float, crossed: float
) -> None:
    """Where walking turns it as well, it walks slower, and the difference of the sides is less."""
    ones = np.ones((8, 8))
    p, q = TurnPlan(ones, ones, crossed * ones).rates(0.3, 0.4, walking, turning, on_spot=True)
    assert p * crossed + q == pytest.approx(turning)
    assert abs(p * crossed) <= abs(turning) / 2.0 + 1e-9
