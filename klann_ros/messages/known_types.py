"""
The message types of legs and walkers.

A new type is its fields in `_FIELDS`, in ROS's notation, and its name below them. If it is that of
a measured point or of a crank's angle, `POINT_FIELDS` or `ANGLE_TYPES` has it, too.
"""

from .message_type import MessageType

_XYZ = 'float64 x, float64 y, float64 z'
_FIELDS = {
    'builtin_interfaces/Duration': 'int32 sec, uint32 nanosec',
    'builtin_interfaces/Time': 'int32 sec, uint32 nanosec',
    'diagnostic_msgs/DiagnosticArray': 'std_msgs/Header header, DiagnosticStatus[] status',
    'diagnostic_msgs/DiagnosticStatus': (
        'byte level, string name, string message, string hardware_id, KeyValue[] values'
    ),
    'diagnostic_msgs/KeyValue': 'string key, string value',
    'geometry_msgs/Point': _XYZ,
    'geometry_msgs/PointStamped': 'std_msgs/Header header, Point point',
    'geometry_msgs/Pose': 'Point position, Quaternion orientation',
    'geometry_msgs/PoseStamped': 'std_msgs/Header header, Pose pose',
    'geometry_msgs/PoseWithCovariance': 'Pose pose, float64[36] covariance',
    'geometry_msgs/PoseWithCovarianceStamped': 'std_msgs/Header header, PoseWithCovariance pose',
    'geometry_msgs/Quaternion': f'{_XYZ}, float64 w',
    'geometry_msgs/Transform': 'Vector3 translation, Quaternion rotation',
    'geometry_msgs/TransformStamped': (
        'std_msgs/Header header, string child_frame_id, Transform transform'
    ),
    'geometry_msgs/Twist': 'Vector3 linear, Vector3 angular',
    'geometry_msgs/TwistStamped': 'std_msgs/Header header, Twist twist',
    'geometry_msgs/TwistWithCovariance': 'Twist twist, float64[36] covariance',
    'geometry_msgs/Vector3': _XYZ,
    'nav_msgs/Odometry': (
        'std_msgs/Header header, string child_frame_id, geometry_msgs/PoseWithCovariance pose, '
        'geometry_msgs/TwistWithCovariance twist'
    ),
    'rosgraph_msgs/Clock': 'builtin_interfaces/Time clock',
    'sensor_msgs/Imu': (
        'std_msgs/Header header, '
        'geometry_msgs/Quaternion orientation, float64[9] orientation_covariance, '
        'geometry_msgs/Vector3 angular_velocity, float64[9] angular_velocity_covariance, '
        'geometry_msgs/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance'
    ),
    'sensor_msgs/JointState': (
        'std_msgs/Header header, string[] name, '
        'float64[] position, float64[] velocity, float64[] effort'
    ),
    'std_msgs/Float32': 'float32 data',
    'std_msgs/Float32MultiArray': 'MultiArrayLayout layout, float32[] data',
    'std_msgs/Float64': 'float64 data',
    'std_msgs/Float64MultiArray': 'MultiArrayLayout layout, float64[] data',
    'std_msgs/Header': 'builtin_interfaces/Time stamp, string frame_id',
    'std_msgs/Int32': 'int32 data',
    'std_msgs/MultiArrayDimension': 'string label, uint32 size, uint32 stride',
    'std_msgs/MultiArrayLayout': 'MultiArrayDimension[] dim, uint32 data_offset',
    'std_msgs/String': 'string data',
    'tf2_msgs/TFMessage': 'geometry_msgs/TransformStamped[] transforms',
    'trajectory_msgs/JointTrajectory': (
        'std_msgs/Header header, string[] joint_names, JointTrajectoryPoint[] points'
    ),
    'trajectory_msgs/JointTrajectoryPoint': (
        'float64[] positions, float64[] velocities, float64[] accelerations, float64[] effort, '
        'builtin_interfaces/Duration time_from_start'
    ),
    # The fields that are read; more follow.
    'visualization_msgs/Marker': (
        'std_msgs/Header header, string ns, int32 id, int32 type, int32 action, '
        'geometry_msgs/Pose pose'
    ),
}


_DEFINITIONS = {
    name: [(words[0], words[1]) for words in (field.split() for field in fields.split(','))]
    for name, fields in _FIELDS.items()
}
MESSAGE_TYPES: dict[str, MessageType] = {}
"""The message types by the names that topics have."""


def _message_type(name: str) -> MessageType:
    message_type = MessageType(name, _DEFINITIONS)
    MESSAGE_TYPES[message_type.name] = message_type
    return message_type


CLOCK = _message_type('rosgraph_msgs/Clock')
DIAGNOSTICS = _message_type('diagnostic_msgs/DiagnosticArray')
FLOAT32 = _message_type('std_msgs/Float32')
FLOAT64 = _message_type('std_msgs/Float64')
IMU = _message_type('sensor_msgs/Imu')
INT32 = _message_type('std_msgs/Int32')
JOINT_STATE = _message_type('sensor_msgs/JointState')
JOINT_TRAJECTORY = _message_type('trajectory_msgs/JointTrajectory')
KEY_VALUE = _message_type('diagnostic_msgs/KeyValue')
MARKER = _message_type('visualization_msgs/Marker')
ODOMETRY = _message_type('nav_msgs/Odometry')
POINT = _message_type('geometry_msgs/PointStamped')
POSE = _message_type('geometry_msgs/PoseStamped')
POSE_WITH_COVARIANCE = _message_type('geometry_msgs/PoseWithCovarianceStamped')
STRING = _message_type('std_msgs/String')
TRANSFORM = _message_type('geometry_msgs/TransformStamped')
TRANSFORMS = _message_type('tf2_msgs/TFMessage')
TWIST = _message_type('geometry_msgs/Twist')
TWIST_STAMPED = _message_type('geometry_msgs/TwistStamped')

POINT_FIELDS = {
    POINT.name: 'point',
    POSE.name: 'pose.position',
    POSE_WITH_COVARIANCE.name: 'pose.pose.position',
    TRANSFORM.name: 'transform.translation',
    TRANSFORMS.name: 'transform.translation',
    MARKER.name: 'pose.position',
}
"""The field of x and y in each type of a measured point."""
FRAMED_TYPES = frozenset((TRANSFORMS.name, MARKER.name))
"""Types with several points under names: those of computed frames and drawings, too."""
ANGLE_TYPES = frozenset((FLOAT64.name, FLOAT32.name))
"""Types of a topic that has one angle [rad]."""
ARRAY_TYPES = frozenset(
    _message_type(f'std_msgs/{name}').name for name in ('Float64MultiArray', 'Float32MultiArray')
)
"""Types of a topic that has a number for each crank, without names."""
