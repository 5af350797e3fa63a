"""The limits of Nav2 are those of the walker: a pure pursuit with them reaches its goal."""

import ast
from functools import cache
from math import atan2, cos, hypot, pi, sin
from pathlib import Path
from typing import Any

from klann_ros.export.ros2_control import CRANK_RATE, nav2_parameters
from klann_ros.gait import Feet, Steering, Twist2D
from klann_ros.robot import robot_of
from klann_ros.twin import Twin
from klann_ros.walker import ControllerSettings, Walker
import numpy as np
import pytest
import yaml
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]
PERIOD, FOOT_RADIUS = 0.01, 0.004
WALKERS = ('walker6_two_motors', 'walker_jansen')
GOAL = (0.6, 0.3)


def walker(name: str) -> Any:
    return robot_of(str(ROOT / 'config' / f'{name}.yaml'))


@cache
def parameters(name: str) -> Any:
    return yaml.safe_load(nav2_parameters(walker(name)))


def section(name: str, node: str) -> Any:
    return parameters(name)[node]['ros__parameters']


def test_the_shipped_file_is_that_of_the_generator() -> None:
    shipped = (ROOT / 'config' / 'nav2_walker.yaml').read_text(encoding='utf-8')
    assert shipped == nav2_parameters(walker('walker6_two_motors'))
    # ROS reads no anchors.
    assert '&' not in shipped


def types(parameter: Any) -> Any:
    """Return the types of all parameters, without the level that ROS puts above them."""
    if isinstance(parameter, dict):
        inner = parameter.get('ros__parameters', parameter)
        return dict(zip(inner, map(types, inner.values()), strict=True))
    return [*map(types, parameter)] if isinstance(parameter, list) else type(parameter).__name__


def test_every_parameter_is_one_of_nav2_with_its_type() -> None:
    nav2_types = read_table(Path(__file__).parent / 'nav2_parameters.yaml')
    for name in WALKERS:
        assert types(parameters(name)) == nav2_types
        # Rotating to the heading and reversing exclude each other, and with them such paths.
        follow = section(name, 'controller_server')['FollowPath']
        planner = section(name, 'planner_server')['GridBased']
        assert follow['use_rotate_to_heading'] != follow['allow_reversing']
        assert follow['allow_reversing'] or planner['motion_model_for_search'] == 'DUBIN'


def test_a_walker_on_one_crank_is_refused() -> None:
    with pytest.raises(ValueError, match='cannot turn'):
        nav2_parameters(walker('walker6'))


@pytest.mark.parametrize('name', WALKERS)
def test_limits_are_within_the_cranks_and_the_footprint_holds_the_feet(name: str) -> None:
    robot = walker(name)
    feet = Feet(robot, foot_radius=FOOT_RADIUS)
    follow = section(name, 'controller_server')['FollowPath']
    linear = follow['desired_linear_vel']
    angular = follow['rotate_to_heading_angular_vel']
    radius = section(name, 'planner_server')['GridBased']['minimum_turning_radius']
    steering = Steering(feet)
    for twist in ((linear, 0.0), (0.0, angular), (linear, linear / radius)):
        rates = steering.rates(Twist2D(*twist))
        assert max(map(abs, rates)) <= 2.0 * CRANK_RATE
    assert linear / radius <= angular
    costmap = parameters(name)['local_costmap']['local_costmap']
    corners = np.array(ast.literal_eval(costmap['ros__parameters']['footprint']))
    cranks = np.linspace(0.0, 2.0 * pi, 500)[:, None] * feet.senses
    places = np.asarray(feet.at(cranks).feet)[..., :2].reshape(-1, 2)
    assert (places >= corners.min(axis=0)).all()
    assert (places <= corners.max(axis=0)).all()
    reach = np.hypot(*corners.T).max()
    assert costmap['ros__parameters']['inflation_layer']['inflation_radius'] >= reach - 0.01


@pytest.mark.slow
def test_pure_pursuit_with_these_limits_reaches_its_goal_in_the_twin() -> None:
    server = section('walker6_two_motors', 'controller_server')
    tolerance = server['general_goal_checker']['xy_goal_tolerance']
    robot = walker('walker6_two_motors')
    twin = Twin(robot)
    steps = Walker(Steering(Feet(robot, foot_radius=FOOT_RADIUS)), ControllerSettings())
    twist = (0.0, 0.0)
    arrival_time = 0.0
    for k in range(-50, 6000):
        now = k * PERIOD
        pose = steps.feedback(dict(twin.cranks()), now)
        if k % 5 == 0 and pose is not None:
            twist = pursue((pose.x, pose.y, pose.yaw), server['FollowPath'], tolerance)
            if twist == (0.0, 0.0) and k > 0:
                arrival_time = arrival_time or now
        if k >= 0:
            steps.controller.command(*twist, now)
        command = steps.controller.step(now)
        if command:
            for joint, rate in zip(steps.feet.joints, command.velocity, strict=True):
                twin.command(joint, rate)
        twin.step(now + PERIOD + 0.5)
        if arrival_time and now > arrival_time + 1.0:
            break
    assert arrival_time
    x, y, _ = twin.truth().position
    # The odometry is off by some per cent of the path; it stops within the tolerance.
    assert hypot(GOAL[0] - x, GOAL[1] - y) < tolerance + 0.05 * hypot(*GOAL)


def pursue(
    pose: tuple[float, float, float], follow: dict[str, Any], tolerance: float
) -> tuple[float, float]:
    """Return the command of a regulated pure pursuit of a straight path to the goal."""
    x, y, yaw = pose
    dx = GOAL[0] - x
    dy = GOAL[1] - y
    distance = hypot(dx, dy)
    if distance < tolerance:
        return 0.0, 0.0
    heading = (atan2(dy, dx) - yaw + pi) % (2.0 * pi) - pi
    if abs(heading) > follow['rotate_to_heading_min_angle']:
        spin = follow['rotate_to_heading_angular_vel']
        return 0.0, spin if heading > 0.0 else -spin
    # The carrot is on the path, at the look-ahead distance at most.
    ahead = min(follow['lookahead_dist'], distance)
    curvature = 2.0 * sin(heading) / ahead
    radius = 1.0 / max(abs(curvature), 1e-9)
    linear = follow['desired_linear_vel'] * min(
        1.0,
        radius / follow['regulated_linear_scaling_min_radius'],
        distance / follow['approach_velocity_scaling_dist'],
    )
    linear = max(linear, follow['min_approach_linear_velocity']) * cos(heading)
    return linear, linear * curvature
