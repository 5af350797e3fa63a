"""
A walker with four or six legs: one solver_node for all of them.

    ros2 launch klann_ros walker.launch.py walker:=6 crank:=true rviz:=true

It also takes the arguments of leg.launch.py, and with crank:=true those of demo.launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition, UnlessCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

FLAG = ['true', 'false', 'True', 'False']
SHARE = FindPackageShare('klann_ros')
ARGUMENTS = (
    DeclareLaunchArgument(
        'walker',
        default_value='4',
        choices=['4', '6'],
        description='How many legs: which of the shipped parameter files.',
    ),
    DeclareLaunchArgument(
        'params_file',
        default_value=[
            PathJoinSubstitution([SHARE, 'config', 'walker']),
            LaunchConfiguration('walker'),
            '.yaml',
        ],
        description='Parameter file of solver_node, instead of a shipped one.',
    ),
    DeclareLaunchArgument(
        'crank',
        default_value='false',
        choices=FLAG,
        description='Turn the crank with a crank_node. Not with a slider.',
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Describe the walker, with its crank or without."""
    crank = LaunchConfiguration('crank')

    def included(name: str, condition: IfCondition | UnlessCondition) -> IncludeLaunchDescription:
        return IncludeLaunchDescription(
            PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', name])),
            launch_arguments={'params_file': LaunchConfiguration('params_file')}.items(),
            condition=condition,
        )

    return LaunchDescription(
        [
            *ARGUMENTS,
            included('demo.launch.py', IfCondition(crank)),
            included('leg.launch.py', UnlessCondition(crank)),
        ]
    )
