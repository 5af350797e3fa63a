"""Decode messages of the types that describe a leg or a walker, many at a time."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr
from functools import lru_cache
from io import StringIO
from itertools import chain
import re
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import BoolArray, ByteArray, FloatArray, IndexArray, IntArray
from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.times import LAST_TIME, nanoseconds
from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, read_joint_state, STAMP_SIZE
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from numpy.typing import NDArray

CRANK_ANGLE = 'std_msgs/msg/Float64'
FOOT = 'geometry_msgs/msg/PointStamped'
JOINT_STATE = 'sensor_msgs/msg/JointState'
ODOMETRY = 'nav_msgs/msg/Odometry'
COMMAND = 'crank_command'
# Position, and orientation as a quaternion.
POSE = 7


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
    """An array of doubles in a message: its offset [bytes] and length."""

    begin: int
    size: int

    @property
    def end(self) -> int:
        """Return its end [bytes]."""
        return self.begin + 8 * self.size


class Layout(NamedTuple):
    """Offsets of the numbers in a message, and in all with equal texts and lengths."""

    # The message it was found in.
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
        begin, end = self.numbers[which].begin, self.numbers[which].end
        columns = np.ascontiguousarray(rows[:, slice(begin, end)])
        return columns.view(f'{self.order}f8').astype(np.float64)

    def stamps(self, rows: ByteArray) -> IntArray:
        """Return the stamps of matching messages, shape (n,) [ns]."""
        columns = np.ascontiguousarray(rows[:, slice(HEADER_SIZE, HEADER_SIZE + STAMP_SIZE)])
        seconds = columns[:, :4].copy().view(f'{self.order}i4')[:, 0].astype(np.int64)
        stamps: IntArray = seconds * 10**9 + columns[:, 4:].copy().view(f'{self.order}u4')[:, 0]
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
"""Functions that find the layout of a message, by type; a ValueError for an invalid one."""


def has_standard_fields(topic: Topic) -> bool:
    """Return whether a topic has CDR messages with the fields of Jazzy."""
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


# Messages of legs are much smaller; a small file may unpack to any size [bytes].
MAX_MESSAGE = 256 * 1024
# A DiagnosticArray's has 600 characters without comments.
MAX_DEFINITION = 16 * 1024

_COMMENT = re.compile('#[^\r\n]*')
Decode = Callable[[bytes], Any]


def decoder(topic: Topic) -> Decode:
    """
    Return the decoder of a topic's messages; it may raise anything.

    Definitions are untrusted: the library prints what it cannot parse, and needs quadratic time
    for many comments and fields. So it gets no comments, no long definition, and no terminal.
    """
    return _decoder(topic.type, topic.definition, topic.schema_encoding, topic.message_encoding)


@lru_cache(maxsize=16)
def _decoder(name: str, definition: str, schema_encoding: str, encoding: str) -> Decode:
    text = _COMMENT.sub('', definition)
    if len(text) > MAX_DEFINITION:
        return _refuse
    schema = Schema(id=1, data=text.encode(), encoding=schema_encoding, name=name)
    try:
        with redirect_stderr(StringIO()):
            decode = DecoderFactory().decoder_for(encoding, schema)
    except Exception:  # noqa: BLE001, RUF100 - the text may be anything
        decode = None
    if decode is None:
        return _refuse

    def bounded(data: bytes) -> Any:
        if len(data) > MAX_MESSAGE:
            raise ValueError(f'{len(data)} bytes, more than the limit of {MAX_MESSAGE}')
        return decode(data)

    return bounded


def _refuse(_: bytes) -> Any:
    raise ValueError('no decoder for this topic')


# Layouts of a topic; with more, single messages are faster.
_MAX_LAYOUTS = 16


class DecodedRows(NamedTuple):
    """Decoded messages of a topic with equal joints."""

    # Shape (n,): their rows in the block.
    rows: IndexArray
    # Shape (n,): their header stamps [ns]; 0 for a type without.
    stamps: IntArray
    # The joints in a JointState.
    names: tuple[str, ...]
    # Shape (n, k): the number; x, y and z; the pose; or the positions.
    values: FloatArray
    # Shape (n, k) or (n, 0): the velocities of a JointState.
    velocities: FloatArray
    # Shape (n, k) or (n, 0): the efforts of a JointState.
    efforts: FloatArray


class TopicReader:
    """
    Reads the messages of a topic of one of LAYOUTS's types.

    Attributes
    ----------
    failed : int
        Number of messages that do not match their type.
    failed_at : int
        Log time of the first of them [ns].

    """

    def __init__(self, topic: Topic) -> None:
        self.failed = 0
        self.failed_at = 0
        self._type = topic.type
        self._make_layout = LAYOUTS[topic.type] if has_standard_fields(topic) else None
        self._layout: Layout | None = None
        self._decode = decoder(topic)

    def read(self, block: MessageBlock, rows: IndexArray) -> Iterator[DecodedRows]:
        """Yield the decoded messages of a block, in any order."""
        others: list[IndexArray] = []
        sizes = block.sizes[rows]
        # Usually all have one size.
        found = sizes[:1] if (sizes == sizes[:1]).all() else np.unique(sizes)
        for size in found.tolist():
            alike = rows if len(found) == 1 else rows[sizes == size]
            yield from self._of_size(block, alike, size, others)
        for row in chain.from_iterable(others):
            try:
                yield self._one(block, row)
            except Exception:  # noqa: BLE001, PERF203, RUF100 - the bytes may be anything
                self.refuse(nanoseconds(block.heads['log_time'][[row]]))

    def refuse(self, times: IntArray) -> None:
        """Count undecodable messages, by their log times [ns]."""
        first = int(times.min())
        self.failed_at = min(self.failed_at, first) if self.failed else first
        self.failed += len(times)

    def _of_size(
        self, block: MessageBlock, rows: IndexArray, size: int, others: list[IndexArray]
    ) -> Iterator[DecodedRows]:
        """Yield decoded messages of one size; add those without a layout to `others`."""
        for _ in range(_MAX_LAYOUTS):
            if not rows.size or not size:
                break
            data = block.rows(rows, size)
            layout = self._layout_for(data[0].tobytes())
            if layout is None:
                others.append(rows[:1])
                rows = rows[1:]
                continue
            alike = layout.alike(data)
            if alike.all():
                yield _piece(layout, rows, data)
                return
            yield _piece(layout, rows[alike], data[alike])
            rows = rows[~alike]
        others.append(rows)

    def _layout_for(self, data: bytes) -> Layout | None:
        known = self._layout
        if known is not None and len(data) == len(known.data):
            row = np.frombuffer(data, np.uint8)[np.newaxis]
            if known.alike(row)[0]:
                return known
        if self._make_layout is None:
            return None
        try:
            self._layout = self._make_layout(data)
        except ValueError:
            return None
        return self._layout

    def _one(self, block: MessageBlock, row: int) -> DecodedRows:
        """Return one message, decoded by the library for all types."""
        decoded = self._decode(block.message(row))
        stamp, names, values, velocities, efforts = _FIELDS[self._type](decoded)
        return DecodedRows(
            np.array([row]),
            np.array([min(max(stamp, -LAST_TIME), LAST_TIME)]),
            tuple(map(str, names)),
            np.array([values], dtype=np.float64),
            np.array([velocities], dtype=np.float64),
            np.array([efforts], dtype=np.float64),
        )


def _piece(layout: Layout, rows: IndexArray, data: NDArray[np.uint8]) -> DecodedRows:
    count = len(rows)
    stamps = layout.stamps(data) if layout.is_stamped else np.zeros(count, dtype=np.int64)
    joints = len(layout.numbers) > 1
    others = [layout.doubles(data, which) if joints else np.empty((count, 0)) for which in (1, 2)]
    return DecodedRows(rows, stamps, layout.names, layout.doubles(data, 0), *others)


def _stamp(decoded: Any) -> int:
    stamp = decoded.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _point(decoded: Any) -> tuple[float, ...]:
    return tuple(float(getattr(decoded.point, axis)) for axis in 'xyz')


def _pose(decoded: Any) -> tuple[float, ...]:
    at, turned = decoded.pose.pose.position, decoded.pose.pose.orientation
    return (
        *(float(getattr(at, axis)) for axis in 'xyz'),
        *(float(getattr(turned, axis)) for axis in 'xyzw'),
    )


# Stamp, names, values, velocities and efforts.
_FIELDS: dict[str, Callable[[Any], tuple[int, Any, Any, Any, Any]]] = {
    CRANK_ANGLE: lambda decoded: (0, (), (float(decoded.data),), (), ()),
    FOOT: lambda decoded: (_stamp(decoded), (), _point(decoded), (), ()),
    ODOMETRY: lambda decoded: (_stamp(decoded), (), _pose(decoded), (), ()),
    JOINT_STATE: lambda decoded: (
        _stamp(decoded),
        decoded.name,
        tuple(decoded.position),
        tuple(decoded.velocity),
        tuple(decoded.effort),
    ),
}


def log_times(block: MessageBlock, piece: DecodedRows) -> IntArray:
    """Return the log times of decoded messages [ns]."""
    return nanoseconds(block.heads['log_time'][piece.rows])
