"""
A moving leg: leg.launch.py and a crank_node. Ctrl-C ends it.

    ros2 launch klann_ros demo.launch.py view:=true record:=true speed:=3.0

It takes the arguments of leg.launch.py as well: ros2 launch klann_ros demo.launch.py --show-args
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

FLAG = ['true', 'false', 'True', 'False']
ARGUMENTS = (
    DeclareLaunchArgument(
        'speed', default_value='6.283185307179586', description='Rate of the crank [rad/s].'
    ),
    DeclareLaunchArgument('rate', default_value='100.0', description='Message rate [Hz].'),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Namespace of the nodes and their topics.'
    ),
    DeclareLaunchArgument(
        'use_sim_time',
        default_value='false',
        choices=FLAG,
        description='Take the time from /clock.',
    ),
)


def check(context: LaunchContext) -> None:
    """Refuse invalid numbers before the leg is started."""
    for name in ('speed', 'rate'):
        text = LaunchConfiguration(name).perform(context)
        try:
            float(text)
        except ValueError:
            raise RuntimeError(f'{name}:={text} is not a number') from None


def generate_launch_description() -> LaunchDescription:
    """Describe the leg and its crank."""
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
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=check), leg, crank])
