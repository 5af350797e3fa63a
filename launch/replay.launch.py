"""
Play a run back into a viewer: player_node, the frames of the run's legs, RViz if wanted.

    ros2 launch klann_ros replay.launch.py log:=runs/first rviz:=true

It ends with the run; with rviz:=true it stays, so that one can go on looking, until Ctrl-C.

params_file must be that of the run. A replay must not meet live topics nor live frames: end the
live nodes first, and whatever else publishes /clock. The viewers take the time of the run: without
it their frames are as old as the run, and a loop lets them stand still, because nothing follows
stamps that go back. It takes the arguments of description.launch.py as well.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Smooth for the eye [Hz].
CLOCK_RATE = '100.0'
FLAG = ['true', 'false', 'True', 'False']
SHARED = ('namespace', 'use_sim_time')
ARGUMENTS = (
    DeclareLaunchArgument('log', description='The run: its folder, or an .mcap or .db3 file.'),
    DeclareLaunchArgument('play_rate', default_value='1.0', description='2.0 is twice as fast.'),
    DeclareLaunchArgument(
        'start_offset', default_value='0.0', description='Leave out so much of the start [s].'
    ),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Goes before every topic of the run.'
    ),
    DeclareLaunchArgument(
        'loop',
        default_value='false',
        choices=FLAG,
        description='Play again and again.',
    ),
    DeclareLaunchArgument(
        'use_sim_time',
        default_value='true',
        choices=FLAG,
        description="The run's own time is played on /clock, and the viewers follow it.",
    ),
)


def check(context: LaunchContext) -> None:
    """Refuse a run that is not there before RViz is started."""
    log = LaunchConfiguration('log').perform(context)
    if not Path(log).exists():
        raise RuntimeError(f'log:={log}: there is no such file or folder')


def player(context: LaunchContext) -> list[Node]:
    """Return the player; a flag is there or not, which no substitution can say."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def asked(flag: str) -> bool:
        return value(flag).lower() == 'true'

    # A delay that leaves RViz the time to start.
    arguments = [value('log'), '--delay', '2.0', '--rate', value('play_rate')]
    arguments += ['--start-offset', value('start_offset')]
    if asked('loop'):
        arguments.append('--loop')
    if asked('use_sim_time'):
        arguments += ['--clock', CLOCK_RATE]
    return [
        Node(
            package='klann_ros',
            executable='player_node',
            name='player_node',
            namespace=value('namespace'),
            output='screen',
            arguments=arguments,
            on_exit=None if asked('rviz') else Shutdown(reason='the run has been played'),
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the player and the frames."""
    description = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution(
                [FindPackageShare('klann_ros'), 'launch', 'description.launch.py']
            )
        ),
        launch_arguments={name: LaunchConfiguration(name) for name in SHARED}.items(),
    )
    return LaunchDescription(
        [*ARGUMENTS, OpaqueFunction(function=check), description, OpaqueFunction(function=player)]
    )
