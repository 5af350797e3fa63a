"""Measurements from a run, paired by their stamps, or from a CSV file."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
import csv
from dataclasses import dataclass, field
from io import StringIO
from math import sqrt
from pathlib import Path
import struct
from typing import NamedTuple

from klann_ros.kinematics import Linkage
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.log import Message, open_log, Topic
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD
from klann_ros.robot import Robot, robot_from_parameters, RobotLeg
from klann_ros.sanitize.cdr import CdrCursor, read_joint_state, STAMP_SIZE
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import did_you_mean, listed, printable
import numpy as np

from .measurements import CrankSamples, Kind, kind_of, MeasurementError, Series, series_of

FLOAT, JOINTS = 'std_msgs/msg/Float64', 'sensor_msgs/msg/JointState'
TRANSFORMS = 'tf2_msgs/msg/TFMessage'
MAX_CSV_SIZE = 256 * 1024 * 1024
# Names of topics with answers of a solver, by their last part.
COMPUTED_TOPICS = ('point_h', 'velocity_h')


class Request(NamedTuple):
    """A measured quantity, its topic, and which of the topic's frames, markers or joints."""

    name: str
    topic: str
    key: str = ''


class Reading(NamedTuple):
    """A number of a message with its keys, stamp [ns; 0 for none] and variance, if it has one."""

    keys: tuple[str, ...]
    stamp: int
    values: tuple[float, ...]
    variance: float = 0.0


@dataclass
class _Samples:
    times: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)
    variances: list[float] = field(default_factory=list)
    # The keys of what is on the topic, the fullest last.
    keys: set[tuple[str, ...]] = field(default_factory=set)

    @property
    def names(self) -> list[str]:
        return sorted(keys[-1] for keys in self.keys if keys)


# Decoding.


def _header(data: bytes) -> tuple[CdrCursor, int, str]:
    """Return a cursor behind the header of a message, its stamp [ns] and its frame."""
    cursor = CdrCursor(data)
    return cursor, *_read_header(cursor, data)


def _read_header(cursor: CdrCursor, data: bytes) -> tuple[int, str]:
    cursor.align(4)
    seconds, rest = struct.unpack_from(f'{cursor.order}iI', data, cursor.skip(STAMP_SIZE))
    return seconds * 10**9 + rest, cursor.string().decode(errors='replace')


def _numbers(cursor: CdrCursor, data: bytes, count: int) -> tuple[float, ...]:
    cursor.align(8)
    return struct.unpack_from(f'{cursor.order}{count}d', data, cursor.skip(8 * count))


def _position(data: bytes) -> Iterator[Reading]:
    """Yield the position of a PointStamped or a PoseStamped."""
    cursor, stamp, _ = _header(data)
    yield Reading((), stamp, _numbers(cursor, data, 2))


def _pose_with_covariance(data: bytes) -> Iterator[Reading]:
    cursor, stamp, _ = _header(data)
    pose = _numbers(cursor, data, 7 + 36)
    # Of x and y; row by row with 6 columns.
    yield Reading((), stamp, pose[:2], (pose[7] + pose[14]) / 2.0)


def _transform(data: bytes) -> Iterator[Reading]:
    cursor, stamp, _ = _header(data)
    child = cursor.string().decode(errors='replace')
    yield Reading((child,), stamp, _numbers(cursor, data, 7)[:2])


def _transforms(data: bytes) -> Iterator[Reading]:
    cursor = CdrCursor(data)
    for _ in range(cursor.length()):
        stamp, _ = _read_header(cursor, data)
        child = cursor.string().decode(errors='replace')
        yield Reading((child,), stamp, _numbers(cursor, data, 7)[:2])


def _marker(data: bytes) -> Iterator[Reading]:
    cursor, stamp, _ = _header(data)
    space = cursor.string().decode(errors='replace')
    cursor.align(4)
    number, _, _ = struct.unpack_from(f'{cursor.order}iii', data, cursor.skip(12))
    yield Reading((space, str(number), f'{space}/{number}'), stamp, _numbers(cursor, data, 2))


def _joints(data: bytes) -> Iterator[Reading]:
    cursor, stamp, _ = _header(data)
    names, ((begin, count), *_) = read_joint_state(CdrCursor(data))
    if len(names) == count:
        positions = struct.unpack_from(f'{cursor.order}{count}d', data, begin)
        for name, position in zip(names, positions, strict=True):
            yield Reading((name.decode(errors='replace'),), stamp, (position,))


def _float(data: bytes) -> Iterator[Reading]:
    yield Reading((), 0, _numbers(CdrCursor(data), data, 1))


Decode = Callable[[bytes], Iterator[Reading]]
POINT_DECODERS: Mapping[str, Decode] = {
    'geometry_msgs/msg/PointStamped': _position,
    'geometry_msgs/msg/PoseStamped': _position,
    'geometry_msgs/msg/PoseWithCovarianceStamped': _pose_with_covariance,
    'geometry_msgs/msg/TransformStamped': _transform,
    TRANSFORMS: _transforms,
    'visualization_msgs/msg/Marker': _marker,
}
# Types with several points under names: those of computed frames and drawings, too.
FRAMED_TYPES = (TRANSFORMS, 'visualization_msgs/msg/Marker')
NUMBER_DECODERS: Mapping[str, Decode] = {JOINTS: _joints, FLOAT: _float}


