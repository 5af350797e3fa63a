"""
A simulated walker that takes cmd_vel: sim_node, walker_node, and what leg.launch.py starts.

    ros2 launch klann_ros walk.launch.py linear:=0.1 rviz:=true

With fuse:=ekf the ekf_node of robot_localization fuses the cranks' odom with the IMU. It takes
the arguments of leg.launch.py as well: with view:=true the live page steers the walker.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import UnlessCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
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
        'namespace', default_value='', description='Namespace of the nodes and their topics.'
    ),
    DeclareLaunchArgument(
        'use_sim_time',
        default_value='false',
        choices=FLAG,
        description='Take the time from /clock.',
    ),
    DeclareLaunchArgument(
        'linear',
        default_value='0.0',
        description='Speed of sim_node, without another publisher of cmd_vel [m/s]; 0: none.',
    ),
    DeclareLaunchArgument(
        'friction', default_value='0.8', description='Friction coefficient of the feet.'
    ),
    DeclareLaunchArgument(
        'fuse',
        default_value='none',
        choices=['none', 'ekf'],
        description='ekf: robot_localization fuses odom, from the cranks alone, with the IMU.',
    ),
    DeclareLaunchArgument(
        'slope', default_value='0.0', description='Slope of the floor along x [rad].'
    ),
)


def check(context: LaunchContext) -> None:
    """Refuse invalid numbers before the walker is started."""
    for name in ('linear', 'friction', 'slope'):
        text = LaunchConfiguration(name).perform(context)
        try:
            float(text)
        except ValueError:
            raise RuntimeError(f'{name}:={text} is not a number') from None


def generate_launch_description() -> LaunchDescription:
    """Describe the robot, its controller and its viewers."""
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    is_alone = EqualsSubstitution(LaunchConfiguration('fuse'), 'none')
    params_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
    names = ('params_file', 'namespace', 'use_sim_time')
    leg = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', 'leg.launch.py'])),
        launch_arguments={name: LaunchConfiguration(name) for name in names}.items(),
    )
    sim = Node(
        package='klann_ros',
        executable='sim_node',
        name='sim_node',
        namespace=namespace,
        output='screen',
        parameters=[
            params_file,
            {
                # Others' time is its own.
                'use_clock': ParameterValue(use_sim_time, value_type=bool),
                'linear': ParameterValue(LaunchConfiguration('linear'), value_type=float),
                'friction': ParameterValue(LaunchConfiguration('friction'), value_type=float),
                'slope': ParameterValue(LaunchConfiguration('slope'), value_type=float),
            },
        ],
    )
    walker = Node(
        package='klann_ros',
        executable='walker_node',
        name='walker_node',
        namespace=namespace,
        output='screen',
        parameters=[
            params_file,
            {
                'use_sim_time': use_sim_time,
                # An IMU is fused once: here, or in robot_localization, which then has the tf.
                'use_imu': ParameterValue(is_alone, value_type=bool),
                'publish_tf': ParameterValue(is_alone, value_type=bool),
            },
        ],
    )
    ekf = Node(
        package='robot_localization',
        executable='ekf_node',
        name='ekf_node',
        namespace=namespace,
        output='screen',
        condition=UnlessCondition(is_alone),
        parameters=[
            PathJoinSubstitution([SHARE, 'config', 'ekf.yaml']),
            {'use_sim_time': ParameterValue(use_sim_time, value_type=bool)},
        ],
    )
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=check), leg, sim, walker, ekf])
