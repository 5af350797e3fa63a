"""What a run says of a robot that walks: odometry, ground truth, and commands of its cranks."""

from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from math import atan2

from klann_ros.log.reading.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.recording import Series, Undecoded, Walk
from klann_ros.review.model.times import nanoseconds, RowIndices
from klann_ros.untrusted.cdr import CdrCursor, STAMP_SIZE
import numpy as np

from .columns import SeriesColumns, Shared
from .gathering import COMMAND
from .layouts import JOINT_STATE
from .pieces import TopicReader
from .solvers import parent

ODOMETRY = 'nav_msgs/msg/Odometry'
STATE = 'crank_state'
_TOLD, _TRUTH = 'odom', 'ground_truth'
# Position and orientation.
_POSE = 7


class Walks:
    """Gathers what blocks say of walking robots, by their namespaces."""

    def __init__(self) -> None:
        self._poses: dict[tuple[str, str], SeriesColumns] = defaultdict(partial(SeriesColumns, 3))
        self._cranks: dict[tuple[str, str, str], SeriesColumns] = defaultdict(
            partial(SeriesColumns, 1)
        )
        self._readers: dict[Topic, TopicReader] = {}
        self._refused: dict[str, tuple[int, int]] = {}

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> None:
        """Add what a topic's messages in a block say."""
        name = topic.name.rpartition('/')[2]
        if topic.type == ODOMETRY and name in (_TOLD, _TRUTH):
            self._add_poses(topic.name, name, block, rows)
        elif topic.type == JOINT_STATE and name in (COMMAND, STATE):
            reader = self._readers.setdefault(topic, TopicReader(topic))
            for piece in reader.read(block, rows):
                if len(piece.names) != piece.values.shape[1]:
                    continue
                times = nanoseconds(block.heads['log_time'][piece.rows])
                for k, joint in enumerate(piece.names):
                    place = (parent(topic.name), name, joint)
                    column = piece.values[:, slice(k, k + 1)]
                    known = np.isfinite(column[:, 0])
                    self._cranks[place].add(times[known], piece.stamps[known], column[known])

    def walks(self, shared: Shared) -> Iterator[Walk]:
        """Yield the robots that tell where they are, or what their cranks are to do."""
        poses = {place: columns.series(shared) for place, columns in self._poses.items()}
        cranks = {place: columns.series(shared) for place, columns in self._cranks.items()}
        commanded = {space for space, name, _ in cranks if name == COMMAND}
        nothing = Series(
            np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty((0, 3))
        )
        for space in sorted({space for space, _ in poses} | commanded):
            of_name = {
                name: {joint: s for (at, which, joint), s in cranks.items() if (at, which) == one}
                for name, one in ((name, (space, name)) for name in (COMMAND, STATE))
            }
            yield Walk(
                space,
                poses.get((space, _TOLD), nothing),
                poses.get((space, _TRUTH), nothing),
                of_name[COMMAND],
                of_name[STATE],
            )

    def undecoded(self) -> tuple[Undecoded, ...]:
        """Return what could not be decoded."""
        return tuple(Undecoded(name, count, time) for name, (count, time) in self._refused.items())

    def _add_poses(self, topic: str, name: str, block: MessageBlock, rows: RowIndices) -> None:
        found, kept = [], []
        for row in rows.tolist():
            try:
                found.append(_pose(block.message(row)))
                kept.append(row)
            except ValueError:  # noqa: PERF203, RUF100 - the bytes may be anything
                time = int(nanoseconds(block.heads['log_time'][[row]])[0])
                count, first = self._refused.get(topic, (0, time))
                self._refused[topic] = count + 1, first
        if not kept:
            return
        stamps = np.array([stamp for stamp, *_ in found], dtype=np.int64)
        values = np.array([pose for _, *pose in found], dtype=np.float64)
        known = np.isfinite(values).all(axis=1)
        times = nanoseconds(block.heads['log_time'][kept])
        values[:, 2] = np.unwrap(values[:, 2])
        self._poses[parent(topic), name].add(times[known], stamps[known], values[known])


def _pose(data: bytes) -> tuple[int, float, float, float]:
    """Return stamp [ns], x, y and yaw of an Odometry message [m, rad]."""
    cursor = CdrCursor(data)
    at = cursor.skip(STAMP_SIZE)
    numbers = np.dtype([('s', f'{cursor.order}i4'), ('ns', f'{cursor.order}u4')])
    seconds, nanos = np.frombuffer(data, numbers, 1, at)[0].tolist()
    cursor.string()
    cursor.string()
    cursor.align(8)
    begin = cursor.skip(8 * _POSE)
    x, y, _, qx, qy, qz, qw = np.frombuffer(data, f'{cursor.order}f8', _POSE, begin).tolist()
    yaw = atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return seconds * 10**9 + nanos, x, y, yaw
