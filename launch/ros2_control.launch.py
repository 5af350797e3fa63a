"""
A walker with standard controllers of ros2_control, in sim_node, in MuJoCo or on hardware.

    ros2 launch klann_ros ros2_control.launch.py

walker_node commands crank_velocity_controller and reads joint_state_broadcaster; watchdog_node
sends zero to the controller, which has no timeout, when these commands stop. With
hardware:=true (here the default) the hardware interface publishes crank_command and subscribes to
crank_state, of sim_node unless sim:=false; else it is mujoco_ros2_control's. record:=true records
the run. The files are those of `export --ros2-control`; the launch file among them includes this
one.
"""

import atexit
from pathlib import Path
from shutil import rmtree
import tempfile
from xml.sax.saxutils import escape

from klann_ros.export import ros2_control as files
from klann_ros.robot import robot_of
from klann_ros.sanitize.text import printable_line
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

FLAG = ['true', 'false', 'True', 'False']
SHARE = FindPackageShare('klann_ros')
ARGUMENTS = (
    DeclareLaunchArgument(
        'params_file',
        default_value=PathJoinSubstitution([SHARE, 'config', 'walker6_two_motors.yaml']),
        description='Parameter file of solver_node, instead of a shipped one.',
    ),
    DeclareLaunchArgument(
        'folder',
        default_value='',
        description='Folder of export --ros2-control, instead of params_file.',
    ),
    DeclareLaunchArgument(
        'hardware',
        default_value='true',
        choices=FLAG,
        description='Control the cranks by topics, without MuJoCo in ros2_control.',
    ),
    DeclareLaunchArgument(
        'sim', default_value='true', choices=FLAG, description='Simulate the hardware: sim_node.'
    ),
    DeclareLaunchArgument(
        'headless', default_value='true', choices=FLAG, description='Open no window of MuJoCo.'
    ),
    DeclareLaunchArgument(
        'record', default_value='false', choices=FLAG, description='Record the run to MCAP.'
    ),
    DeclareLaunchArgument(
        'output', default_value='', description='Folder of the run; empty: runs/<UTC time>.'
    ),
)
DESCRIPTION = 'crank_description'
# Jazzy's controller_manager listens to the first, Humble's to the second.
CONTROL_TOPICS = [('robot_description', DESCRIPTION), ('~/robot_description', DESCRIPTION)]


def exported(params_file: Path) -> Path:
    """Return a new folder with the files of a walker, removed when the launch has ended."""
    try:
        contents = files.ros2_control_files(str(params_file), robot_of(str(params_file)))
    except ValueError as error:
        raise RuntimeError(f'params_file:={printable_line(error)}') from None
    folder = Path(tempfile.mkdtemp(prefix='klann_ros-'))
    atexit.register(rmtree, folder, ignore_errors=True)
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    return folder


def description(name: str, urdf: str, sim_time: dict, topics: list) -> Node:
    """Return the publisher of a robot description."""
    return Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name=name,
        # Without a type the URDF would be read as YAML.
        parameters=[{'robot_description': ParameterValue(urdf, value_type=str)}, sim_time],
        remappings=topics,
    )


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes of ros2_control, and those of klann_ros."""
    arguments = context.launch_configurations
    is_real = arguments['hardware'].lower() == 'true'
    is_simulated = arguments['sim'].lower() == 'true'
    # A relative path starts in the user's folder.
    folder = Path.cwd() / (arguments['folder'] or exported(Path.cwd() / arguments['params_file']))
    if not (folder / files.WALKER).is_file():
        raise RuntimeError(f'folder:={folder}: export --ros2-control has not written it')
    control = str(folder / files.CONTROLLERS)
    walker = str(folder / files.WALKER)
    urdf = (folder / (files.HARDWARE if is_real else files.SIMULATED)).read_text(encoding='utf-8')
    urdf = urdf.replace(f'>{files.MODEL}<', f'>{escape(str(folder / files.MODEL))}<')
    urdf = urdf.replace('"headless">true<', f'"headless">{arguments["headless"].lower()}<')
    robot = (folder / files.ROBOT).read_text(encoding='utf-8')
    # MuJoCo's interface publishes /clock.
    sim_time = {'use_sim_time': not is_real}
    states = ('crank_state', 'joint_state_broadcaster/joint_states')
    spawned = ['joint_state_broadcaster', 'crank_velocity_controller']
    commands = ('crank_command', 'crank_velocity_controller/commands')
    topics = [states, commands]
    if not is_real:
        spawned.append('imu_sensor_broadcaster')
        topics.append(('imu', 'imu_sensor_broadcaster/imu'))
    hardware_control = Node(
        package='controller_manager',
        executable='ros2_control_node',
        output='screen',
        parameters=[control],
        remappings=CONTROL_TOPICS,
    )
    mujoco_control = Node(
        package='mujoco_ros2_control',
        executable='ros2_control_node',
        output='screen',
        parameters=[control, sim_time],
        remappings=CONTROL_TOPICS,
    )
    spawner = Node(
        package='controller_manager',
        executable='spawner',
        arguments=[*spawned, '--controller-manager', 'controller_manager'],
    )
    sim = Node(
        package='klann_ros',
        executable='sim_node',
        name='sim_node',
        output='screen',
        parameters=[walker],
    )
    solver = Node(
        package='klann_ros',
        executable='solver_node',
        name='solver_node',
        output='screen',
        parameters=[walker, {'joint_separator': '_'}, sim_time],
        remappings=[states],
    )
    driver = Node(
        package='klann_ros',
        executable='walker_node',
        name='walker_node',
        output='screen',
        parameters=[walker, control, {'use_imu': True}, sim_time],
        remappings=topics,
    )
    watchdog = Node(
        package='klann_ros',
        executable='watchdog_node',
        name='watchdog_node',
        output='screen',
        parameters=[control],
        remappings=[commands],
        # Without it the controller would repeat the last command of a hung walker_node for ever.
        on_exit=Shutdown(reason='watchdog_node has ended'),
    )
    recorder = Node(
        package='klann_ros',
        executable='recorder_node',
        name='recorder_node',
        output='screen',
        parameters=[
            {
                'output': ParameterValue(LaunchConfiguration('output'), value_type=str),
                **sim_time,
            }
        ],
        condition=IfCondition(LaunchConfiguration('record')),
    )
    return [
        # Before what it records.
        recorder,
        # On topics of its own: no other node may take the cranks for the robot.
        description(
            'crank_description_publisher',
            urdf,
            sim_time,
            [('robot_description', DESCRIPTION), ('joint_states', 'crank_joints')],
        ),
        description('robot_state_publisher', robot, sim_time, []),
        # Before what it stops.
        watchdog,
        hardware_control if is_real else mujoco_control,
        spawner,
        *([sim] if is_real and is_simulated else []),
        solver,
        driver,
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the checks, then controller_manager, its controllers, and walker_node."""
    checks = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', 'checks.py']))
    )
    return LaunchDescription([*ARGUMENTS, checks, OpaqueFunction(function=nodes)])
