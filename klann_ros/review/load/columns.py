"""The messages of a log as columns: each topic is read once, by its role in a review."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, Protocol

from klann_ros.kinematics.arrays import FloatArray, IndexArray, IntArray
from klann_ros.log import MessageBlock, Topic
from klann_ros.messages import ColumnReader, MAX_MESSAGE_SIZE, MessageColumns
from klann_ros.review.model.recording import Mismatch, Undecoded
from klann_ros.review.model.times import Series
import numpy as np
from numpy.typing import NDArray

from .roles import COMMAND, place_of, reading_of, REQUIRED_ROLES, Role, type_of
from .topics import GrowingArray, Reception

# Longest description that is read [characters], and bytes of its message beside the text.
MAX_DESCRIPTION_SIZE = 1024 * 1024
_MESSAGE_OVERHEAD = 16
# Different descriptions of a topic that are read, and measured points.
_MAX_DESCRIPTIONS = 32
_MAX_MEASURED = 20_000
# Changes of the topic over which numbers of publishers never increase throughout.
_MIN_SWITCHES = 20
# Cranks that commands without names are read for.
_MAX_CRANKS = 64


class JointSelection(NamedTuple):
    """The joints of JointStates with equal names that a review keeps."""

    names: tuple[str, ...]
    # Those whose efforts are kept, too.
    drives: tuple[str, ...]
    # Whether the stamp is to be that of an answer, and not one of an answer itself.
    is_input: bool


class JointSelector(Protocol):
    """Chooses the joints of legs and walkers."""

    def selection(self, topic: str, names: Sequence[str]) -> JointSelection:
        """Return the joints that are kept of JointStates on a topic."""

    def lacks_positions(self, topic: str, names: Sequence[str], count: int) -> bool:
        """Return whether JointStates with a number of positions lack those of a leg."""


class Part:
    """
    Messages of a topic with equal names, and the numbers that are kept of them.

    An input without a stamp has its publish time as the stamp, or the log time if unknown.
    """

    def __init__(self, topic: str, role: Role, selection: JointSelection) -> None:
        self.topic = topic
        self.namespace, self.last_name = place_of(topic)
        self.role = role
        self.selection = selection
        self._times = GrowingArray(np.int64)  # log times [ns]
        self._stamps = GrowingArray(np.int64)  # [ns]
        self._unstamped = GrowingArray(np.bool_)
        # By fields, shape (n, k).
        self._numbers: dict[str, GrowingArray] = {}

    def __len__(self) -> int:
        return len(self._times)

    def add(
        self,
        block: MessageBlock,
        rows: IndexArray,
        stamps: IntArray,
        numbers: Mapping[str, NDArray[Any]],
    ) -> None:
        """Add messages of a block, with their stamps [ns] and numbers."""
        times = block.log_times[rows]
        is_unstamped = stamps == 0
        if self.selection.is_input and is_unstamped.any():
            published = block.publish_times[rows]
            sources = np.where(published > 0, published, times)
            stamps = np.where(is_unstamped, sources, stamps)
        self._times.add(times)
        self._stamps.add(stamps)
        self._unstamped.add(is_unstamped)
        for path, columns in numbers.items():
            if path not in self._numbers:
                self._numbers[path] = GrowingArray(columns.dtype, columns.shape[1])
            self._numbers[path].add(columns)

    @property
    def times(self) -> IntArray:
        """Return the log times [ns]; nothing can be added any more."""
        return self._times.array()

    @property
    def stamps(self) -> IntArray:
        """Return the stamps [ns]."""
        return self._stamps.array()

    @property
    def unstamped(self) -> NDArray[np.bool_]:
        """Return which messages had no stamp."""
        return self._unstamped.array()

    @property
    def paths(self) -> Collection[str]:
        """Return the fields whose numbers there are."""
        return self._numbers.keys()

    def numbers(self, joints: Sequence[str] = (), path: str = '') -> FloatArray:
        """Return the numbers of a field, of all joints by default, shape (n, k)."""
        numbers = self._numbers[path].array()
        names = self.selection.drives if path == 'effort' else self.selection.names
        if not joints or tuple(joints) == names:
            return numbers
        columns = [names.index(joint) for joint in joints]
        begin = columns[0]
        end = begin + len(columns)
        # No copy where they are side by side, as those of a walker's leg.
        return numbers[:, begin:end] if columns == [*range(begin, end)] else numbers[:, columns]

    def series(self, joints: Sequence[str] = (), path: str = '') -> Series:
        """Return these numbers by their log times."""
        return Series(self.times, self.stamps, self.numbers(joints, path))


# The selections of topics without joints.
_AN_INPUT = JointSelection((), (), is_input=True)
_NO_INPUT = JointSelection((), (), is_input=False)
_INPUTS = (Role.ANGLE, Role.TICKS, Role.MEASURED)


class _TopicColumns:
    """
    The messages of a topic: their reception, and what a review keeps of them.

    `rate_kind` is the type of the joint velocities; '' for none.
    """

    def __init__(self, topic: Topic, joints: JointSelector, rate_kind: str) -> None:
        self.topic = topic.name
        self.encoding = topic.message_encoding
        reading = reading_of(topic)
        self.role = reading and reading.role
        # By the names in messages, and the fields with a number of each.
        self.parts: dict[tuple[tuple[str, ...], tuple[str, ...]], Part] = {}
        # Log times [ns] and contents of texts and reports.
        self.contents: list[tuple[int, dict[str, Any]]] = []
        # Number of messages that do not match their type, and log time of the first [ns].
        self._refused: dict[Mismatch, tuple[int, int]] = {}
        self._joints = joints
        self._rate_kind = rate_kind
        self.is_command = place_of(topic.name)[1] == COMMAND
        self._last_text = b''
        self._reader: ColumnReader | None = None
        if reading is not None and topic.message_encoding == 'cdr':
            self._type = type_of(topic)
            self._is_read_in_bulk = reading.paths is not None
            if self._type.is_defined_by(topic.definition, topic.schema_encoding):
                names = 'name' if self.role is Role.JOINTS else ''
                self._reader = ColumnReader(self._type, reading.paths or (), names)

    def add(self, block: MessageBlock, rows: IndexArray) -> None:
        """Add the topic's messages in a block."""
        if self.role is None:
            return
        if self._reader is None:
            is_cdr = self.encoding == 'cdr'
            reason = Mismatch.DEFINITION if is_cdr else Mismatch.ENCODING
            self._refuse(block, reason, rows)
        elif not self._is_read_in_bulk:
            self._add_contents(block, rows)
        else:
            for columns in self._reader.read(
                block, rows, partial(self._refuse, block, Mismatch.CONTENT)
            ):
                if self.role is Role.JOINTS:
                    self._add_joints(block, columns)
                else:
                    self._add_numbers(block, columns, self.role)

    def undecoded(self) -> Iterator[Undecoded]:
        """Yield the undecodable messages, if any."""
        if self.role in REQUIRED_ROLES:
            for reason, (count, time) in self._refused.items():
                yield Undecoded(self.topic, self.encoding, reason, count, time)

    def _refuse(self, block: MessageBlock, reason: Mismatch, rows: IndexArray) -> None:
        time = int(block.log_times[rows].min())
        count, first_time = self._refused.get(reason, (0, time))
        self._refused[reason] = count + len(rows), min(time, first_time)

    def _add_contents(self, block: MessageBlock, rows: IndexArray) -> None:
        """Add texts or reports; a text is usually repeated."""
        is_text = self.role is Role.DESCRIPTION
        max_size = MAX_DESCRIPTION_SIZE + _MESSAGE_OVERHEAD if is_text else MAX_MESSAGE_SIZE
        for row in rows[block.sizes[rows] <= max_size].tolist():
            data = block.message(row)
            is_left_out = data == self._last_text or len(self.contents) >= _MAX_DESCRIPTIONS
            if is_text and is_left_out:
                continue
            self._last_text = data
            with suppress(ValueError):
                content = self._type.read(data)
                content = _CONTENTS.get(self.role, dict)(content)
                if content:
                    self.contents.append((int(block.log_times[row]), content))

    def _add_numbers(self, block: MessageBlock, columns: MessageColumns, role: Role) -> None:
        """Add numbers without names, such as angles and points, to the part of their topic."""
        selection = _AN_INPUT if role in _INPUTS else _NO_INPUT
        selected = {}
        for numbers in columns.numbers.values():
            selected[''] = _planar(numbers) if role is Role.BODY else numbers[:, :2]
            if role is Role.ARRAY and numbers.shape[1] > _MAX_CRANKS:
                return
            if role is Role.ARRAY:
                selected[''] = numbers
                joints = tuple(map(str, range(numbers.shape[1])))
                selection = JointSelection(joints, (), is_input=False)
        key = (selection.names, ())
        if key not in self.parts:
            self.parts[key] = Part(self.topic, role, selection)
        part = self.parts[key]
        rows = columns.rows
        stamps = columns.stamps
        if role is Role.MEASURED:
            new = slice(max(0, _MAX_MEASURED - len(part)))
            rows = rows[new]
            stamps = stamps[new]
            selected[''] = selected[''][new]
        part.add(block, rows, stamps, selected)

    def _add_joints(self, block: MessageBlock, columns: MessageColumns) -> None:
        """Add the selected joints of JointStates to the part of their names."""
        names = columns.names
        numbers = {
            path: columns_of_path
            for path, columns_of_path in columns.numbers.items()
            if columns_of_path.shape[1] == len(names)
        }
        if 'position' not in numbers and not (self.is_command and 'velocity' in numbers):
            count = columns.numbers['position'].shape[1]
            if self._joints.lacks_positions(self.topic, names, count):
                self._refuse(block, Mismatch.NO_POSITIONS, columns.rows)
            return
        key = (names, tuple(numbers))
        if key not in self.parts:
            selection = self._joints.selection(self.topic, names)
            self.parts[key] = Part(self.topic, Role.JOINTS, selection)
        part = self.parts[key]
        selection = part.selection
        selected = {}
        if 'position' in numbers:
            selected['position'] = _selected(numbers['position'], names, selection.names)
        if 'effort' in numbers and selection.drives:
            selected['effort'] = _selected(numbers['effort'], names, selection.drives)
        rate_kind = 'f8' if self.is_command else self._rate_kind
        if rate_kind:
            unknown = np.full((len(columns.rows), len(names)), np.nan)
            rates = _selected(numbers.get('velocity', unknown), names, selection.names)
            with np.errstate(over='ignore'):
                selected['velocity'] = rates.astype(rate_kind)
        if selection.names:
            part.add(block, columns.rows, columns.stamps, selected)


