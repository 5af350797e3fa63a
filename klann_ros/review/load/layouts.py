"""
Where the numbers stand in messages of the few types that tell a leg, or how it walks.

Messages of a topic differ from each other in their numbers only, as a rule. So where the numbers
stand is found in one of them, and read from all that are like it at once.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

from klann_ros.log.records import Topic
from klann_ros.review.model.times import Flags, Floats, RowIndices, Times
from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, read_joint_state, STAMP_SIZE
import numpy as np
from numpy.typing import NDArray

CRANK_ANGLE = 'std_msgs/msg/Float64'
FOOT = 'geometry_msgs/msg/PointStamped'
JOINT_STATE = 'sensor_msgs/msg/JointState'
ODOMETRY = 'nav_msgs/msg/Odometry'
# Position, and orientation as a quaternion.
POSE = 7

Bytes = NDArray[np.uint8]


_HEADER = {
    'std_msgs/Header': ('builtin_interfaces/Time stamp', 'string frame_id'),
    'builtin_interfaces/Time': ('int32 sec', 'uint32 nanosec'),
}
_STANDARD_FIELDS = {
    CRANK_ANGLE: {'': ('float64 data',)},
    FOOT: {
        '': ('std_msgs/Header header', 'Point point'),
        'geometry_msgs/Point': ('float64 x', 'float64 y', 'float64 z'),
        **_HEADER,
    },
    JOINT_STATE: {
        '': (
            'std_msgs/Header header',
            'string[] name',
            'float64[] position',
            'float64[] velocity',
            'float64[] effort',
        ),
        **_HEADER,
    },
    ODOMETRY: {
        '': (
            'std_msgs/Header header',
            'string child_frame_id',
            'geometry_msgs/PoseWithCovariance pose',
            'geometry_msgs/TwistWithCovariance twist',
        ),
        'geometry_msgs/PoseWithCovariance': ('Pose pose', 'float64[36] covariance'),
        # A quaternion's fields have defaults, and so are no fields here.
        'geometry_msgs/Pose': ('Point position', 'Quaternion orientation'),
        'geometry_msgs/Point': ('float64 x', 'float64 y', 'float64 z'),
        'geometry_msgs/TwistWithCovariance': ('Twist twist', 'float64[36] covariance'),
        'geometry_msgs/Twist': ('Vector3 linear', 'Vector3 angular'),
        'geometry_msgs/Vector3': ('float64 x', 'float64 y', 'float64 z'),
        **_HEADER,
    },
}


class Numbers(NamedTuple):
    """Where a stretch of doubles begins in a message [bytes], and how many they are."""

    begin: int
    size: int

    @property
    def end(self) -> int:
        """Return where it ends [bytes]."""
        return self.begin + 8 * self.size


class Layout(NamedTuple):
    """Where the numbers stand in a message, and in all that are like it."""

    # The message in which they were found.
    data: bytes
    # The byte order of its numbers, as NumPy writes it.
    order: str
    # Whether it begins with a header, and so with a stamp.
    is_stamped: bool
    # The joints in a JointState.
    names: tuple[str, ...]
    # The number of a Float64; x, y and z of a point; the pose of an Odometry; positions,
    # velocities and efforts.
    numbers: tuple[Numbers, ...]
    # Which bytes are in all messages that are like it: byte order, lengths and texts. What stands
    # between them for alignment may be anything.
    fixed: RowIndices

    def alike(self, rows: Bytes) -> Flags:
        """Return which messages of this size, shape (n, size), differ in nothing but numbers."""
        own = np.frombuffer(self.data, np.uint8)[self.fixed]
        alike: Flags = (rows[:, self.fixed] == own).all(axis=1)
        return alike

    def doubles(self, rows: Bytes, which: int) -> Floats:
        """Return a stretch of doubles from messages that are alike, shape (n, count)."""
        begin, end = self.numbers[which].begin, self.numbers[which].end
        columns = np.ascontiguousarray(rows[:, slice(begin, end)])
        return columns.view(f'{self.order}f8').astype(np.float64)

    def stamps(self, rows: Bytes) -> Times:
        """Return the stamps of messages that are alike, shape (n,) [ns]."""
        columns = np.ascontiguousarray(rows[:, slice(HEADER_SIZE, HEADER_SIZE + STAMP_SIZE)])
        seconds = columns[:, :4].copy().view(f'{self.order}i4')[:, 0].astype(np.int64)
        stamps: Times = seconds * 10**9 + columns[:, 4:].copy().view(f'{self.order}u4')[:, 0]
        return stamps


def _crank_angle(data: bytes) -> Layout:
    cursor = CdrCursor(data)
    return _layout(cursor, data, (), Numbers(cursor.skip(8), 1), is_stamped=False)


def _foot(data: bytes) -> Layout:
    cursor = CdrCursor(data)
    cursor.skip(STAMP_SIZE)
    cursor.string()
    cursor.align(8)
    return _layout(cursor, data, (), Numbers(cursor.skip(24), 3))


def _odometry(data: bytes) -> Layout:
    cursor = CdrCursor(data)
    cursor.skip(STAMP_SIZE)
    cursor.string()
    cursor.string()
    cursor.align(8)
    return _layout(cursor, data, (), Numbers(cursor.skip(8 * POSE), POSE))


def _joint_state(data: bytes) -> Layout:
    cursor = CdrCursor(data)
    joints, sequences = read_joint_state(cursor)
    names = tuple(name.decode(errors='replace') for name in joints)
    return _layout(cursor, data, names, *(Numbers(*sequence) for sequence in sequences))


def _layout(
    cursor: CdrCursor,
    data: bytes,
    names: tuple[str, ...],
    *numbers: Numbers,
    is_stamped: bool = True,
) -> Layout:
    fixed = [np.arange(2), *(np.arange(part.start, part.stop) for part in cursor.structure)]
    return Layout(data, cursor.order, is_stamped, names, numbers, np.concatenate(fixed))


LAYOUTS: Mapping[str, Callable[[bytes], Layout]] = {
    CRANK_ANGLE: _crank_angle,
    FOOT: _foot,
    JOINT_STATE: _joint_state,
    ODOMETRY: _odometry,
}
"""How to find a message's layout, by its type; a ValueError says that it is no such message."""


def has_standard_fields(topic: Topic) -> bool:
    """Return whether a topic's messages are CDR of the fields that its type has in Jazzy."""
    if (topic.message_encoding, topic.schema_encoding) != ('cdr', 'ros2msg'):
        return False
    return _is_standard(topic.type, topic.definition)


@lru_cache(maxsize=16)
def _is_standard(name: str, definition: str) -> bool:
    return _fields(definition) == _STANDARD_FIELDS.get(name)


def _fields(definition: str) -> dict[str, tuple[str, ...]]:
    """Return the fields of each type in a definition, the first under ''."""
    found: dict[str, list[str]] = {}
    name = ''
    for line in definition.splitlines():
        words = line.partition('#')[0].split()
        if words[:1] == ['MSG:']:
            name = words[-1]
        elif len(words) == 2:
            found.setdefault(name, []).append(' '.join(words))
    return {name: tuple(fields) for name, fields in found.items()}
