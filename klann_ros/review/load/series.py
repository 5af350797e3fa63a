"""Collect series block by block: solver iterations, /clock and walkers."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
import struct
from typing import Any

from klann_ros.calibration import load
from klann_ros.kinematics.arrays import FloatArray, IndexArray, IntArray
from klann_ros.log import MessageBlock, Topic
from klann_ros.review.model.recording import WalkRecording
from klann_ros.review.model.times import CLOCK, nanoseconds, no_series, Series
from klann_ros.sanitize.cdr import CdrCursor
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from .decode import COMMAND, DecodedRows, JOINT_STATE, MAX_MESSAGE_SIZE, ODOMETRY

_INITIAL_ROWS = 1024
# Measured points of a topic that a review reads.
MAX_MEASURED = 20_000


class GrowingArray:
    """An array that grows by rows of `width` numbers, 0 for rows that are numbers themselves."""

    def __init__(self, kind: DTypeLike, width: int = 0) -> None:
        self._columns = (width,) if width else ()
        self._rows: NDArray[Any] = np.empty((_INITIAL_ROWS, *self._columns), dtype=kind)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, rows: ArrayLike) -> None:
        """Append rows."""
        new = np.asarray(rows)
        begin, self._count = self._count, self._count + len(new)
        if self._count > len(self._rows):
            # realloc moves pages, not bytes: half the memory of joined arrays.
            room = max(self._count, len(self._rows) * 3 // 2)
            self._rows.resize((room, *self._columns), refcheck=False)
        self._rows[slice(begin, self._count)] = new

    def array(self) -> NDArray[Any]:
        """Return all rows; nothing can be added any more."""
        self._rows.resize((self._count, *self._columns), refcheck=False)
        return self._rows


class ArrayPool:
    """Shares equal arrays of times, which saves memory."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int, int], list[IntArray]] = {}

    def one(self, times: IntArray) -> IntArray:
        """Return an array with these times."""
        if not len(times):
            return times
        alike = self._known.setdefault((len(times), int(times[0]), int(times[-1])), [])
        for known in alike:
            if np.array_equal(known, times):
                return known
        alike.append(times)
        return times


class SeriesColumns:
    """Builds a series of log times, stamps and rows of numbers, block by block."""

    def __init__(self, width: int, kind: DTypeLike = np.float64) -> None:
        self._times = GrowingArray(np.int64)
        self._stamps = GrowingArray(np.int64)
        self._values = GrowingArray(kind, width)

    def add(self, times: IntArray, stamps: IntArray, values: FloatArray) -> None:
        """Add log times and stamps [ns], shape (n,), and values, shape (n, width)."""
        self._times.add(times)
        self._stamps.add(stamps)
        self._values.add(values)

    def series(self, shared: ArrayPool) -> Series:
        """Return all rows by their log times; nothing can be added any more."""
        times, stamps, values = (
            column.array() for column in (self._times, self._stamps, self._values)
        )
        if (np.diff(times) < 0).any():
            order = np.argsort(times, kind='stable')
            times, stamps, values = times[order], stamps[order], values[order]
        return Series(shared.one(times), shared.one(stamps), values)


class PointCollector:
    """Collects points that somebody measured, by their topics; computed ones are left out."""

    def __init__(self) -> None:
        self._columns: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        self._counts: dict[str, int] = defaultdict(int)

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add a topic's messages in a block, up to a number of each topic."""
        last = topic.name.rpartition('/')[2]
        is_point = topic.type in load.POINT_LAYOUTS and topic.type not in load.FRAMED_TYPES
        if not is_point or last in load.COMPUTED_TOPICS:
            return
        rows = rows[: max(0, MAX_MEASURED - self._counts[topic.name])]
        self._counts[topic.name] += len(rows)
        for row in rows.tolist():
            with suppress(ValueError, struct.error):
                for _, stamp, values, _ in load.readings(topic.type, block.message(row)):
                    time = nanoseconds(block.heads['log_time'][[row]])
                    stamps = np.array([stamp or time[0]])
                    self._columns[topic.name].add(time, stamps, np.array([values]))

    def series(self, shared: ArrayPool) -> dict[str, Series]:
        """Return the points by topic."""
        return {name: columns.series(shared) for name, columns in self._columns.items()}


STATE = 'crank_state'
# Names of odometry and ground truth.
ODOMETRY_TOPICS = ('odom', 'ground_truth')


