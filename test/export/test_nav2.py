"""The limits of Nav2 are those of the walker: a pure pursuit with them reaches its goal."""

import ast
from functools import cache
from math import atan2, cos, hypot, pi, sin
from pathlib import Path
from typing import Any

from klann_ros.export.nav2 import CRANK_RATE, nav2_parameters
from klann_ros.gait import Feet, Steering, Twist2D
from klann_ros.robot import robot_of
from klann_ros.twin import Twin
from klann_ros.walker import ControllerSettings, Walker
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PERIOD, FOOT_RADIUS = 0.01, 0.004
WALKERS = ('walker6_two_motors', 'walker_jansen')
GOAL = (0.6, 0.3)


def walker(name: str) -> Any:
    return robot_of(str(ROOT / 'config' / f'{name}.yaml'))


@cache
def parameters(name: str) -> Any:
    return yaml.safe_load(nav2_parameters(walker(name)))


def section(name: str, of: str) -> Any:
    return parameters(name)[of]['ros__parameters']


def test_the_shipped_file_is_that_of_the_generator() -> None:
    shipped = (ROOT / 'config' / 'nav2_walker.yaml').read_text(encoding='utf-8')
    assert shipped == nav2_parameters(walker('walker6_two_motors'))
    # ROS reads no anchors.
    assert '&' not in shipped


def types(value: Any) -> Any:
    """Return the types of all parameters, without the level that ROS puts above them."""
    if isinstance(value, dict):
        inside = value.get('ros__parameters', value)
        return {key: types(each) for key, each in inside.items()}
    return [*map(types, value)] if isinstance(value, list) else type(value).__name__


def test_every_parameter_is_one_of_nav2_with_its_type() -> None:
    known = (Path(__file__).parent / 'nav2_parameters.yaml').read_text(encoding='utf-8')
    for name in WALKERS:
        content = parameters(name)
        assert types(content) == yaml.safe_load(known)
        # Rotating to the heading and reversing exclude each other, and with them such paths.
        follow = content['controller_server']['ros__parameters']['FollowPath']
        planner = content['planner_server']['ros__parameters']['GridBased']
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
    linear, angular = follow['desired_linear_vel'], follow['rotate_to_heading_angular_vel']
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


def test_pure_pursuit_with_these_limits_reaches_its_goal_in_the_twin() -> None:
    server = section('walker6_two_motors', 'controller_server')
    follow, checker = server['FollowPath'], server['general_goal_checker']
    robot = walker('walker6_two_motors')
    twin = Twin(robot)
    steps = Walker(Steering(Feet(robot, foot_radius=FOOT_RADIUS)), ControllerSettings())
    joints = steps.feet.joints
    twist, arrived = (0.0, 0.0), 0.0
    for k in range(-50, 6000):
        now = k * PERIOD
        at = steps.feedback(dict(twin.cranks()), now)
        if k % 5 == 0 and at is not None:
            twist = pursue((at.x, at.y, at.yaw), follow, checker['xy_goal_tolerance'])
            if twist == (0.0, 0.0) and k > 0:
                arrived = arrived or now
        if k >= 0:
            steps.controller.command(*twist, now)
        command = steps.controller.step(now)
        for joint, rate in zip(joints, command.velocity if command else (), strict=False):
            twin.command(joint, rate)
        twin.step(now + PERIOD + 0.5)
        if arrived and now > arrived + 1.0:
            break
    assert arrived
    x, y, _ = twin.truth().position
    # The odometry is off by some per cent of the path; it stops within the tolerance.
    assert hypot(GOAL[0] - x, GOAL[1] - y) < checker['xy_goal_tolerance'] + 0.05 * hypot(*GOAL)


def pursue(
    pose: tuple[float, float, float], follow: dict[str, Any], tolerance: float
) -> tuple[float, float]:
    """Return the command of a regulated pure pursuit of a straight path to the goal."""
    x, y, yaw = pose
    dx, dy = GOAL[0] - x, GOAL[1] - y
    far = hypot(dx, dy)
    if far < tolerance:
        return 0.0, 0.0
    heading = (atan2(dy, dx) - yaw + pi) % (2.0 * pi) - pi
    if abs(heading) > follow['rotate_to_heading_min_angle']:
        spin = follow['rotate_to_heading_angular_vel']
        return 0.0, spin if heading > 0.0 else -spin
    # The carrot is on the path, at the look-ahead distance at most.
    ahead = min(follow['lookahead_dist'], far)
    curvature = 2.0 * sin(heading) / ahead
    radius = 1.0 / max(abs(curvature), 1e-9)
    linear = follow['desired_linear_vel'] * min(
        1.0,
        radius / follow['regulated_linear_scaling_min_radius'],
        far / follow['approach_velocity_scaling_dist'],
    )
    linear = max(linear, follow['min_approach_linear_velocity']) * cos(heading)
    return linear, linear * curvature
