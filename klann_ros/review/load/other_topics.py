"""What other topics tell of a leg: geometry, iterations of its solver, and simulated time."""

from collections import defaultdict
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from klann_ros.kinematics import GeometryError, KlannGeometry, KlannLeg
from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.recording import LegSolver, no_series, Series
from klann_ros.review.model.simulated_time import CLOCK
from klann_ros.review.model.times import nanoseconds, RowIndices
from klann_ros.sanitize.cdr import CdrCursor
from klann_ros.sanitize.text import printable
import numpy as np

from .columns import GrowingArray, SeriesColumns, Shared
from .klann_urdf import klann_legs_in_urdf, LONGEST
from .pieces import decoder
from .solvers import last_change

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# How a solver calls its only leg.
_UNNAMED = 'leg'


class Iterations:
    """Gathers the iterations from diagnostics: the most that a pose took since the last report."""

    def __init__(self) -> None:
        self._columns: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 1))
        self._solvers: dict[str, set[str]] = defaultdict(set)
        self._decoders: dict[Topic, Any] = {}

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> None:
        """Add what a topic's messages in a block report."""
        if topic.type != DIAGNOSTICS:
            return
        if topic not in self._decoders:
            self._decoders[topic] = decoder(topic)
        for row in rows.tolist():
            # A message that is none tells nothing of a leg.
            with suppress(Exception):
                message = self._decoders[topic](block.message(row))
                self._report(message, nanoseconds(block.heads['log_time'][[row]]))

    def series(self, name: str) -> Series:
        """Return what is reported of a leg; nothing where several solvers have one of the name."""
        name = name or _UNNAMED
        if name not in self._columns or len(self._solvers[name]) > 1:
            return no_series(1)
        return self._columns[name].series(Shared())

    def _report(self, message: Any, time: 'np.ndarray[Any, np.dtype[np.int64]]') -> None:
        for status in message.status:
            solver, _, leg = str(status.name).rpartition(': ')
            for value in status.values:
                if solver and value.key == 'iterations':
                    self._solvers[leg].add(solver)
                    self._columns[leg].add(time, time, np.array([[float(value.value)]]))


# An encapsulation of 4 bytes, seconds, and nanoseconds; little endian if the second byte is odd.
_CLOCK_SIZE = 12


class SimulatedTime:
    """Gathers the simulated time: the log times and values of /clock [ns]."""

    def __init__(self) -> None:
        self._times, self._values = GrowingArray(np.int64), GrowingArray(np.int64)

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> None:
        """Add a topic's messages in a block."""
        if (topic.name, topic.type) != (CLOCK, 'rosgraph_msgs/msg/Clock'):
            return
        rows = rows[block.sizes[rows] == _CLOCK_SIZE]
        data = block.rows(rows, _CLOCK_SIZE)
        rows, data = rows[data[:, 1] % 2 == 1], data[data[:, 1] % 2 == 1]
        seconds, rest = (np.ascontiguousarray(data[:, k : k + 4]).view('<u4') for k in (4, 8))
        self._times.add(nanoseconds(block.heads['log_time'][rows]))
        self._values.add(seconds[:, 0].astype(np.int64) * 10**9 + rest[:, 0])

    def series(self) -> Series:
        """Return it by log times: the stamps are the simulated times."""
        times, values = self._times.array(), self._values.array()
        order = np.argsort(times, kind='stable')
        return Series(times[order], values[order], np.empty((len(times), 0)))


TEXT, NAME = 'std_msgs/msg/String', 'robot_description'
# A robot that is described anew at each message is none.
_MOST = 32
# What a message has beside the text [bytes], at most.
_FRAME = 16


class _Described(NamedTuple):
    """What was described since a log time [ns]: the dimensions of legs by their names."""

    time: int
    legs: dict[str, dict[str, float]]


class Descriptions:
    """Gathers the legs that robot descriptions tell, by the namespace of their topic."""

    def __init__(self) -> None:
        self._last: dict[str, bytes] = {}
        self._found: dict[str, list[_Described]] = defaultdict(list)

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> None:
        """Add what a topic's messages in a block describe."""
        namespace, _, name = topic.name.rpartition('/')
        if (topic.type, name) != (TEXT, NAME):
            return
        for row in rows[block.sizes[rows] <= LONGEST + _FRAME].tolist():
            data = block.message(row)
            # It is published again and again, as a rule.
            if data != self._last.get(topic.name) and len(self._found[namespace]) < _MOST:
                self._last[topic.name] = data
                time = int(nanoseconds(block.heads['log_time'][[row]])[0])
                self._found[namespace].append(_Described(time, klann_legs_in_urdf(_text(data))))

    def described(self, solver: LegSolver, namespace: str, name: str, poses: Series) -> LegSolver:
        """Return a solver that knows nothing of its leg with what is described of it."""
        spaces = [space for space, found in self._found.items() if any(d.legs for d in found)]
        # Who describes the robot is elsewhere, where there is one robot alone.
        space = namespace if namespace in spaces or len(spaces) != 1 else spaces[0]
        told = sorted(self._found.get(space, ()), key=lambda described: described.time)
        assembly = _assembly(poses)
        legs = [_leg(described.legs.get(name), assembly) for described in told]
        if solver.leg is not None or not legs or legs[-1] is None:
            return solver
        times = [described.time for described in told]
        source = f'{printable(f"{space}/{NAME}")}, put together as its poses are'
        return replace(solver, leg=legs[-1], leg_time=last_change(times, legs), source=source)


def _text(data: bytes) -> str:
    try:
        return CdrCursor(data).string().decode()
    except ValueError:
        return ''


def _assembly(poses: Series) -> tuple[int, int]:
    """Return how most of a Klann leg's poses are put together: no URDF tells it."""
    _, gamma, beta, delta, theta = poses.values.T
    with np.errstate(over='ignore', invalid='ignore'):
        sums = [float(np.nansum(np.sign(np.sin(both)))) for both in (gamma + beta, delta + theta)]
    return (1 if sums[0] >= 0 else -1), (1 if sums[1] >= 0 else -1)


def _leg(numbers: dict[str, float] | None, assembly: tuple[int, int]) -> KlannLeg | None:
    try:
        return None if numbers is None else KlannLeg(KlannGeometry(**numbers, assembly=assembly))
    except GeometryError:
        return None
