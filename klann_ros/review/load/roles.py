"""What the topics of a log are to a review, by their types and names."""

from collections.abc import Collection
from enum import auto, Enum
from typing import NamedTuple

from klann_ros.calibration import COMPUTED_TOPICS
from klann_ros.log import ANNOTATION, Topic
from klann_ros.messages import (
    ANGLE_TYPES,
    ARRAY_TYPES,
    CLOCK,
    DIAGNOSTICS,
    FRAMED_TYPES,
    INT32,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    KEY_VALUE,
    MESSAGE_TYPES,
    MessageType,
    ODOMETRY,
    POINT,
    POINT_FIELDS,
    STRING,
)
from klann_ros.review.model.times import CLOCK as CLOCK_TOPIC

COMMAND = 'crank_command'
STATE = 'crank_state'
POSITIONS = 'crank_positions'
TRAJECTORY = 'joint_trajectory'
LEASE = 'lease'
DESCRIPTION = 'robot_description'
ODOMETRY_TOPICS = ('odom', 'ground_truth')
# What topics of ros2_control are, by the end of their node's name and their last name.
_CONTROL_TOPICS = {
    ('broadcaster', 'joint_states'): STATE,
    ('position_controller', 'commands'): POSITIONS,
    ('velocity_controller', 'commands'): COMMAND,
    ('controller', TRAJECTORY): TRAJECTORY,
}


def place_of(topic: str) -> tuple[str, str]:
    """
    Return the namespace of a topic's robot, and the last part of the topic's name.

    Topics of ros2_control, below the names of its nodes, have the last name of ours.
    """
    namespace, _, last_name = topic.rpartition('/')
    parent, _, node = namespace.rpartition('/')
    for (node_end, control_name), name in _CONTROL_TOPICS.items():
        if last_name == control_name and node.endswith(node_end):
            return parent, name
    return namespace, last_name


class Role(Enum):
    """What the messages of a topic are to a review."""

    JOINTS = auto()
    ANGLE = auto()
    TICKS = auto()
    FOOT = auto()
    ARRAY = auto()
    LEASE = auto()
    BODY = auto()
    CLOCK = auto()
    DESCRIPTION = auto()
    REPORT = auto()
    TRAJECTORY = auto()
    MEASURED = auto()


LEG_ROLES = (Role.JOINTS, Role.ANGLE, Role.TICKS, Role.FOOT, Role.ARRAY, Role.LEASE)
# The roles whose topics must have messages of their type.
REQUIRED_ROLES = (*LEG_ROLES, Role.BODY)


class TopicReading(NamedTuple):
    """How the messages of a topic are read."""

    role: Role
    # The types of such topics, and their last or full names; any by default.
    types: Collection[str]
    names: Collection[str] = ()
    # The fields that are read in bulk; None where messages are read one by one.
    paths: tuple[str, ...] | None = None


_READINGS = (
    TopicReading(Role.JOINTS, [JOINT_STATE.name], paths=('position', 'velocity', 'effort')),
    TopicReading(Role.ANGLE, ANGLE_TYPES, ['crank_angle'], ('data',)),
    TopicReading(Role.TICKS, [INT32.name], [STATE], ('data',)),
    TopicReading(Role.FOOT, [POINT.name], ['point_h'], ('point',)),
    TopicReading(Role.ARRAY, ARRAY_TYPES, [COMMAND, POSITIONS], ('data',)),
    TopicReading(Role.LEASE, [KEY_VALUE.name], [LEASE]),
    TopicReading(Role.BODY, [ODOMETRY.name], ODOMETRY_TOPICS, ('pose.pose',)),
    TopicReading(Role.CLOCK, [CLOCK.name], [CLOCK_TOPIC], ()),
    TopicReading(Role.DESCRIPTION, [STRING.name], [DESCRIPTION]),
    TopicReading(Role.REPORT, [DIAGNOSTICS.name]),
    TopicReading(Role.TRAJECTORY, [JOINT_TRAJECTORY.name], [TRAJECTORY]),
    *(TopicReading(Role.MEASURED, [kind], paths=(path,)) for kind, path in POINT_FIELDS.items()),
)


def reading_of(topic: Topic) -> TopicReading | None:
    """Return how the messages of a topic are read; None if a review only counts them."""
    kind = _ros2_type(topic)
    namespace, name = place_of(topic.name)
    is_of_joint = kind == INT32.name and namespace.endswith(f'/{STATE}')
    names = {topic.name, STATE if is_of_joint else name}
    for reading in _READINGS:
        if kind in reading.types and not (reading.names and names.isdisjoint(reading.names)):
            is_computed = kind in FRAMED_TYPES or name in COMPUTED_TOPICS
            is_left_out = ANNOTATION in topic.extra
            is_left_out |= reading.role is Role.MEASURED and is_computed
            return None if is_left_out else reading
    return None


def type_of(topic: Topic) -> MessageType:
    """Return the type of a topic with a role."""
    return MESSAGE_TYPES[_ros2_type(topic)]


def _ros2_type(topic: Topic) -> str:
    """Return a topic's type as ROS 2 names it; ROS 1 leaves out `msg`."""
    package, _, name = topic.type.partition('/')
    return topic.type if '/' in name else f'{package}/msg/{name}'
