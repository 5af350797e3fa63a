"""
A walker with standard controllers of ros2_control, simulated unless sim:=false.

    ros2 launch klann_ros ros2_control.launch.py

walker_node commands crank_velocity_controller and reads joint_state_broadcaster. The hardware
interface publishes crank_command and subscribes to crank_state.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
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
        'sim', default_value='true', choices=FLAG, description='Simulate the robot.'
    ),
)
DESCRIPTION = 'crank_description'
CONTROLLERS = ('joint_state_broadcaster', 'crank_velocity_controller')


def cranks(context: LaunchContext) -> list[Node]:
    """Return the publisher of the robot description of the cranks."""
    file = PathJoinSubstitution([SHARE, 'urdf', 'cranks.urdf']).perform(context)
    urdf = Path(file).read_text(encoding='utf-8')
    publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name='crank_description_publisher',
        # Without a type the URDF would be read as YAML.
        parameters=[{'robot_description': ParameterValue(urdf, value_type=str)}],
        # Separate topics: no other node may take the cranks for the robot.
        remappings=[('robot_description', DESCRIPTION), ('joint_states', 'crank_joints')],
    )
    return [publisher]


def generate_launch_description() -> LaunchDescription:
    """Describe controller_manager, its controllers, and walker_node."""
    params_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
    control = PathJoinSubstitution([SHARE, 'config', 'ros2_control.yaml'])
    checks = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', 'checks.py']))
    )
    manager = Node(
        package='controller_manager',
        executable='ros2_control_node',
        output='screen',
        parameters=[control],
        # Jazzy listens to the first, Humble to the second.
        remappings=[('robot_description', DESCRIPTION), ('~/robot_description', DESCRIPTION)],
    )
    spawner = Node(
        package='controller_manager',
        executable='spawner',
        arguments=[*CONTROLLERS, '--controller-manager', 'controller_manager'],
    )
    sim = Node(
        package='klann_ros',
        executable='sim_node',
        name='sim_node',
        output='screen',
        parameters=[params_file],
        condition=IfCondition(LaunchConfiguration('sim')),
    )
    walker = Node(
        package='klann_ros',
        executable='walker_node',
        name='walker_node',
        output='screen',
        parameters=[params_file, control, {'use_imu': True}],
        remappings=[
            ('crank_command', 'crank_velocity_controller/commands'),
            ('crank_state', 'joint_state_broadcaster/joint_states'),
        ],
    )
    return LaunchDescription(
        [*ARGUMENTS, checks, OpaqueFunction(function=cranks), manager, spawner, sim, walker]
    )
