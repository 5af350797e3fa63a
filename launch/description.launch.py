"""
What a viewer needs: the frames of the legs, from their URDF and joint_states; RViz if wanted.

The other launch files include it. A linkage from a file has no URDF: only its plane gets a parent.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import (
    Command,
    EqualsSubstitution,
    FindExecutable,
    LaunchConfiguration,
    PathJoinSubstitution,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

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
        description='Goes before every frame of a leg: one for each namespace, as in left/.',
    ),
    DeclareLaunchArgument(
        'use_sim_time', default_value='false', description='Take the time from /clock.'
    ),
    DeclareLaunchArgument('rviz', default_value='false', description='Start RViz.'),
    DeclareLaunchArgument(
        'rviz_config',
        default_value=PathJoinSubstitution([SHARE, 'rviz', 'klann.rviz']),
        description='Configuration of RViz.',
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Describe robot_state_publisher, or what stands in for it, and RViz."""
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    base_frame = LaunchConfiguration('base_frame')
    frame_id = LaunchConfiguration('frame_id')
    frame_prefix = LaunchConfiguration('frame_prefix')
    klann_leg = EqualsSubstitution(LaunchConfiguration('linkage'), '')
    # A relative path starts where the user is, for xacro at the file that it reads. The quotes
    # are for paths with spaces: Command splits its text as a shell does.
    params_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
    urdf = Command(
        [
            *('"', FindExecutable(name='xacro'), '"'),
            *(' "', PathJoinSubstitution([SHARE, 'urdf', 'klann.urdf.xacro']), '"'),
            *(' "params_file:=', params_file, '"'),
            *(' "base_frame:=', base_frame, '"'),
            *(' "frame_id:=', frame_id, '"'),
            *(' "frame_prefix:=', frame_prefix, '"'),
        ]
    )
    frames = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name='robot_state_publisher',
        namespace=namespace,
        output='screen',
        parameters=[
            {
                # Without a type the URDF would be read as YAML.
                'robot_description': ParameterValue(urdf, value_type=str),
                # Its default, 20 Hz, is less than smooth.
                'publish_frequency': 200.0,
                'use_sim_time': use_sim_time,
            }
        ],
        condition=IfCondition(klann_leg),
    )
    # The plane's axes are the textbook's, x right and y up; base_link has z up.
    upright = Node(
        package='tf2_ros',
        executable='static_transform_publisher',
        name='leg_plane_publisher',
        namespace=namespace,
        arguments=[
            *('--roll', '1.5707963267948966'),
            *('--frame-id', base_frame),
            *('--child-frame-id', [frame_prefix, frame_id]),
        ],
        condition=UnlessCondition(klann_leg),
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
    return LaunchDescription([*ARGUMENTS, frames, upright, rviz])
