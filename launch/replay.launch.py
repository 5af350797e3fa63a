"""
Play a run back: player_node, the frames of its legs, optional RViz.

    ros2 launch klann_ros replay.launch.py log:=runs/first rviz:=true

It ends with the run; with rviz:=true it stays until Ctrl-C.

params_file must be that of the run; a robot_description in it is played as
recorded_robot_description, as robot_state_publisher has the one of params_file. A replay must not
meet live topics nor live frames: end the live nodes first, and whatever else publishes /clock. The
viewers take the time of the run: without it their frames are as old as the run, and a loop lets
them stand still, because nothing follows stamps that go back. It takes the arguments of
description.launch.py as well.
"""

from pathlib import Path

from klann_ros.log import LogError, open_log
from klann_ros.sanitize.text import printable_line
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

# Rate of /clock, for smooth motion in a viewer [Hz].
CLOCK_RATE = '100.0'
FLAG = ['true', 'false', 'True', 'False']
SHARED = ('namespace', 'use_sim_time')
ARGUMENTS = (
    DeclareLaunchArgument('log', description='The run: its folder, or an .mcap or .db3 file.'),
    DeclareLaunchArgument('play_rate', default_value='1.0', description='2.0 is twice as fast.'),
    DeclareLaunchArgument(
        'start_offset', default_value='0.0', description='Skipped time at the start [s].'
    ),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Prefix of every topic of the run.'
    ),
    DeclareLaunchArgument(
        'loop',
        default_value='false',
        choices=FLAG,
        description='Repeat the run.',
    ),
    DeclareLaunchArgument(
        'use_sim_time',
        default_value='true',
        choices=FLAG,
        description="Publish the run's time on /clock for the viewers.",
    ),
)


def descriptions(log: str) -> list[str]:
    """Return the robot descriptions in a run with their new names."""
    if not Path(log).exists():
        raise RuntimeError(f'log:={log}: there is no such file or folder')
    try:
        with open_log(log) as run:
            topics = {topic.name for topic in run.topics}
    except (LogError, OSError) as error:
        raise RuntimeError(f'log:={printable_line(error)}') from None
    renamed = []
    for topic in sorted(topics):
        namespace, _, name = topic.rpartition('/')
        if name == 'robot_description':
            renamed.append(f'{topic}:={namespace}/recorded_{name}')
    return renamed


def check(context: LaunchContext) -> None:
    """Refuse a run before RViz is started."""
    descriptions(LaunchConfiguration('log').perform(context))


def player(context: LaunchContext) -> list[Node]:
    """Return the player; a substitution cannot omit a flag."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def asked(flag: str) -> bool:
        return value(flag).lower() == 'true'

    # The delay gives RViz the time to start.
    arguments = [value('log'), '--delay', '2.0', '--rate', value('play_rate')]
    arguments += ['--start-offset', value('start_offset')]
    renamed = descriptions(value('log'))
    if renamed:
        arguments += ['--remap', *renamed]
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
