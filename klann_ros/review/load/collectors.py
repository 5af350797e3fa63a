"""Collect series block by block: walkers, /clock, measured points and solver iterations."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from functools import partial

from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.log import MessageBlock
from klann_ros.messages import DIAGNOSTICS, MAX_MESSAGE_SIZE
from klann_ros.review.model.recording import WalkRecording
from klann_ros.review.model.times import nanoseconds, no_series, Series
import numpy as np

from .batches import Batch
from .series import ArrayPool, SeriesColumns

COMMAND = 'crank_command'
STATE = 'crank_state'
ODOMETRY_TOPICS = ('odom', 'ground_truth')
# Measured points of a topic that a review reads.
_MAX_MEASURED = 20_000
# Name of an unnamed leg in diagnostics.
_UNNAMED = 'leg'


class PointCollector:
    """Collects points that somebody measured, by their topics."""

    def __init__(self) -> None:
        self._columns: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))

    def add(self, batch: Batch) -> None:
        """Add messages, up to a number of each topic."""
        columns = self._columns[batch.topic]
        new = slice(max(0, _MAX_MEASURED - len(columns)))
        (points,) = batch.numbers.values()
        times = batch.times[new]
        stamps = batch.stamps[new]
        columns.add(times, np.where(stamps == 0, times, stamps), points[new, :2])

    def series(self, shared: ArrayPool) -> dict[str, Series]:
        """Return the points by topic."""
        return {name: columns.series(shared) for name, columns in self._columns.items()}


class WalkCollector:
    """Collects the poses and cranks of walkers, by their namespaces."""

    def __init__(self) -> None:
        # Columns by namespace and last name of the topic; those of cranks also by joint.
        self._poses: dict[tuple[str, str], SeriesColumns] = defaultdict(partial(SeriesColumns, 3))
        self._cranks: dict[tuple[str, str], dict[str, SeriesColumns]] = defaultdict(dict)

    def add_poses(self, batch: Batch) -> None:
        """Add messages of odometry or ground truth."""
        (numbers,) = batch.numbers.values()
        poses = _planar(numbers)
        is_finite = np.isfinite(poses).all(axis=1)
        columns = self._poses[batch.namespace, batch.last_name]
        columns.add(batch.times[is_finite], batch.stamps[is_finite], poses[is_finite])

    def add_cranks(self, batch: Batch) -> None:
        """Add commands or states of cranks."""
        angles = batch.numbers['position']
        if len(batch.names) != angles.shape[1]:
            return
        joints = self._cranks[batch.namespace, batch.last_name]
        for index, joint in enumerate(batch.names):
            is_finite = np.isfinite(angles[:, index])
            columns = joints.setdefault(joint, SeriesColumns(1))
            times = batch.times[is_finite]
            columns.add(times, batch.stamps[is_finite], angles[is_finite][:, [index]])

    def walks(self, shared: ArrayPool) -> Iterator[WalkRecording]:
        """Yield the robots with odometry, ground truth or crank commands."""
        poses = {
            place: _unwrapped(columns.series(shared)) for place, columns in self._poses.items()
        }
        cranks: dict[tuple[str, str], dict[str, Series]] = {}
        for place, joints in self._cranks.items():
            cranks[place] = {joint: columns.series(shared) for joint, columns in joints.items()}
        commanded = {namespace for namespace, name in cranks if name == COMMAND}
        for namespace in sorted({namespace for namespace, _ in poses} | commanded):
            odometry, truth = (
                poses.get((namespace, name), no_series(3)) for name in ODOMETRY_TOPICS
            )
            yield WalkRecording(
                namespace,
                odometry=odometry,
                truth=truth,
                commands=cranks.get((namespace, COMMAND), {}),
                states=cranks.get((namespace, STATE), {}),
            )


def _planar(poses: FloatArray) -> FloatArray:
    """Return x, y and yaw of poses, shape (n, 7) [m, rad]."""
    x, y, _, qx, qy, qz, qw = poses.T
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return np.column_stack([x, y, yaw])


def _unwrapped(poses: Series) -> Series:
    x, y, yaw = poses.values.T
    return Series(poses.times, poses.stamps, np.column_stack([x, y, np.unwrap(yaw)]))


class IterationCollector:
    """Collects solver iterations from diagnostics: the maximum since the last report."""

    def __init__(self) -> None:
        # The iterations of each leg, and the names of its solvers, by its name.
        self._columns: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 1))
        self._solvers: dict[str, set[str]] = defaultdict(set)

    def add(self, block: MessageBlock, rows: IndexArray) -> None:
        """Add messages in a block; invalid ones are ignored."""
        for row in rows[block.sizes[rows] <= MAX_MESSAGE_SIZE].tolist():
            time = nanoseconds(block.heads['log_time'][[row]])
            with suppress(ValueError):
                for status in DIAGNOSTICS.read(block.message(row))['status']:
                    solver, _, leg = status['name'].rpartition(': ')
                    for pair in status['values']:
                        if solver and pair['key'] == 'iterations':
                            iterations = np.array([[float(pair['value'])]])
                            self._solvers[leg].add(solver)
                            self._columns[leg].add(time, time, iterations)

    def series(self, name: str) -> Series:
        """Return the iterations of a leg; none if several solvers have one of its name."""
        name = name or _UNNAMED
        if name not in self._columns or len(self._solvers[name]) > 1:
            return no_series(1)
        return self._columns[name].series(ArrayPool())


class ClockCollector:
    """Collects simulated time: log times and values of /clock [ns]."""

    def __init__(self) -> None:
        self._columns = SeriesColumns(1)

    def add(self, batch: Batch) -> None:
        """Add messages."""
        self._columns.add(batch.times, batch.stamps, batch.stamps[:, np.newaxis] / 1e9)

    def series(self) -> Series:
        """Return it by log times: the stamps are the simulated times."""
        return self._columns.series(ArrayPool())