class WalkCollector:
    """Collects the data of walkers, by their namespaces."""

    def __init__(self) -> None:
        self._poses: dict[tuple[str, str], SeriesColumns] = defaultdict(partial(SeriesColumns, 3))
        self._cranks: dict[tuple[str, str, str], SeriesColumns] = defaultdict(
            partial(SeriesColumns, 1)
        )

    def add(self, topic: Topic, pieces: Iterable[DecodedRows]) -> None:
        """Add decoded messages of a topic."""
        space, _, name = topic.name.rpartition('/')
        if topic.type == ODOMETRY:
            for piece in pieces:
                poses = _planar(piece.values)
                known, columns = np.isfinite(poses).all(axis=1), self._poses[space, name]
                columns.add(piece.times[known], piece.stamps[known], poses[known])
        elif topic.type == JOINT_STATE and name in (COMMAND, STATE):
            for piece in pieces:
                has_positions = len(piece.names) == piece.values.shape[1]
                for k, joint in enumerate(piece.names if has_positions else ()):
                    column, columns = piece.values[:, [k]], self._cranks[space, name, joint]
                    known = np.isfinite(column[:, 0])
                    columns.add(piece.times[known], piece.stamps[known], column[known])

    def walks(self, shared: ArrayPool) -> Iterator[WalkRecording]:
        """Yield the robots with odometry, ground truth or crank commands."""
        poses = {
            place: _unwrapped(columns.series(shared)) for place, columns in self._poses.items()
        }
        cranks = {place: columns.series(shared) for place, columns in self._cranks.items()}
        commanded = {space for space, name, _ in cranks if name == COMMAND}
        for space in sorted({space for space, _ in poses} | commanded):
            commands, states = (
                {joint: s for (*at, joint), s in cranks.items() if at == [space, name]}
                for name in (COMMAND, STATE)
            )
            odometry, truth = (poses.get((space, name), no_series(3)) for name in ODOMETRY_TOPICS)
            yield WalkRecording(space, odometry, truth, commands, states)


def _planar(poses: FloatArray) -> FloatArray:
    """Return x, y and yaw of poses, shape (n, 7) [m, rad]."""
    x, y, _, qx, qy, qz, qw = poses.T
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return np.column_stack([x, y, yaw])


def _unwrapped(poses: Series) -> Series:
    x, y, yaw = poses.values.T
    values = np.column_stack([x, y, np.unwrap(yaw)])
    return Series(poses.times, poses.stamps, values)


DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# Name of an unnamed leg in diagnostics.
_UNNAMED = 'leg'


class IterationCollector:
    """Collects solver iterations from diagnostics: the maximum since the last report."""

    def __init__(self) -> None:
        self._columns: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 1))
        self._solvers: dict[str, set[str]] = defaultdict(set)

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add the messages of a topic in a block."""
        if topic.type != DIAGNOSTICS:
            return
        for row in rows[block.sizes[rows] <= MAX_MESSAGE_SIZE].tolist():
            time = nanoseconds(block.heads['log_time'][[row]])
            # Invalid messages are ignored.
            with suppress(ValueError):
                for name, most in _iterations(block.message(row)):
                    solver, _, leg = name.rpartition(': ')
                    if solver:
                        self._solvers[leg].add(solver)
                        self._columns[leg].add(time, time, np.array([[most]]))

    def series(self, name: str) -> Series:
        """Return the iterations of a leg; none if several solvers have one of its name."""
        name = name or _UNNAMED
        if name not in self._columns or len(self._solvers[name]) > 1:
            return no_series(1)
        return self._columns[name].series(ArrayPool())


def _iterations(data: bytes) -> Iterator[tuple[str, float]]:
    """Yield the statuses of a DiagnosticArray that have iterations, by name."""
    cursor = CdrCursor(data)
    cursor.header()
    for _ in range(cursor.length()):
        cursor.skip(1)
        name, _, _ = (cursor.string() for _ in range(3))
        for _ in range(cursor.length()):
            key, value = cursor.string(), cursor.string()
            if key == b'iterations':
                yield name.decode(errors='replace'), float(value)


# An encapsulation of 4 bytes, seconds, and nanoseconds; little endian if the second byte is odd.
_CLOCK_SIZE = 12


class ClockCollector:
    """Collects simulated time: log times and values of /clock [ns]."""

    def __init__(self) -> None:
        self._columns = SeriesColumns(1)

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add a topic's messages in a block."""
        if (topic.name, topic.type) != (CLOCK, 'rosgraph_msgs/msg/Clock'):
            return
        rows = rows[block.sizes[rows] == _CLOCK_SIZE]
        data = block.rows(rows, _CLOCK_SIZE)
        rows, data = rows[data[:, 1] % 2 == 1], data[data[:, 1] % 2 == 1]
        seconds, rest = np.ascontiguousarray(data[:, 4:12]).view('<u4').T
        shown = seconds.astype(np.int64) * 10**9 + rest
        times = nanoseconds(block.heads['log_time'][rows])
        self._columns.add(times, shown, shown[:, np.newaxis] / 1e9)

    def series(self) -> Series:
        """Return it by log times: the stamps are the simulated times."""
        return self._columns.series(ArrayPool())
