"""
The parameters of Nav2 that depend on the walker, derived from its feet and its gait.

Speeds are those of the tests of `walker_node` in MuJoCo: straight on a part of the speed at a
crank rate of 1 rad/s, on the spot the yaw rate at 1 rad/s of both sides against each other.
"""

from math import ceil, hypot, pi
from pathlib import Path

from klann_ros.gait import Feet, Rates, Steering, walk_figures
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.yaml_text import dump, parse_file, with_values
from klann_ros.walker import MotionLimits
import numpy as np

# Part of the speed at 1 rad/s, and the crank rate [rad/s].
CRUISE_SHARE, CRANK_RATE = 0.7, 1.0
# Beside the feet, for their sway [m]; between stopping and the end of the motion [s].
FOOTPRINT_MARGIN, REACTION_TIME = 0.02, 1.0
# Yaw comes in bursts [rad].
MIN_YAW_TOLERANCE = 0.1
# Without half of the possible motion in this time it is stuck [s].
PROGRESS_TIME = 10.0
FOOT_RADIUS = 0.004
# Steps of a turn of the cranks.
GAIT_SAMPLES = 180
PARAMETERS = Path(__file__).parent / 'static' / 'nav2.yaml'
_HEAD = """\
# {name} in Nav2 (Jazzy): merge it into nav2_bringup's nav2_params.yaml.
# Made by klann_ros from feet and gait; speeds in m/s and rad/s, lengths in m.
"""


def nav2_parameters(robot: Robot) -> str:
    """Return the parameters of Nav2 for a walker, as YAML; a ValueError if it cannot turn."""
    steering = Steering(Feet(robot, foot_radius=FOOT_RADIUS))
    if not steering.can_turn:
        raise ValueError(f'{printable(robot.name)} cannot turn: all of its feet are on one crank')
    limits = MotionLimits()
    figures = walk_figures(robot, foot_radius=FOOT_RADIUS, samples=GAIT_SAMPLES)
    even = figures.stride * np.arange(1, GAIT_SAMPLES + 1) / GAIT_SAMPLES
    sway = float(np.abs(figures.advance[:, 0] - even).max())
    linear = _down(min(CRUISE_SHARE * abs(steering.speed) * CRANK_RATE, limits.max_linear))
    spin = abs(steering.motion(Rates(-CRANK_RATE, CRANK_RATE)).angular)
    angular = _down(min(spin, limits.max_angular))
    radius = _up(linear / angular)
    corners, reach = _footprint(robot, steering.feet)
    ahead = _up(max(reach / 2.0, radius / 2.0))
    acceleration = limits.max_linear_acceleration
    angular_acceleration = limits.max_angular_acceleration
    replacements = {
        '$linear': linear,
        '$linear_back': -linear,
        '$slow': _down(linear / 2.0),
        '$approach': _down(linear / 4.0),
        '$acceleration': acceleration,
        '$deceleration': -acceleration,
        '$angular': angular,
        '$angular_back': -angular,
        '$angular_slow': _down(angular / 2.0),
        '$angular_acceleration': angular_acceleration,
        '$angular_deceleration': -angular_acceleration,
        '$progress': _down(linear * PROGRESS_TIME / 2.0),
        '$angular_progress': _down(angular * PROGRESS_TIME / 2.0),
        '$progress_time': PROGRESS_TIME,
        '$tolerance': _up(linear * REACTION_TIME + sway),
        '$yaw_tolerance': max(MIN_YAW_TOLERANCE, _up(angular * REACTION_TIME)),
        '$radius': radius,
        '$ahead': ahead,
        '$corners': corners,
        '$reach': _up(reach),
        '$width': ceil(2.0 * (reach + ahead)),
    }
    content = with_values(parse_file(PARAMETERS), replacements)
    return f'{_HEAD.format(name=printable(robot.name))}{dump(content)}\n'


def _footprint(robot: Robot, feet: Feet) -> tuple[str, float]:
    """Return the rectangle around body and feet over a turn, as text, and its radius [m]."""
    turn = np.linspace(0.0, 2.0 * pi, GAIT_SAMPLES)
    places = np.asarray(feet.at(turn[:, None] * feet.senses).feet)[..., :2].reshape(-1, 2)
    low = places.min(axis=0) - FOOT_RADIUS
    high = places.max(axis=0) + FOOT_RADIUS
    if robot.body is not None:
        centre = np.array(robot.body.centre[:2])
        half_size = np.array(robot.body.size[:2]) / 2.0
        low = np.minimum(low, centre - half_size)
        high = np.maximum(high, centre + half_size)
    front, left = map(_up, high + FOOTPRINT_MARGIN)
    back, right = map(_up, FOOTPRINT_MARGIN - low)
    corners = [[front, left], [front, -right], [-back, -right], [-back, left]]
    return str(corners), max(hypot(*corner) for corner in corners)


def _up(number: float) -> float:
    """Return a number with two decimals, rounded up."""
    return ceil(100.0 * number - 1e-9) / 100.0


def _down(number: float) -> float:
    """Return a number with two leading digits, rounded down."""
    digits = 10.0 ** (1 - int(np.floor(np.log10(number))))
    return float(int(digits * number + 1e-9) / digits)
