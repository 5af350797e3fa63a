"""Decode messages of the types that describe a leg or a walker, many at a time."""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from klann_ros.kinematics.arrays import BoolArray, ByteArray, FloatArray, IndexArray, IntArray
from klann_ros.log import MessageBlock, Topic
from klann_ros.review.model.recording import Undecoded
from klann_ros.review.model.times import nanoseconds
from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, read_joint_state, STAMP_SIZE
import numpy as np
from numpy.typing import NDArray

CRANK_ANGLE = 'std_msgs/msg/Float64'
FOOT = 'geometry_msgs/msg/PointStamped'
JOINT_STATE = 'sensor_msgs/msg/JointState'
ODOMETRY = 'nav_msgs/msg/Odometry'
COMMAND = 'crank_command'
_XYZ = 'float64 x, float64 y, float64 z'
_POINT = {'geometry_msgs/Point': _XYZ}
_HEADER = {
    'std_msgs/Header': 'builtin_interfaces/Time stamp, string frame_id',
    'builtin_interfaces/Time': 'int32 sec, uint32 nanosec',
}
_JOINT_FIELDS = 'string[] name, float64[] position, float64[] velocity, float64[] effort'
_ODOMETRY_FIELDS = (
    'string child_frame_id, geometry_msgs/PoseWithCovariance pose, '
    'geometry_msgs/TwistWithCovariance twist'
)
_STANDARD_FIELDS = {
    CRANK_ANGLE: {'': 'float64 data'},
    FOOT: {'': 'std_msgs/Header header, Point point', **_POINT, **_HEADER},
    JOINT_STATE: {'': f'std_msgs/Header header, {_JOINT_FIELDS}', **_HEADER},
    ODOMETRY: {
        '': f'std_msgs/Header header, {_ODOMETRY_FIELDS}',
        'geometry_msgs/PoseWithCovariance': 'Pose pose, float64[36] covariance',
        # A quaternion's fields have defaults, and so are no fields here.
        'geometry_msgs/Pose': 'Point position, Quaternion orientation',
        **_POINT,
        'geometry_msgs/TwistWithCovariance': 'Twist twist, float64[36] covariance',
        'geometry_msgs/Twist': 'Vector3 linear, Vector3 angular',
        'geometry_msgs/Vector3': _XYZ,
        **_HEADER,
    },
}


class Layout(NamedTuple):
    """Offsets of the numbers in a message, and in all with equal texts and lengths."""

    data: bytes  # the message it was found in
    order: str  # the byte order of its numbers, as NumPy writes it
    is_stamped: bool  # whether it begins with a header
    names: tuple[str, ...]  # the joints in a JointState
    # Offset [bytes] and length of the number of a Float64; of x, y and z of a point; of the pose
    # of an Odometry; of positions, velocities and efforts.
    numbers: tuple[tuple[int, int], ...]
    # Indices of the bytes that all such messages share: byte order, lengths and texts; padding
    # may differ.
    fixed: IndexArray

    def alike(self, rows: ByteArray) -> BoolArray:
        """Return which messages, shape (n, size), differ in numbers only."""
        own = np.frombuffer(self.data, np.uint8)[self.fixed]
        alike: BoolArray = (rows[:, self.fixed] == own).all(axis=1)
        return alike

    def doubles(self, rows: ByteArray, which: int) -> FloatArray:
        """Return an array of doubles of matching messages, shape (n, count)."""
        begin, size = self.numbers[which]
        columns = np.ascontiguousarray(rows[:, slice(begin, begin + 8 * size)])
        return columns.view(f'{self.order}f8').astype(np.float64)

    def stamps(self, rows: ByteArray) -> IntArray:
        """Return the stamps of matching messages, shape (n,) [ns]."""
        columns = np.ascontiguousarray(rows[:, slice(HEADER_SIZE, HEADER_SIZE + STAMP_SIZE)])
        seconds = columns[:, :4].copy().view(f'{self.order}i4')[:, 0].astype(np.int64)
        stamps: IntArray = seconds * 10**9 + columns[:, 4:].copy().view(f'{self.order}u4')[:, 0]
        return stamps


# Number of strings after the stamp, and of doubles behind them.
_POINT_SIZE, _POSE_SIZE = 3, 7
_PLAIN_LAYOUTS = {FOOT: (1, _POINT_SIZE), ODOMETRY: (2, _POSE_SIZE)}


def _layout(kind: str, data: bytes) -> Layout:
    """Return the layout of a message of a standard type; a ValueError for an invalid one."""
    cursor = CdrCursor(data)
    names: tuple[str, ...] = ()
    if kind == CRANK_ANGLE:
        numbers = [(cursor.skip(8), 1)]
    elif kind == JOINT_STATE:
        joints, numbers = read_joint_state(cursor)
        names = tuple(name.decode(errors='replace') for name in joints)
    else:
        strings, count = _PLAIN_LAYOUTS[kind]
        cursor.skip(STAMP_SIZE)
        for _ in range(strings):
            cursor.string()
        cursor.align(8)
        numbers = [(cursor.skip(8 * count), count)]
    fixed = [np.arange(2), *(np.arange(part.start, part.stop) for part in cursor.structure)]
    is_stamped = kind != CRANK_ANGLE
    return Layout(data, cursor.order, is_stamped, names, tuple(numbers), np.concatenate(fixed))


