"""
The files that put a walker under ros2_control, in MuJoCo or on its hardware.

`mujoco_ros2_control/MujocoSystemInterface` loads the MJCF and drives its velocity actuators, named
as their joints. Other joints are passive to it; its sensor `imu` is the MJCF's `imu_quat`,
`imu_gyro` and `imu_accel`, and the free joint of `base_link` gives the ground truth. A position
without initial value starts at 0, whatever the MJCF says. On hardware, a plugin of standard topics
takes the place of the simulator; controllers and walker_node are the same.
"""

from contextlib import suppress
from typing import Any
from xml.etree.ElementTree import Comment, Element, indent, SubElement, tostring

from klann_ros.robot import Robot
from klann_ros.robot.file import flat_parameters, solver_section
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.yaml_text import parameter_file, parse_file
from klann_ros.twin import robot_mjcf
from klann_ros.twin.mjcf import start_angle

from .nav2 import nav2_parameters
from .urdf import urdf, URDF_HEADER

MODEL, ROBOT, SIMULATED, HARDWARE, CONTROLLERS, WALKER, LAUNCH = (
    'robot.xml',
    'robot.urdf',
    'cranks.urdf',
    'cranks_hardware.urdf',
    'ros2_control.yaml',
    'walker.yaml',
    'ros2_control.launch.py',
)
"""Names of the files: ros2_control.launch.py of klann_ros reads the others by these."""

NAV2 = 'nav2.yaml'
"""Name of the parameters for Nav2."""

# Limits of a crank in the URDF [rad/s], [N m]; walker_node has limits of its own.
MAX_CRANK_RATE, MAX_CRANK_TORQUE = 3.0, 100.0
UPDATE_RATE = 100
IMU_INTERFACES = tuple(
    f'{kind}.{axis}'
    for kind, axes in (
        ('orientation', 'xyzw'),
        ('angular_velocity', 'xyz'),
        ('linear_acceleration', 'xyz'),
    )
    for axis in axes
)
_SIMULATOR = 'mujoco_ros2_control/MujocoSystemInterface'
_TOPICS = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
# Of each plugin; a comment stands before its parameter.
_PARAMETERS: dict[str, dict[str, tuple[str, str]]] = {
    _SIMULATOR: {
        'mujoco_model': (MODEL, 'The launch file puts its folder before this name.'),
        'headless': ('true', ''),
        'odom_free_joint_name': ('base_link', ''),
        'odom_topic': ('ground_truth', ''),
    },
    _TOPICS: {
        'joint_commands_topic': ('crank_command', ''),
        'joint_states_topic': ('crank_state', ''),
        'trigger_joint_command_threshold': (
            '-1',
            'It compares positions, which are not commanded here: always send.',
        ),
        'enable_command_limiting': ('true', 'An interface without it may send zeros.'),
    },
}
_YAML_HEAD = """\
# The cranks of {name} with standard controllers of ros2_control (Jazzy).
# Made by klann_ros; the order of the joints is that of the walker's file, as in walker_node.
"""


def ros2_control_files(file: str, robot: Robot) -> dict[str, bytes]:
    """
    Return the files of a walker under ros2_control, by their names.

    Parameters
    ----------
    file : str
        The parameter file of the robot.
    robot : Robot
        The robot, with masses.

    Raises
    ------
    ValueError
        The robot is no walker, or has no masses.

    """
    if not robot.is_walker:
        raise ValueError(f'{printable(file)} is refused: --ros2-control needs a walker')
    made = {
        MODEL: robot_mjcf(robot),
        ROBOT: urdf(robot),
        SIMULATED: cranks_urdf(robot, simulated=True),
        HARDWARE: cranks_urdf(robot, simulated=False),
        CONTROLLERS: controllers(robot, has_imu=True),
        WALKER: _walker(file, robot),
        LAUNCH: _LAUNCH,
    }
    with suppress(ValueError):
        # Nav2 needs a walker that can turn.
        made[NAV2] = nav2_parameters(robot)
    return {name: text.encode() for name, text in made.items()}


