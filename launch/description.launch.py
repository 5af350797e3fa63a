"""
The frames of the legs, from their URDF and joint_states; optional RViz.

The other launch files include it. The URDF is that of `export`, for any linkage.
"""

from pathlib import Path

from klann_ros.export import urdf
from klann_ros.robot import robot_from_parameters, solver_parameters
from klann_ros.sanitize.text import printable_line
from klann_ros.sanitize.yaml_text import parse_file
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
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
        description="A linkage's YAML file or shipped name, instead of that of params_file.",
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


def urdf_of(params_file: Path, linkage: str, **names: str) -> str:
    """Return the URDF of the legs that solver_node has with these parameters."""
    try:
        # The node's default, one leg, where the file has no geometry.
        parameters = {'legs': [''], **solver_parameters(parse_file(params_file))}
        if linkage:
            parameters['linkage'] = linkage
        robot = robot_from_parameters(parameters, folders=(params_file.parent,), weigh=False)
        return urdf(robot, joint_separator=parameters.get('joint_separator', '/'), **names)
    except (OSError, TypeError, ValueError) as error:
        source = linkage or params_file
        raise RuntimeError(f'{source}: there is no URDF of it: {printable_line(error)}') from None


def frames(context: LaunchContext) -> list[Node]:
    """Return the publisher of the legs' frames."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    names = {name: value(name) for name in ('base_frame', 'frame_id', 'frame_prefix')}
    # A relative path starts in the user's folder.
    description = urdf_of(Path.cwd() / value('params_file'), value('linkage'), **names)
    joint_states = '/'.join(['', *filter(None, [value('namespace').strip('/')]), 'joint_states'])
    publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name='robot_state_publisher',
        namespace=value('namespace'),
        output='screen',
        parameters=[
            {
                # Without a type the URDF would be read as YAML.
                'robot_description': ParameterValue(description, value_type=str),
                # The default, 20 Hz, is not smooth.
                'publish_frequency': 200.0,
                # The default of 5 messages loses messages at every stall above 50 ms.
                f'qos_overrides.{joint_states}.subscription.depth': 200,
                'use_sim_time': value('use_sim_time').lower() == 'true',
            }
        ],
    )
    return [publisher]


def generate_launch_description() -> LaunchDescription:
    """Describe robot_state_publisher, or a static transform, and RViz."""
    checks = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, 'launch', 'checks.py']))
    )
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
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
    return LaunchDescription([*ARGUMENTS, checks, OpaqueFunction(function=frames), rviz])
