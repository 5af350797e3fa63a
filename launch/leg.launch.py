"""
One leg: solver_node, and the transform that puts its plane upright.

    ros2 launch klann_ros leg.launch.py params_file:=/path/to/my_leg.yaml

In another namespace give the plane a name of its own as well: namespace:=left frame_id:=left_plane
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = (
    DeclareLaunchArgument(
        'params_file',
        default_value=PathJoinSubstitution(
            [FindPackageShare('klann_ros'), 'config', 'sem104.yaml']
        ),
        description='Parameter file of solver_node: the geometry of the leg.',
    ),
    DeclareLaunchArgument(
        'linkage',
        default_value='',
        description="A linkage's YAML file, to be solved instead of the Klann leg.",
    ),
    DeclareLaunchArgument(
        'namespace', default_value='', description='Namespace of the nodes and their topics.'
    ),
    DeclareLaunchArgument(
        'base_frame', default_value='base_link', description='Frame that carries the leg.'
    ),
    DeclareLaunchArgument(
        'frame_id', default_value='leg_plane', description='Frame of the plane of the leg.'
    ),
    DeclareLaunchArgument(
        'use_sim_time', default_value='false', description='Take the time from /clock.'
    ),
)


def generate_launch_description() -> LaunchDescription:
    """Describe the solver and its frame."""
    namespace = LaunchConfiguration('namespace')
    use_sim_time = LaunchConfiguration('use_sim_time')
    frame_id = LaunchConfiguration('frame_id')
    solver = Node(
        package='klann_ros',
        executable='solver_node',
        name='solver_node',
        namespace=namespace,
        output='screen',
        parameters=[
            LaunchConfiguration('params_file'),
            {
                # Without a type an empty text would be read as YAML's null.
                'linkage': ParameterValue(LaunchConfiguration('linkage'), value_type=str),
                'frame_id': frame_id,
                'use_sim_time': use_sim_time,
            },
        ],
    )
    # The plane's axes are the textbook's, x right and y up; base_link has z up.
    upright = Node(
        package='tf2_ros',
        executable='static_transform_publisher',
        name='leg_plane_publisher',
        namespace=namespace,
        arguments=[
            *('--roll', '1.5707963267948966'),
            *('--frame-id', LaunchConfiguration('base_frame')),
            *('--child-frame-id', frame_id),
        ],
    )
    return LaunchDescription([*ARGUMENTS, solver, upright])