def _samples(
    messages: Sequence[Message], decode: Decode, key: str, start: int
) -> tuple[FloatArray, FloatArray, _Samples]:
    """Return times from a start [s], values, shape (n, k), and the rest."""
    found = _Samples()
    for message in messages:
        try:
            readings = list(decode(message.data))
        except (ValueError, struct.error):
            continue
        for reading in readings:
            found.keys.add(reading.keys)
            if not key or key in reading.keys:
                found.times.append(reading.stamp or message.publish_time or message.log_time)
                found.values.append(reading.values)
                found.variances.append(reading.variance)
    times = (np.array(found.times, dtype=np.int64) - start) / 1e9
    width = len(found.values[0]) if found.values else 1
    return times, np.array(found.values, dtype=np.float64).reshape(-1, width), found


# Runs.


def point_topics(names: Iterable[str], linkage: Linkage, leg: str = '') -> dict[str, str]:
    """Return topics with the name of a point, such as `/mocap/LEG/h`, by the moving point."""
    structure = linkage.structure
    points = {p.lower(): p for p in structure.points if p not in structure.pivots}
    found = {}
    for name in names:
        *_, space, last = ['', *name.split('/')]
        if last.lower() in points and leg in {'', space}:
            found[points[last.lower()]] = name
    return found


def described_run(path: str, known: Robot | None) -> tuple[Robot, list[str]]:
    """Return the robot of a run, or the known one, and the topics that may be of one point."""
    with open_log(path) as log:
        records = log.metadata.get(SOLVER_RECORD, [])
        points = {*POINT_DECODERS} - {*FRAMED_TYPES}
        topics = [topic.name for topic in log.topics if topic.type in points]
    if known is not None:
        return known, topics
    for record in reversed(records):
        with suppress(ValueError, TypeError):
            parameters = solver_parameters(record).parameters
            return robot_from_parameters(parameters, weigh=False), topics
    raise MeasurementError('the run does not contain the leg as drawn: name its file with --leg')


def load_run(
    path: str, leg: RobotLeg, requests: Sequence[Request], crank_topic: str = ''
) -> list[Series]:
    """
    Return the requested measurements of a run.

    Parameters
    ----------
    path : str
        A run's folder, or one of its files.
    leg : RobotLeg
        The leg, with the joint of its crank.
    requests : sequence of Request
        What was measured, and where.
    crank_topic : str
        The topic of the crank's encoder; by default a JointState with the leg's crank joint, or a
        Float64 called crank_angle.

    Raises
    ------
    MeasurementError
        A topic is missing, of another type, or computed by a solver.
    klann_ros.log.NotALogError
        The path is no readable log.

    """
    with open_log(path) as log:
        # A topic may be in several files, with other profiles.
        topics = {topic.name: topic for topic in log.topics}
        chosen = [_topic(topics, request.topic) for request in requests]
        cranks = [_topic(topics, crank_topic)] if crank_topic else _crank_topics(topics, leg)
        names = {topic.name for topic in (*chosen, *cranks)}
        messages: dict[str, list[Message]] = {name: [] for name in names}
        for message in log.messages(names):
            messages[message.topic.name].append(message)
        start = log.start_time
    crank = _crank(cranks, messages, leg, start)
    return [
        _measured(request, topic, messages[topic.name], leg, crank, start)
        for request, topic in zip(requests, chosen, strict=True)
    ]


def _measured(  # noqa: PLR0917 - what belongs to a topic
    request: Request,
    topic: Topic,
    messages: Sequence[Message],
    leg: RobotLeg,
    crank: CrankSamples,
    start: int,
) -> Series:
    kind = kind_of(leg.linkage, request.name)
    decoders = POINT_DECODERS if kind == 'point' else NUMBER_DECODERS
    where = printable(topic.name)
    if topic.type not in decoders:
        known = ', '.join(name.rpartition('/')[2] for name in decoders)
        raise MeasurementError(f'{where} is {printable(topic.type)}: a measured {kind} is {known}')
    key = request.key
    times, values, found = _samples(messages, decoders[topic.type], key, start)
    _refuse_computed(topic, {*found.names}, leg)
    if not len(times):
        there = f'; there are {listed(found.names, 8)}' if key and found.names else ''
        what = f'{printable(key)} is not on {where}' if key else f'{where} has no readable message'
        raise MeasurementError(f'{what}{there}')
    if not key and len(found.keys) > 1:
        raise MeasurementError(
            f'{where} has several: name one as {printable(request.name)}={where}:NAME, of '
            f'{listed(found.names, 8)}'
        )
    variance = float(np.median(found.variances))
    noise = sqrt(variance) if 0.0 < variance < np.inf else None
    return series_of(kind, request.name, times, values, crank, noise=noise, source=where)


