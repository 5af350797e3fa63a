"""What a run says of a robot that walks: odometry, ground truth, and commands of its cranks."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import partial

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.recording import Series, Undecoded, Walk
from klann_ros.review.model.times import Floats, RowIndices
import numpy as np

from .columns import SeriesColumns, Shared
from .gathering import COMMAND, log_times
from .layouts import JOINT_STATE, ODOMETRY
from .pieces import DecodedRows, TopicReader

STATE = 'crank_state'
_TOLD, _TRUTH = 'odom', 'ground_truth'


class Walks:
    """Gathers what blocks say of walking robots, by their namespaces."""

    def __init__(self) -> None:
        self._poses: dict[tuple[str, str], SeriesColumns] = defaultdict(partial(SeriesColumns, 3))
        self._cranks: dict[tuple[str, str, str], SeriesColumns] = defaultdict(
            partial(SeriesColumns, 1)
        )
        self._readers: dict[Topic, TopicReader] = {}

    def add(
        self, topic: Topic, block: MessageBlock, rows: RowIndices, pieces: Iterable[DecodedRows]
    ) -> None:
        """Add what a topic's messages in a block say; joint states are decoded already."""
        space, _, name = topic.name.rpartition('/')
        if topic.type == ODOMETRY and name in (_TOLD, _TRUTH):
            if topic not in self._readers:
                self._readers[topic] = TopicReader(topic)
            for piece in self._readers[topic].read(block, rows):
                poses = _planar(piece.values)
                known = np.isfinite(poses).all(axis=1)
                times = log_times(block, piece)
                self._poses[space, name].add(times[known], piece.stamps[known], poses[known])
        elif topic.type == JOINT_STATE and name in (COMMAND, STATE):
            for piece in pieces:
                self._add_cranks(space, name, block, piece)

    def _add_cranks(self, space: str, name: str, block: MessageBlock, piece: DecodedRows) -> None:
        if len(piece.names) != piece.values.shape[1]:
            return
        times = log_times(block, piece)
        for k, joint in enumerate(piece.names):
            column = piece.values[:, slice(k, k + 1)]
            known = np.isfinite(column[:, 0])
            self._cranks[space, name, joint].add(times[known], piece.stamps[known], column[known])

    def walks(self, shared: Shared) -> Iterator[Walk]:
        """Yield the robots that tell where they are, or what their cranks are to do."""
        poses = {
            place: _unwrapped(columns.series(shared)) for place, columns in self._poses.items()
        }
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
        return tuple(
            Undecoded(topic.name, reader.failed, reader.failed_at)
            for topic, reader in self._readers.items()
            if reader.failed
        )


def _planar(poses: Floats) -> Floats:
    """Return x, y and yaw of poses, shape (n, 7) [m, rad]."""
    x, y, _, qx, qy, qz, qw = poses.T
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return np.column_stack([x, y, yaw])


def _unwrapped(poses: Series) -> Series:
    """Return poses whose yaw goes on where it goes around."""
    x, y, yaw = poses.values.T
    values = np.column_stack([x, y, np.unwrap(yaw)])
    return Series(poses.times, poses.stamps, values)
