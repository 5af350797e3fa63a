"""
The files that put a walker under ros2_control, in MuJoCo or on its hardware.

`mujoco_ros2_control/MujocoSystemInterface` loads the MJCF and drives its velocity actuators, named
as their joints. Other joints are passive to it; its sensor `imu` is the MJCF's `imu_quat`,
`imu_gyro` and `imu_accel`, and the free joint of `base_link` gives the ground truth. A position
without initial value starts at 0, whatever the MJCF says. On hardware, a plugin of standard topics
takes the place of the simulator; controllers and walker_node are the same.
"""

from contextlib import suppress
from pathlib import Path
from string import Template
from xml.sax.saxutils import escape

from klann_ros.robot import Robot, solver_parameters
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.yaml_text import dump, parameter_file, parse_file, with_values
from klann_ros.twin import robot_mjcf, start_angle

from .nav2 import nav2_parameters
from .urdf import urdf

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
    return filled('cranks', name=_comment(robot.name), sensor=texts['sensor'], **sections)


def _comment(text: str) -> str:
    """Return a text that may stand in a comment of XML."""
    return printable(text).replace('-', '_')


def _walker(file: str, robot: Robot) -> str:
    """Return the parameters of a robot's file, with the text of its linkages for their files."""
    parameters = solver_parameters(parse_file(file))
    parameters = {k: v for k, v in parameters.items() if k.rpartition('.')[2] != 'linkage'}
    for leg in robot.legs:
        if leg.description:
            parameters[f'{leg.prefix}linkage_description'.replace('/', '.')] = leg.description
    return parameter_file({'/**': parameters})
