"""
The files that put a walker under ros2_control, in MuJoCo or on its hardware.

`mujoco_ros2_control/MujocoSystemInterface` loads the MJCF and drives its velocity actuators, named
as their joints. Other joints are passive to it; its sensor `imu` is the MJCF's `imu_quat`,
`imu_gyro` and `imu_accel`, and the free joint of `base_link` gives the ground truth. A position
without initial value starts at 0, whatever the MJCF says. On hardware, a plugin of standard topics
takes the place of the simulator; controllers and walker_node are the same.

The parameters of Nav2 that depend on the walker are derived from its feet and its gait. Speeds are
those of the tests of `walker_node` in MuJoCo: straight on a part of the speed at a crank rate of
1 rad/s, on the spot the yaw rate at 1 rad/s of both sides against each other.
"""

from contextlib import suppress
from math import ceil, hypot, pi
from pathlib import Path
from string import Template
from xml.sax.saxutils import escape

from klann_ros.dynamics import MassBasis
from klann_ros.gait import Feet, Rates, Steering, walk_figures
from klann_ros.robot import Robot, solver_parameters
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.yaml_text import dump, parameter_file, parse_file, with_values
from klann_ros.twin import robot_mjcf, start_angle
from klann_ros.walker import MotionLimits
import numpy as np

from .urdf import urdf

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
_NAV2_HEAD = """\
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
    return f'{_NAV2_HEAD.format(name=printable(robot.name))}{dump(content)}\n'


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


# Names of the files: ros2_control.launch.py of klann_ros reads the others by these.
MODEL = 'robot.xml'
ROBOT = 'robot.urdf'
SIMULATED = 'cranks.urdf'
HARDWARE = 'cranks_hardware.urdf'
CONTROLLERS = 'ros2_control.yaml'
WALKER = 'walker.yaml'
LAUNCH = 'ros2_control.launch.py'
NAV2 = 'nav2.yaml'

TEXTS = Path(__file__).parent / 'static' / 'ros2_control.yaml'
_YAML_HEAD = """\
# The cranks of {name} with standard controllers of ros2_control (Jazzy).
# Made by klann_ros; the order of the joints is that of the walker's file, as in walker_node.
"""


def ros2_control_files(file: str, robot: Robot) -> dict[str, bytes]:
    """
    Return the files of the walker in a parameter file under ros2_control, by their names.

    A ValueError says that the robot is no walker, or has no masses.
    """
    if not robot.is_walker:
        raise ValueError(f'{printable(file)} is refused: --ros2-control needs a walker')
    files = {
        MODEL: robot_mjcf(robot),
        ROBOT: urdf(robot),
        SIMULATED: cranks_urdf(robot, simulated=True),
        HARDWARE: cranks_urdf(robot, simulated=False),
        CONTROLLERS: controllers(robot, has_imu=True),
        WALKER: _walker(file, robot),
        LAUNCH: parse_file(TEXTS)['launch'],
    }
    with suppress(ValueError):
        # Nav2 needs a walker that can turn.
        files[NAV2] = nav2_parameters(robot)
    return {name: text.encode() for name, text in files.items()}


def controllers(robot: Robot, *, has_imu: bool) -> str:
    """Return the parameters of controller_manager, its controllers, and walker_node for them."""
    content = with_values(parse_file(TEXTS)['controllers'], {'$joints': [*robot.crank_joints]})
    if not has_imu:
        for sections in (content, content['controller_manager']['ros__parameters']):
            del sections['imu_sensor_broadcaster']
    return f'{_YAML_HEAD.format(name=printable(robot.name))}{dump(content)}\n'


def cranks_urdf(robot: Robot, *, simulated: bool) -> str:
    """Return the cranks of a robot as URDF for controller_manager, with their plugin."""
    texts = parse_file(TEXTS)
    texts |= texts['simulated' if simulated else 'hardware']

    def filled(text: str, **values: str) -> str:
        return Template(texts[text]).substitute(values)

    axles = joints = ''
    for joint in robot.crank_joints:
        name = escape(joint, {'"': '&quot;'})
        position = filled('position', start=repr(start_angle(robot.on_joint(joint))))
        axles += filled('axle', joint=name)
        joints += filled('joint', joint=name, position=position)
    sections = {'axles': axles, 'joints': joints, 'plugin': texts['plugin']}
    # It stands in a comment of XML, where hyphens may end it.
    robot_name = printable(robot.name).replace('-', '_')
    return filled('cranks', name=robot_name, sensor=texts['sensor'], **sections)


def _walker(file: str, robot: Robot) -> str:
    """Return the parameters of a robot's file, with the text of its linkages for their files."""
    parameters = solver_parameters(parse_file(file))
    parameters = {k: v for k, v in parameters.items() if k.rpartition('.')[2] != 'linkage'}
    for leg in robot.legs:
        if leg.masses and leg.masses.basis is MassBasis.RODS:
            # An explicit density wins over that of the file.
            parameters[f'{leg.prefix}bar_density'.replace('/', '.')] = leg.masses.density
        if leg.description:
            parameters[f'{leg.prefix}linkage_description'.replace('/', '.')] = leg.description
    return parameter_file({'/**': parameters})
