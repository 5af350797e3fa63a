"""
solver_node and the frames of its legs; optional RViz, live page and recorder.

    ros2 launch klann_ros leg.launch.py params_file:=my_leg.yaml rviz:=true slider:=true

A second leg in another namespace needs its own frames: namespace:=left frame_prefix:=left/
All arguments, also those of description.launch.py: ros2 launch klann_ros leg.launch.py --show-args
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

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
    DeclareLaunchArgument(
        'record', default_value='false', choices=FLAG, description='Record the run to MCAP.'
    ),
    DeclareLaunchArgument(
        'output', default_value='', description='Folder of the run; empty: runs/<UTC time>.'
    ),
    DeclareLaunchArgument(
        'view',
        default_value='false',
        choices=FLAG,
        description='Serve the live page; view_node prints its address.',
    ),
    DeclareLaunchArgument(
        'view_port', default_value='8321', description='Port of the live page; 0: any free one.'
    ),
    DeclareLaunchArgument(
        'slider',
        default_value='false',
        choices=FLAG,
        description='Start joint_state_publisher_gui with a crank slider. Not with a demo.',
    ),
)


def solver(context: LaunchContext) -> list[Node]:
    """Return the solver; a linkage that was not given is that of the parameter file."""
    linkage = LaunchConfiguration('linkage').perform(context)
    return [
        Node(
            package='klann_ros',
            executable='solver_node',
            name='solver_node',
            namespace=LaunchConfiguration('namespace'),
            output='screen',
            parameters=[
                PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')]),
                {
                    'frame_id': ParameterValue(
                        [LaunchConfiguration('frame_prefix'), LaunchConfiguration('frame_id')],
                        value_type=str,
                    ),
                    'use_sim_time': LaunchConfiguration('use_sim_time'),
                    **({'linkage': linkage} if linkage else {}),
                },
            ],
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the solver and its optional companions."""
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    names = ('params_file', 'linkage', 'namespace', 'frame_id', 'frame_prefix', 'use_sim_time')
    description = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([SHARE, 'launch', 'description.launch.py'])
        ),
        launch_arguments={name: LaunchConfiguration(name) for name in names}.items(),
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
    # It shows the legs of all namespaces; a second one needs its own port.
    view = Node(
        package='klann_ros',
        executable='view_node',
        name='view_node',
        namespace=namespace,
        output='screen',
        arguments=['--port', LaunchConfiguration('view_port')],
        condition=IfCondition(LaunchConfiguration('view')),
    )
    # It has the crank joint only, so it does not receive the solver's answer.
    slider = Node(
        package='joint_state_publisher_gui',
        executable='joint_state_publisher_gui',
        name='crank_slider',
        namespace=namespace,
        arguments=[PathJoinSubstitution([SHARE, 'urdf', 'crank.urdf'])],
        remappings=[('joint_states', 'crank_state')],
        parameters=[{'rate': 50, 'use_sim_time': use_sim_time}],
        condition=IfCondition(LaunchConfiguration('slider')),
    )
    return LaunchDescription(
        [*ARGUMENTS, description, OpaqueFunction(function=solver), recorder, view, slider]
    )