def controllers(robot: Robot, *, has_imu: bool) -> str:
    """Return the parameters of controller_manager, its controllers, and walker_node for them."""
    joints = [*robot.crank_joints]
    types = {
        'joint_state_broadcaster': 'joint_state_broadcaster/JointStateBroadcaster',
        'crank_velocity_controller': 'velocity_controllers/JointGroupVelocityController',
    }
    settings: dict[str, dict[str, Any]] = {
        # On its own topic: solver_node publishes joint_states of the legs.
        'joint_state_broadcaster': {
            'use_local_topics': True,
            'joints': joints,
            'interfaces': ['position', 'velocity'],
        },
        'crank_velocity_controller': {'joints': [*joints]},
        'walker_node': {'command_type': 'velocities'},
    }
    if has_imu:
        types['imu_sensor_broadcaster'] = 'imu_sensor_broadcaster/IMUSensorBroadcaster'
        settings['imu_sensor_broadcaster'] = {'sensor_name': 'imu', 'frame_id': 'base_link'}
    manager = {
        'update_rate': UPDATE_RATE,
        **{name: {'type': kind} for name, kind in types.items()},
    }
    sections = {'controller_manager': manager, **settings}
    return _YAML_HEAD.format(name=printable(robot.name)) + parameter_file(sections)


def cranks_urdf(robot: Robot, *, simulated: bool) -> str:
    """Return the cranks of a robot as URDF for controller_manager, with their plugin."""
    root = Element('robot', name='cranks')
    root.append(Comment(f' The cranks of {_comment(robot.name)}: for controller_manager only. '))
    SubElement(root, 'link', name='cranks')
    for joint in robot.crank_joints:
        SubElement(root, 'link', name=f'{joint}_axle')
        element = SubElement(root, 'joint', name=joint, type='continuous')
        SubElement(element, 'parent', link='cranks')
        SubElement(element, 'child', link=f'{joint}_axle')
        SubElement(element, 'axis', xyz='0 -1 0')
        limits = {'effort': f'{MAX_CRANK_TORQUE:g}', 'velocity': f'{MAX_CRANK_RATE:g}'}
        SubElement(element, 'limit', limits)
    control = SubElement(root, 'ros2_control', name='cranks', type='system')
    plugin = _SIMULATOR if simulated else _TOPICS
    hardware = SubElement(control, 'hardware')
    SubElement(hardware, 'plugin').text = plugin
    for name, (value, comment) in _PARAMETERS[plugin].items():
        if comment:
            hardware.append(Comment(f' {comment} '))
        SubElement(hardware, 'param', name=name).text = value
    for joint in robot.crank_joints:
        element = SubElement(control, 'joint', name=joint)
        command = SubElement(element, 'command_interface', name='velocity')
        for name, limit in (('min', -MAX_CRANK_RATE), ('max', MAX_CRANK_RATE)):
            SubElement(command, 'param', name=name).text = f'{limit:g}'
        position = SubElement(element, 'state_interface', name='position')
        if simulated:
            start = repr(start_angle(robot.on_joint(joint)))
            SubElement(position, 'param', name='initial_value').text = start
        SubElement(element, 'state_interface', name='velocity')
    if simulated:
        sensor = SubElement(control, 'sensor', name='imu')
        SubElement(sensor, 'param', name='mujoco_type').text = 'imu'
        SubElement(sensor, 'param', name='mujoco_sensor_name').text = 'imu'
        for name in IMU_INTERFACES:
            SubElement(sensor, 'state_interface', name=name)
    indent(root)
    return URDF_HEADER + tostring(root, encoding='unicode') + '\n'


def _comment(text: str) -> str:
    """Return a text that may stand in a comment of XML."""
    return printable(text).replace('-', '_')


def _walker(file: str, robot: Robot) -> str:
    """Return the parameters of a robot's file, with the text of its linkages for their files."""
    parameters = dict(flat_parameters(solver_section(parse_file(file))))
    given = {k: v for k, v in parameters.items() if k.rpartition('.')[2] != 'linkage'}
    texts = {
        f'{leg.prefix}linkage_description'.replace('/', '.'): leg.description
        for leg in robot.legs
        if leg.description
    }
    return parameter_file({'/**': {**given, **texts}})


_LAUNCH = """\
\"\"\"
A walker under ros2_control: in MuJoCo, or with hardware:=true on topics of its motor drivers.

    ros2 launch ros2_control.launch.py
    ros2 topic pub -r 10 cmd_vel geometry_msgs/msg/TwistStamped '{twist: {linear: {x: 0.1}}}'

Made by klann_ros: its other files stand beside it, and may be moved with it. headless:=false opens
the window of MuJoCo; with hardware:=true sim:=true sim_node stands in for the motor drivers.
\"\"\"

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare('klann_ros')


def generate_launch_description() -> LaunchDescription:
    \"\"\"Describe the launch of klann_ros with the files beside this one.\"\"\"
    shared = PathJoinSubstitution([SHARE, 'launch', 'ros2_control.launch.py'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('hardware', default_value='false'),
            DeclareLaunchArgument('sim', default_value='false'),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(shared),
                launch_arguments={'folder': str(Path(__file__).resolve().parent)}.items(),
            ),
        ]
    )
"""
