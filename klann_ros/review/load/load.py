"""From a log to a recording: messages of legs are decoded, all others counted."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from klann_ros.log import (
    FAULT_RECORD,
    FINDING_RECORD,
    LAST_TIME,
    PAUSE_RECORD,
    recorded_finding,
    recorded_pause,
)
from klann_ros.review.model.answers import MAX_RESPONSE_TIME
from klann_ros.review.model.recording import RunRecording, Trajectory, WalkRecording
from klann_ros.review.model.times import is_time_of_log, merge_intervals, Series, SeriesPool
from klann_ros.review.model.topics import TopicRecording
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable_line
import numpy as np

from .columns import LogColumns, Part
from .geometry import with_dynamics
from .legs import LegColumns, LegDefinitions
from .roles import COMMAND, LEASE, ODOMETRY_TOPICS, place_of, Role, STATE
from .topics import recorded_losses, topic_recordings

if TYPE_CHECKING:
    from klann_ros.log import Log

    from .window import Window

RecordT = TypeVar('RecordT')
# A larger latency mixes two clocks [s].
MAX_LATENCY = 3600.0


def load(
    log: 'Log | Window',
    robot: Robot | None = None,
    *,
    rates: str = '',
    progress: Callable[[float], object] | None = None,
) -> RunRecording:
    """Decode a log, or a window; see `review_run`. `progress` gets the read share, 0 to 1."""
    records = log.solvers
    definitions = LegDefinitions(records, robot)
    columns = LogColumns(definitions, rates)
    for block in log.times.repaired(log.blocks(progress)):
        columns.add(block)
    # Damage is known after reading only.
    pauses = [*_records(log, PAUSE_RECORD, recorded_pause)]
    # After a stall of the recorder, the solver needs time to answer.
    paused = ((p.begin, p.end + (MAX_RESPONSE_TIME if p.reason else 0)) for p in pauses)
    unrecorded = merge_intervals([*paused, *log.gaps])
    losses = recorded_losses(log.metadata)
    topics = [*topic_recordings(columns.receptions, losses, unrecorded)]
    columns.receptions.clear()
    pool = SeriesPool()
    clock = _clock(columns, pool)
    if is_time_of_log(clock):
        topics = [*map(_without_wall_times, topics)]
    leg_columns = LegColumns(columns, definitions, pool, clock)
    legs = [*leg_columns.legs()]
    # Masses serve the efforts only.
    if leg_columns.has_efforts:
        legs = [replace(leg, solver=with_dynamics(leg, records, robot)) for leg in legs]
    return RunRecording(
        path=str(log.path),
        files=tuple((path.name, path.stat().st_size) for path in log.paths),
        start=min(log.start_time, LAST_TIME),
        end=min(log.end_time, LAST_TIME),
        topics=tuple(replace(topic, times=pool.share(topic.times)) for topic in topics),
        problems=log.problems,
        refused_descriptions=tuple(log.refused_descriptions),
        impossible_times=str(log.times),
        is_refused_only=log.is_refused_only,
        undecoded=tuple(columns.undecoded()),
        joints=columns.joints(),
        unrecorded=unrecorded,
        stalls=tuple(pause for pause in pauses if pause.reason),
        clock=clock,
        legs=tuple(legs),
        walks=tuple(_walks(columns, pool)),
        stopped=_file_faults(log, 'stopped'),
        file_fault=_file_faults(log, 'faults'),
        drives=tuple(leg_columns.drives(legs)),
        measured=_measured(columns, pool),
        leases=_leases(columns, pool),
        recorder_findings=tuple(_records(log, FINDING_RECORD, recorded_finding)),
    )


def _records(
    log: 'Log | Window', name: str, parse: Callable[[Mapping[str, str]], RecordT]
) -> Iterator[RecordT]:
    """Yield the valid records of the recorder of one kind."""
    for record in log.metadata.get(name, ()):
        with suppress(ValueError):
            yield parse(record)


def _file_faults(log: 'Log | Window', key: str) -> str:
    """Return the file faults that the recorder noted, in one line."""
    faults = (record.get(key, '') for record in log.metadata.get(FAULT_RECORD, ()))
    return printable_line('; '.join(filter(None, faults)))


def _clock(columns: LogColumns, pool: SeriesPool) -> Series:
    """Return simulated time by log times: the stamps, and values [s]."""
    series = []
    for part in columns.parts(Role.CLOCK):
        series.append(Series(part.times, part.stamps, part.stamps[:, np.newaxis] / 1e9))
    return pool.series(series, 1)


def _measured(columns: LogColumns, pool: SeriesPool) -> dict[str, Series]:
    """Return the measured points by topic."""
    points: dict[str, list[Series]] = defaultdict(list)
    for part in columns.parts(Role.MEASURED):
        points[part.topic].append(part.series())
    return {topic: pool.series(series, 2) for topic, series in points.items()}


class _WalkSeries:
    """The series of a walker, by the topic or by the joint."""

    def __init__(self) -> None:
        self.bodies: dict[str, list[Series]] = defaultdict(list)
        self.commands: dict[str, list[Series]] = defaultdict(list)
        self.states: dict[str, list[Series]] = defaultdict(list)
        self.velocities: dict[str, list[Series]] = defaultdict(list)
        self.speeds: dict[str, list[Series]] = defaultdict(list)
        self.trajectories: list[Trajectory] = []

    def add_joints(self, part: Part) -> None:
        """Add commands or states of cranks."""
        if part.last_name == COMMAND:
            self._add_speeds(part, 'velocity')
            kind = 'position' if 'position' in part.paths else 'velocity'
            _add(self.commands if kind == 'position' else self.velocities, part, kind)
        elif part.selection.is_input and part.last_name in (STATE, 'joint_states'):
            _add(self.states, part, 'position')

    def add_array(self, part: Part) -> None:
        """Add commands without names."""
        if part.last_name == COMMAND:
            self._add_speeds(part)
        _add(self.velocities if part.last_name == COMMAND else self.commands, part)

    def _add_speeds(self, part: Part, path: str = '') -> None:
        speeds = np.nanmax(np.abs(part.numbers((), path)), axis=1, initial=0.0)
        self.speeds[part.topic].append(Series(part.times, part.stamps, speeds[:, np.newaxis]))

    def walk(self, namespace: str, pool: SeriesPool) -> WalkRecording:
        """Return the recording of the walker."""

        def pooled(series: Mapping[str, list[Series]]) -> dict[str, Series]:
            return {name: pool.series(parts, 1) for name, parts in series.items()}

        def path(name: str) -> Series:
            poses = pool.series(self.bodies[name], 3)
            yaws = np.unwrap(poses.values[:, 2])
            return replace(poses, values=np.column_stack([poses.values[:, :2], yaws]))

        odometry, truth = map(path, ODOMETRY_TOPICS)
        return WalkRecording(
            namespace,
            odometry,
            truth,
            commands=pooled(self.commands),
            states=pooled(self.states),
            velocities=pooled(self.velocities),
            trajectories=tuple(self.trajectories),
            speeds=pooled(self.speeds),
        )


def _add(series: dict[str, list[Series]], part: Part, path: str = '') -> None:
    """Add the finite numbers of each joint."""
    for joint in part.selection.names:
        series[joint].append(part.series([joint], path).finite())


def _walks(columns: LogColumns, pool: SeriesPool) -> Iterator[WalkRecording]:
    """Yield the robots with odometry, ground truth or crank commands."""
    walks: dict[str, _WalkSeries] = defaultdict(_WalkSeries)
    for part in columns.parts(Role.BODY):
        walks[part.namespace].bodies[part.last_name].append(part.series().finite())
    for part in columns.parts(Role.JOINTS):
        walks[part.namespace].add_joints(part)
    for part in columns.parts(Role.ARRAY):
        walks[part.namespace].add_array(part)
    for topic, time, content in columns.contents(Role.TRAJECTORY):
        namespace, _ = place_of(topic)
        walks[namespace].trajectories.append(Trajectory(time, **content))
    for namespace, series in sorted(walks.items()):
        is_driven = series.commands or series.velocities or series.trajectories
        if series.bodies or is_driven:
            yield series.walk(namespace, pool)


def _leases(columns: LogColumns, pool: SeriesPool) -> dict[str, Series]:
    """Return by topic where its lease is announced (1) and released (0)."""
    leases: dict[str, list[Series]] = defaultdict(list)
    for name, time, announcement in columns.contents(Role.LEASE):
        times = np.array([time])
        is_held = np.array([[float(announcement['value'] == 'held')]])
        leases[name.removesuffix(f'/{LEASE}')].append(Series(times, times.copy(), is_held))
    return {topic: pool.series(series, 1) for topic, series in leases.items()}


def _without_wall_times(topic: TopicRecording) -> TopicRecording:
    """Return a topic without latencies between wall time and simulated time."""
    with np.errstate(invalid='ignore'):
        mixed = np.abs(topic.latencies) > MAX_LATENCY
    return replace(topic, latencies=np.where(mixed, np.float32(np.nan), topic.latencies))
