"""Walk in the simulation: ros2 launch my_walker walk.launch.py linear:=0.05 view:=true."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Give the parameter file of this package to klann_ros; see its walk.launch.py."""
    walker = PathJoinSubstitution([FindPackageShare('my_walker'), 'config', 'desk_walker.yaml'])
    walk = PathJoinSubstitution([FindPackageShare('klann_ros'), 'launch', 'walk.launch.py'])
    include = IncludeLaunchDescription(walk, launch_arguments={'params_file': walker}.items())
    return LaunchDescription([include])
