"""
A leg that walks: leg.launch.py, a crank that turns it, and a recorder if wanted. Ctrl-C ends it.

    ros2 launch klann_ros demo.launch.py record:=true speed:=3.0
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = (
    DeclareLaunchArgument(
        'speed', default_value='6.283185307179586', description='Rate of the crank [rad/s].'
    ),
    DeclareLaunchArgument('rate', default_value='100.0', description='Messages a second [Hz].'),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Namespace of the nodes and their topics.'
    ),
    DeclareLaunchArgument(
        'use_sim_time', default_value='false', description='Take the time from /clock.'
    ),
    DeclareLaunchArgument('record', default_value='false', description='Record the run to MCAP.'),
    DeclareLaunchArgument(
        'output', default_value='', description='Folder of the run; empty: runs/<UTC time>.'
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Describe the leg, its crank and its recorder."""
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    leg = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([FindPackageShare('klann_ros'), 'launch', 'leg.launch.py'])
        ),
        launch_arguments={'namespace': namespace, 'use_sim_time': use_sim_time}.items(),
    )
    crank = Node(
        package='klann_ros',
        executable='crank_node',
        name='crank_node',
        namespace=namespace,
        output='screen',
        parameters=[
            {
                'output': 'crank_state',
                'use_sim_time': use_sim_time,
                'speed': ParameterValue(LaunchConfiguration('speed'), value_type=float),
                'rate': ParameterValue(LaunchConfiguration('rate'), value_type=float),
            }
        ],
    )
    recorder = Node(
        package='klann_ros',
        executable='recorder_node',
        name='recorder_node',
        namespace=namespace,
        output='screen',
        parameters=[
            {
                'output': ParameterValue(LaunchConfiguration('output'), value_type=str),
                'use_sim_time': use_sim_time,
            }
        ],
        condition=IfCondition(LaunchConfiguration('record')),
    )
    return LaunchDescription([*ARGUMENTS, leg, crank, recorder])