def _selected(numbers: FloatArray, names: Sequence[str], joints: Sequence[str]) -> FloatArray:
    """Return the columns of some joints, the first with each name."""
    if names == joints:
        return numbers
    return numbers[:, [names.index(name) for name in joints]]


def _planar(poses: FloatArray) -> FloatArray:
    """Return x, y and yaw of poses, shape (n, 7) [m, rad]."""
    x, y, _, qx, qy, qz, qw = poses.T
    # As `yaw_of`: for quaternions of any norm.
    yaw = np.arctan2(2.0 * (qx * qy + qw * qz), qw * qw + qx * qx - qy * qy - qz * qz)
    return np.column_stack([x, y, yaw])


def _iterations(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the solver iterations in a report, by the names of its parts."""
    return {
        status['name']: float(pair['value'])
        for status in report['status']
        for pair in status['values']
        if pair['key'] == 'iterations'
    }


def _plan(trajectory: Mapping[str, Any]) -> dict[str, Any]:
    """Return the joints of a trajectory, its times [ns] and positions; a ValueError without."""
    points = trajectory['points']
    joints = tuple(trajectory['joint_names'])
    times = [_nanoseconds(point, 'time_from_start') for point in points]
    positions = np.array([point['positions'] for point in points])
    return {
        'start': _nanoseconds(trajectory, 'header.stamp'),
        'joints': joints,
        'times': np.array(times, dtype=np.int64),
        'positions': positions.reshape(len(points), len(joints)),
    }


def _nanoseconds(message: Mapping[str, Any], path: str) -> int:
    return int(message[f'{path}.sec'] * 10**9 + message[f'{path}.nanosec'])


# Readers of contents.
_CONTENTS: dict[Role | None, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    Role.REPORT: _iterations,
    Role.TRAJECTORY: _plan,
}


class LogColumns:
    """The topics of a log: their reception by name and type, and their parts."""

    def __init__(self, joints: JointSelector, rate_kind: str) -> None:
        self.receptions: dict[tuple[str, str], Reception] = {}
        self._topics: dict[Topic, _TopicColumns] = {}
        self._joints = joints
        self._rate_kind = rate_kind

    def add(self, block: MessageBlock) -> None:
        """Add the messages of a block."""
        times = block.log_times
        published = block.publish_times
        numbers = block.heads['sequence'].astype(np.int64)
        switches = np.count_nonzero(np.diff(block.heads['channel']))
        if switches >= _MIN_SWITCHES and (np.diff(numbers) > 0).all():
            numbers[:] = 0  # Those of the file are not those of publishers.
        for topic, rows in _by_topic(block):
            if topic not in self._topics:
                self._topics[topic] = _TopicColumns(topic, self._joints, self._rate_kind)
            # The files of a split run may have different profiles of a topic.
            key = (topic.name, topic.type)
            if key not in self.receptions:
                self.receptions[key] = Reception()
            self.receptions[key].add(topic.qos, times[rows], published[rows], numbers[rows])
            self._topics[topic].add(block, rows)

    def parts(self, *roles: Role) -> Iterator[Part]:
        """Yield the parts of the topics with some roles."""
        for topic in self._topics.values():
            if topic.role in roles:
                yield from topic.parts.values()

    def contents(self, role: Role) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """Yield the topic, the log time [ns] and the content of each text or report."""
        for topic in self._topics.values():
            if topic.role is role:
                for time, content in topic.contents:
                    yield topic.topic, time, content

    def joints(self) -> dict[str, tuple[str, ...]]:
        """Return the joints on each topic of JointStates, without those of commands."""
        names: dict[str, dict[str, None]] = defaultdict(dict)
        for topic in self._topics.values():
            if topic.role is Role.JOINTS and not topic.is_command:
                for part_names, _ in topic.parts:
                    names[topic.topic].update(dict.fromkeys(part_names))
        return {topic: tuple(joints) for topic, joints in names.items()}

    def undecoded(self) -> Iterator[Undecoded]:
        """Yield the topics of legs and walkers with undecodable messages."""
        for topic in self._topics.values():
            yield from topic.undecoded()


def _by_topic(block: MessageBlock) -> Iterator[tuple[Topic, IndexArray]]:
    """Yield the known topics of a block, with the rows of their messages."""
    channels = block.heads['channel']
    order = np.argsort(channels, kind='stable')
    ordered = channels[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    for channel, rows in zip(ordered[begins].tolist(), np.split(order, begins[1:]), strict=False):
        topic = block.topics.get(channel)
        if topic is not None:
            yield topic, rows