@lru_cache(maxsize=16)
def _is_standard(name: str, definition: str) -> bool:
    """Return whether a type has the fields of Jazzy."""
    found: dict[str, list[str]] = {}
    part = ''
    for line in definition.splitlines():
        words = line.partition('#')[0].split()
        if words[:1] == ['MSG:']:
            part = words[-1]
        elif len(words) == 2:
            found.setdefault(part, []).append(' '.join(words))
    return {part: ', '.join(fields) for part, fields in found.items()} == _STANDARD_FIELDS[name]


# Messages of legs are much smaller; a small file may unpack to any size [bytes].
MAX_MESSAGE_SIZE = 256 * 1024
# Layouts of a topic; with more, single messages are faster.
_MAX_LAYOUTS = 16


class DecodedRows(NamedTuple):
    """Decoded messages of a topic with equal joints; arrays have n rows."""

    rows: IndexArray  # in the block
    times: IntArray  # log times [ns]
    stamps: IntArray  # of their headers [ns]; 0 for a type without
    names: tuple[str, ...]  # the joints in a JointState
    # Shape (n, k): the number; x, y and z; the pose; or the positions.
    values: FloatArray
    # Shape (n, k) or (n, 0): of a JointState.
    velocities: FloatArray
    efforts: FloatArray


class TopicReader:
    """
    Reads the messages of a topic of one of the types in _STANDARD_FIELDS.

    A definition is compared only, as to parse an untrusted one may take hours; so messages of a
    type with other fields are undecodable.
    """

    def __init__(self, topic: Topic) -> None:
        # Number of messages that do not match their type, and log time of the first [ns].
        self.failed = self.failed_at = 0
        self._topic = topic.name
        self._type = topic.type
        is_cdr = (topic.message_encoding, topic.schema_encoding) == ('cdr', 'ros2msg')
        self._is_standard = is_cdr and _is_standard(topic.type, topic.definition)
        self._layout: Layout | None = None

    def read(self, block: MessageBlock, rows: IndexArray) -> Iterator[DecodedRows]:
        """Yield the decoded messages of a block, in any order."""
        sizes = block.sizes[rows]
        # Usually all have one size.
        found = sizes[:1] if (sizes == sizes[:1]).all() else np.unique(sizes)
        for size in found.tolist():
            alike = rows if len(found) == 1 else rows[sizes == size]
            if self._is_standard and 0 < size <= MAX_MESSAGE_SIZE:
                yield from self._of_size(block, alike, size)
            else:
                self.refuse(nanoseconds(block.heads['log_time'][alike]))

    def refuse(self, times: IntArray) -> None:
        """Count undecodable messages, by their log times [ns]."""
        first = int(times.min())
        self.failed_at = min(self.failed_at, first) if self.failed else first
        self.failed += len(times)

    @property
    def undecoded(self) -> tuple[Undecoded, ...]:
        """Return the undecodable messages, if any."""
        return (Undecoded(self._topic, self.failed, self.failed_at),) if self.failed else ()

    def _of_size(self, block: MessageBlock, rows: IndexArray, size: int) -> Iterator[DecodedRows]:
        """Yield decoded messages of one size."""
        layouts = 0
        while rows.size:
            # With many layouts, single messages are faster.
            tried, layouts = rows if layouts < _MAX_LAYOUTS else rows[:1], layouts + 1
            data = block.rows(tried, size)
            layout = self._layout_for(data[0].tobytes())
            if layout is None:
                self.refuse(nanoseconds(block.heads['log_time'][rows[:1]]))
                rows = rows[1:]
                continue
            alike = layout.alike(data)
            if alike.all():
                yield _piece(block, layout, tried, data)
                rows = rows[slice(len(tried), None)]
            else:
                yield _piece(block, layout, rows[alike], data[alike])
                rows = rows[~alike]

    def _layout_for(self, data: bytes) -> Layout | None:
        known = self._layout
        if known is not None and len(data) == len(known.data):
            row = np.frombuffer(data, np.uint8)[np.newaxis]
            if known.alike(row)[0]:
                return known
        try:
            self._layout = _layout(self._type, data)
        except ValueError:
            return None
        return self._layout


def _piece(
    block: MessageBlock, layout: Layout, rows: IndexArray, data: NDArray[np.uint8]
) -> DecodedRows:
    count, times = len(rows), nanoseconds(block.heads['log_time'][rows])
    stamps = layout.stamps(data) if layout.is_stamped else np.zeros(count, dtype=np.int64)
    numbers = [layout.doubles(data, which) for which in range(len(layout.numbers))]
    numbers += [np.empty((count, 0))] * (3 - len(numbers))
    return DecodedRows(rows, times, stamps, layout.names, *numbers)