def _topic(topics: Mapping[str, Topic], name: str) -> Topic:
    for known in (name, f'/{name}'):
        if known in topics:
            return topics[known]
    hint = did_you_mean(name, topics)
    there = listed(topics, 10) or 'none'
    raise MeasurementError(f'there is no topic {printable(name)} in the run: {there}{hint}')


def _refuse_computed(topic: Topic, keys: set[str], leg: RobotLeg) -> None:
    """Refuse what a solver has computed: it would confirm the lengths that the solver had."""
    computed = topic.name.rpartition('/')[2] in COMPUTED_TOPICS
    if topic.type == JOINTS:
        computed = {leg.joint_name(name, '/') for name in leg.linkage.joint_names} <= keys
        computed |= {leg.joint_name(name, '_') for name in leg.linkage.joint_names} <= keys
    if computed:
        raise MeasurementError(
            f'{printable(topic.name)} is no measurement: a solver computed it from the lengths '
            f'that are to be found'
        )


def _crank_topics(topics: Mapping[str, Topic], leg: RobotLeg) -> list[Topic]:
    """Return the topics that may have the crank's angle, the likeliest first."""
    states = [topic for topic in topics.values() if topic.type == JOINTS]
    states.sort(key=lambda topic: topic.name.rpartition('/')[2] != 'crank_state')
    plain = [t for t in topics.values() if t.type == FLOAT and t.name.endswith('crank_angle')]
    if not states and not plain:
        raise MeasurementError(
            f'the run has no crank angle: neither a JointState with the joint '
            f'{printable(leg.crank_joint)} nor a Float64 called crank_angle; name its topic with '
            f'--crank'
        )
    return states + plain


def _crank(
    topics: Sequence[Topic],
    messages: Mapping[str, Sequence[Message]],
    leg: RobotLeg,
    start: int,
) -> CrankSamples:
    for topic in topics:
        decode = NUMBER_DECODERS.get(topic.type)
        key = leg.crank_joint if topic.type == JOINTS else ''
        if decode is not None:
            times, values, _ = _samples(messages[topic.name], decode, key, start)
            if len(times) > 1:
                return CrankSamples.of(times, values[:, 0])
    names = listed([topic.name for topic in topics], 8)
    joint = printable(leg.crank_joint)
    raise MeasurementError(f'no crank angle of the joint {joint} is on {names}')


# CSV.


def load_csv(path: str, leg: RobotLeg, requests: Sequence[Request] = ()) -> list[Series]:
    """
    Return the measurements of a CSV file: `time` [s], `crank` [rad], `H.x`, `H.y` [m], ...

    Angles and distances are single columns, such as `theta` [rad] and `A-H` [m]; empty fields were
    not measured. Requests name columns; by default all are read that the leg knows.

    Raises
    ------
    MeasurementError
        It is no such table.

    """
    try:
        text = read_regular(path, MAX_CSV_SIZE)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise MeasurementError(f'{printable(path)} cannot be read: {printable(reason)}') from None
    columns = _columns(text, printable(path))
    for needed in ('time', 'crank'):
        if needed not in columns:
            there = f'{listed(columns, 12)}{did_you_mean(needed, columns)}'
            msg = f'{printable(path)} has no column {needed}: there are {there}'
            raise MeasurementError(msg)
    names = [column.removesuffix('.x') for column in columns if not column.endswith('.y')]
    chosen = list(requests) or [Request(n, n) for n in names if n not in {'time', 'crank'}]
    times, crank = columns['time'], CrankSamples.of(columns['time'], columns['crank'])
    found = []
    for request in chosen:
        kind: Kind = kind_of(leg.linkage, request.name)
        own = [f'{request.topic}.x', f'{request.topic}.y'] if kind == 'point' else [request.topic]
        missing = [name for name in own if name not in columns]
        if missing:
            msg = f'{printable(path)} has no column {printable(missing[0])}: {listed(columns, 12)}'
            raise MeasurementError(msg)
        values = np.column_stack([columns[name] for name in own])
        source = f'column {printable(request.topic)}'
        found.append(series_of(kind, request.name, times, values, crank, source=source))
    return found


def _columns(text: str, shown: str) -> dict[str, FloatArray]:
    rows = csv.reader(StringIO(text))
    try:
        heads = [head.strip() for head in next(rows, [])]
        table = [row for row in rows if row]
    except csv.Error as error:
        raise MeasurementError(f'{shown} is no table: {error}') from None
    try:
        numbers = np.array([[_number(cell) for cell in row] for row in table], dtype=np.float64)
        numbers = numbers.reshape(len(table), len(heads))
    except ValueError as error:
        raise MeasurementError(f'{shown} is no table of numbers: {printable(error)}') from None
    return dict(zip(heads, numbers.T, strict=True))


def _number(cell: str) -> float:
    return float(cell) if cell.strip() else np.nan


def is_csv(path: str) -> bool:
    """Return whether a path is that of a CSV file."""
    return Path(path).suffix.lower() == '.csv'
