"""Through a change point the engine's inertia takes a linkage along its tangent."""

from math import pi

from change_point_linkages import change_point_file, change_point_linkage, FEET
from engine_leg import engine_poses
from klann_ros.robot import robot_of
from klann_ros.twin import agreement, robot_mjcf
import mujoco
import numpy as np
import pytest

# Slower, gravity and the engine's soft loops decide at a change point: level_foot at 1 turn/s.
RATE = 8.0 * pi


@pytest.mark.slow
@pytest.mark.parametrize('rate', [RATE, -RATE])
@pytest.mark.parametrize('name', FEET)
def test_inertia_takes_it_along_the_tangent(name: str, rate: float) -> None:
    poses = engine_poses(name, rate, turns=2, count=250)
    alphas = np.array([pose.alpha for pose in poses])
    feet = np.array([pose.h for pose in poses]) @ [1.0, 1j]
    errors = np.abs(feet - FEET[name](alphas))
    size = change_point_linkage(name).size
    # The engine's loops are soft, most so beside the change points.
    assert errors.max() <= 1e-3 * size
    assert np.median(errors) <= 1e-6 * size


@pytest.mark.slow
@pytest.mark.parametrize('name', FEET)
def test_away_from_them_foot_torque_and_reactions_are_those_of_the_engine(name: str) -> None:
    robot = robot_of(str(change_point_file(name)))
    compared = agreement(robot, RATE, time_step=1e-4, samples=100)
    # The engine's soft loops yield more where three of them follow one another.
    softness = 20.0 if name == 'platform_two_turns' else 1.0
    assert compared.foot <= softness * 1e-7
    assert compared.torque_as_moved <= softness * 1e-5
    assert compared.reactions <= softness * 2e-5


@pytest.mark.parametrize('name', FEET)
def test_a_robot_starts_away_from_change_points(name: str) -> None:
    """At one nothing decides which way it goes."""
    robot = robot_of(str(change_point_file(name)))
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(robot_mjcf(robot)))
    alpha = float(robot.legs[0].crank_angles(data.joint('crank').qpos[0]))
    for point in robot.legs[0].linkage.change_points.points:
        assert abs(np.angle(np.exp(1j * (alpha - point.beta)))) >= 0.4
