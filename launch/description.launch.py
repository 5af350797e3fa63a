"""
The frames of the legs, from their URDF and joint_states; optional RViz.

The other launch files include it. A linkage file has no URDF: only its plane gets a parent frame.
"""

from itertools import takewhile
from pathlib import Path
import subprocess

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, LogInfo, OpaqueFunction
from launch.conditions import IfCondition, UnlessCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# Without choices a wrong flag would fail at its first use, with half of the launch running.
FLAG = ['true', 'false', 'True', 'False']
SHARE = FindPackageShare('klann_ros')
ARGUMENTS = (
    DeclareLaunchArgument(
        'params_file',
        default_value=PathJoinSubstitution([SHARE, 'config', 'sem104.yaml']),
        description='Parameter file of solver_node: the geometry of the leg, or of several legs.',
    ),
    DeclareLaunchArgument(
        'linkage',
        default_value='',
        description="A linkage's YAML file, solved instead of the Klann leg; it has no URDF.",
    ),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Namespace of the nodes and their topics.'
    ),
    DeclareLaunchArgument(
        'base_frame', default_value='base_link', description='Frame that carries the legs.'
    ),
    DeclareLaunchArgument(
        'frame_id', default_value='leg_plane', description='Frame of the plane of a leg.'
    ),
    DeclareLaunchArgument(
        'frame_prefix',
        default_value='',
        description='Prefix of every frame of a leg, one for each namespace, such as left/.',
    ),
    DeclareLaunchArgument(
        'use_sim_time',
        default_value='false',
        choices=FLAG,
        description='Take the time from /clock.',
    ),
    DeclareLaunchArgument('rviz', default_value='false', choices=FLAG, description='Start RViz.'),
    DeclareLaunchArgument(
        'rviz_config',
        default_value=PathJoinSubstitution([SHARE, 'rviz', 'klann.rviz']),
        description='Configuration of RViz.',
    ),
)


def frames(context: LaunchContext) -> list[LogInfo | Node]:
    """Return the publisher of the legs' frames, and xacro's warnings; nothing for a linkage."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    if value('linkage'):
        return []
    # A relative path starts in the user's folder; for xacro, in that of its input file.
    params_file = Path.cwd() / value('params_file')
    command = ['xacro', PathJoinSubstitution([SHARE, 'urdf', 'klann.urdf.xacro']).perform(context)]
    command.append(f'params_file:={params_file}')
    command += [f'{name}:={value(name)}' for name in ('base_frame', 'frame_id', 'frame_prefix')]
    # No shell, and no Command, which splits as a shell does: a path may have spaces and quotes.
    urdf = subprocess.run(  # noqa: S603
        command, capture_output=True, check=False, errors='replace', text=True
    )
    said = [''.join(filter(str.isprintable, line)).strip() for line in urdf.stderr.splitlines()]
    if urdf.returncode:
        # The lines after it are the position in klann.urdf.xacro.
        reason = ' '.join(takewhile(lambda line: not line.startswith('when '), said))
        raise RuntimeError(f'{params_file}: xacro makes no URDF of it: {reason}')
    joint_states = '/'.join(filter(None, ['', value('namespace').strip('/'), 'joint_states']))
    publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name='robot_state_publisher',
        namespace=value('namespace'),
        output='screen',
        parameters=[
            {
                # Without a type the URDF would be read as YAML.
                'robot_description': ParameterValue(urdf.stdout, value_type=str),
                # The default, 20 Hz, is not smooth.
                'publish_frequency': 200.0,
                # The default of 5 messages loses messages at every stall above 50 ms.
                f'qos_overrides.{joint_states}.subscription.depth': 200,
                'use_sim_time': value('use_sim_time').lower() == 'true',
            }
        ],
    )
    return [*(LogInfo(msg=f'xacro: {line}') for line in said), publisher]


def generate_launch_description() -> LaunchDescription:
    """Describe robot_state_publisher, or a static transform, and RViz."""
    checks = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', 'checks.py']))
    )
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    # The plane's axes are the textbook's, x right and y up; base_link has z up.
    upright = Node(
        package='tf2_ros',
        executable='static_transform_publisher',
        name='leg_plane_publisher',
        namespace=namespace,
        arguments=[
            *('--roll', '1.5707963267948966'),
            *('--frame-id', LaunchConfiguration('base_frame')),
            '--child-frame-id',
            [LaunchConfiguration('frame_prefix'), LaunchConfiguration('frame_id')],
        ],
        condition=UnlessCondition(EqualsSubstitution(LaunchConfiguration('linkage'), '')),
    )
    rviz = Node(
        package='rviz2',
        executable='rviz2',
        name='rviz2',
        namespace=namespace,
        arguments=['-d', LaunchConfiguration('rviz_config')],
        # In a namespace, its own topics.
        remappings=[(f'/{topic}', topic) for topic in ('robot_description', 'markers', 'point_h')],
        parameters=[{'use_sim_time': use_sim_time}],
        condition=IfCondition(LaunchConfiguration('rviz')),
    )
    return LaunchDescription([*ARGUMENTS, checks, OpaqueFunction(function=frames), upright, rviz])
