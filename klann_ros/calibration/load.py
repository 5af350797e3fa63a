"""Measurements from a run, paired by their stamps, or from a CSV file."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from klann_ros.cli import read_table, TextTable
from klann_ros.kinematics import Linkage
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.log import Message, open_log, Topic
from klann_ros.messages import (
    ANGLE_TYPES,
    FRAMED_TYPES,
    JOINT_STATE,
    MARKER,
    MESSAGE_TYPES,
    POINT_FIELDS,
)
from klann_ros.robot import Robot, robot_from_parameters, RobotLeg
from klann_ros.sanitize.text import did_you_mean, listed, printable
import numpy as np

from .measurements import (
    CrankSamples,
    kind_of,
    MeasuredSeries,
    MeasurementError,
    moving_points,
    series_of,
)

# Last names of topics whose points are no measurements: a solver computed them.
COMPUTED_TOPICS = ('point_h', 'velocity_h')
# Indices of the variances of x and y in the covariance of a pose.
_VARIANCES = 0, 7
MAX_CSV_SIZE = 256 * 1024 * 1024


class Request(NamedTuple):
    """A measured quantity, its topic, and which of the topic's frames, markers or joints."""

    name: str
    topic: str
    key: str = ''


class Reading(NamedTuple):
    """Numbers of a message with their key, stamp [ns; 0 for none] and variance, if known."""

    key: str
    stamp: int
    values: tuple[float, ...]
    variance: float = 0.0


def readings(type_name: str, data: bytes) -> Iterator[Reading]:
    """Yield the measurements of a message; a ValueError if it is malformed."""
    content = MESSAGE_TYPES[type_name].read(data)
    if type_name in ANGLE_TYPES:
        yield Reading('', 0, (content['data'],))
        return
    for message in content.get('transforms', [content]):
        stamp = message['header.stamp.sec'] * 10**9 + message['header.stamp.nanosec']
        if type_name == JOINT_STATE.name:
            for name, position in zip(message['name'], message['position'], strict=True):
                yield Reading(name, stamp, (position,))
            return
        key = message.get('child_frame_id', '')
        if type_name == MARKER.name:
            key = f'{message["ns"]}/{message["id"]}'
        field = POINT_FIELDS[type_name]
        point = message[f'{field}.x'], message[f'{field}.y']
        covariance = message.get('pose.covariance')
        variance = sum(covariance[n] for n in _VARIANCES) / 2.0 if covariance else 0.0
        yield Reading(key, stamp, point, variance)


class _Samples(NamedTuple):
    """The n samples of a key on a topic, and all keys on it."""

    times: FloatArray  # from the start of the run [s]
    variances: FloatArray  # 0 if unknown
    values: FloatArray  # shape (n, k)
    keys: set[str]


def _samples(messages: Iterable[Message], key: str, start: int) -> _Samples:
    """Return the samples of a key, all of them for ''; times from a start [ns]."""
    keys = set()
    rows = []
    for message in messages:
        with suppress(ValueError):
            for reading in list(readings(message.topic.type, message.data)):
                keys.add(reading.key)
                # A marker may be named by its namespace or its number alone.
                if key in {'', reading.key, *reading.key.split('/')}:
                    time = reading.stamp or message.publish_time or message.log_time
                    rows.append(((time - start) / 1e9, reading.variance, *reading.values))
    table = np.array(rows, dtype=np.float64) if rows else np.empty((0, 3))
    return _Samples(table[:, 0], table[:, 1], table[:, 2:], keys)


def point_topics(names: Iterable[str], linkage: Linkage, leg: str = '') -> dict[str, str]:
    """Return topics with the name of a point, such as `/mocap/LEG/h`, by the moving point."""
    points = {point.lower(): point for point in moving_points(linkage)}
    topics = {}
    for name in names:
        namespace, last = ['', *name.split('/')][-2:]
        if last.lower() in points and leg in {'', namespace}:
            topics[points[last.lower()]] = name
    return topics


def described_run(path: str, drawn: Robot | None) -> tuple[Robot, dict[str, Any], list[str]]:
    """Return the robot of a run, or the drawn one, its parameters, and the topics of points."""
    with open_log(path) as log:
        solvers = log.solvers if drawn is None else []
        types = POINT_FIELDS.keys() - FRAMED_TYPES
        topics = [topic.name for topic in log.topics if topic.type in types]
    if drawn is not None:
        return drawn, {}, topics
    for solver in reversed(solvers):
        with suppress(ValueError, TypeError):
            parameters = solver.without_files
            return robot_from_parameters(parameters, weigh=False), parameters, topics
    raise MeasurementError('the run does not contain the leg as drawn: name its file with --leg')


def load_run(
    path: str, leg: RobotLeg, requests: Sequence[Request], crank_topic: str = ''
) -> list[MeasuredSeries]:
    """
    Return the requested measurements of a run.

    Crank angles are those of `crank_topic`, by default of the leg's joint in a JointState, or of a
    Float64 called crank_angle.

    Raises
    ------
    MeasurementError
        A topic is missing, or cannot be used; the text says why.

    """
    with open_log(path) as log:
        # A topic of several files may have several profiles, of which any will do.
        topics = {topic.name: topic for topic in log.topics}
        measured_topics = [_topic(topics, request.topic) for request in requests]
        crank_topics = _likely_crank_topics(topics)
        if crank_topic:
            crank_topics = [_topic(topics, crank_topic)]
        messages: dict[str, list[Message]] = {}
        for topic in (*measured_topics, *crank_topics):
            messages[topic.name] = []
        for message in log.messages(topics=messages.keys()):
            messages[message.topic.name].append(message)
        start = log.start_time
    crank = _crank_samples(crank_topics, messages, leg, start)
    measured = []
    for request, topic in zip(requests, measured_topics, strict=True):
        samples = _checked_samples(request, topic, leg, messages[topic.name], start)
        # A series has one noise, which a few bad samples do not change.
        variance = float(np.median(samples.variances))
        noise = variance**0.5 if 0.0 < variance < np.inf else None
        kind = kind_of(leg.linkage, request.name)
        source = printable(topic.name)
        series = series_of(
            kind, request.name, samples.times, samples.values, crank, noise=noise, source=source
        )
        measured.append(series)
    return measured


def _checked_samples(
    request: Request, topic: Topic, leg: RobotLeg, messages: Sequence[Message], start: int
) -> _Samples:
    """Return the samples of a topic, unless it is of another type, computed, or has several."""
    kind = kind_of(leg.linkage, request.name)
    title = printable(topic.name)
    types = POINT_FIELDS if kind == 'point' else (JOINT_STATE.name, *sorted(ANGLE_TYPES))
    if topic.type not in types:
        legal = ', '.join(name.rpartition('/')[2] for name in types)
        raise MeasurementError(f'{title} is {printable(topic.type)}: a measured {kind} is {legal}')
    samples = _samples(messages, request.key, start)
    keys = samples.keys
    is_computed = topic.name.rpartition('/')[2] in COMPUTED_TOPICS
    for separator in '/_':
        joints = {leg.joint_name(name, separator) for name in leg.linkage.joint_names}
        is_computed |= joints <= keys
    if is_computed:
        # It would confirm the lengths that the solver had.
        raise MeasurementError(
            f'{title} is no measurement: a solver computed it from the lengths that are to be '
            f'found'
        )
    listing = listed(sorted(keys), 8)
    if not len(samples.times):
        problem = f'{title} has no readable message'
        if request.key:
            problem = f'{printable(request.key)} is not on {title}; there are {listing}'
        raise MeasurementError(problem)
    if not request.key and len(keys) > 1:
        example = f'{printable(request.name)}={title}:NAME'
        raise MeasurementError(f'{title} has several: name one as {example}, of {listing}')
    return samples


def _topic(topics: Mapping[str, Topic], name: str) -> Topic:
    topic = topics.get(name) or topics.get(f'/{name}')
    if topic is None:
        listing = f'{listed(topics, 10) or "none"}{did_you_mean(name, topics)}'
        raise MeasurementError(f'there is no topic {printable(name)} in the run: {listing}')
    return topic


def _likely_crank_topics(topics: Mapping[str, Topic]) -> list[Topic]:
    """Return the topics that may have the crank's angle, the likeliest first."""
    states = []
    plain = []
    for name, topic in topics.items():
        if topic.type == JOINT_STATE.name:
            states.append(topic)
        elif topic.type in ANGLE_TYPES and name.endswith('crank_angle'):
            plain.append(topic)
    states.sort(key=lambda topic: topic.name.rpartition('/')[2] != 'crank_state')
    return states + plain


def _crank_samples(
    topics: Sequence[Topic], messages: Mapping[str, Sequence[Message]], leg: RobotLeg, start: int
) -> CrankSamples:
    """Return the crank angles of the first topic that has them."""
    for topic in topics:
        if topic.type not in {JOINT_STATE.name, *ANGLE_TYPES}:
            continue
        key = leg.crank_joint if topic.type == JOINT_STATE.name else ''
        samples = _samples(messages[topic.name], key, start)
        if len(samples.times) > 1:
            return CrankSamples.of(samples.times, samples.values[:, 0])
    names = listed([topic.name for topic in topics], 8) or 'any topic'
    raise MeasurementError(
        f'no crank angle of the joint {printable(leg.crank_joint)} is on {names}: name the topic '
        f'of a JointState with this joint, or of a Float64, with --crank'
    )


def load_csv(path: str, leg: RobotLeg, requests: Sequence[Request] = ()) -> list[MeasuredSeries]:
    """
    Return the measurements of a CSV file: `time` [s], `crank` [rad], `H.x`, `H.y` [m], ...

    Angles and distances are single columns, such as `theta` [rad] and `A-H` [m]; empty fields were
    not measured. Requests name columns; by default all are read.
    """
    table = read_table(path, ('time', 'crank'), MeasurementError, MAX_CSV_SIZE)
    columns = {name: _numbers(table, name) for name in table.columns}

    def column(name: str) -> FloatArray:
        if name not in columns:
            listing = f'{listed(columns, 12)}{did_you_mean(name, columns)}'
            raise MeasurementError(
                f'{printable(path)} has no column {printable(name)}: there are {listing}'
            )
        return columns[name]

    times = column('time')
    crank = CrankSamples.of(times, column('crank'))
    if not requests:
        requests = []
        for column_name in table.columns:
            name = column_name.removesuffix('.x')
            if not column_name.endswith('.y') and name not in {'time', 'crank'}:
                requests.append(Request(name, name))
    measured = []
    for request in requests:
        kind = kind_of(leg.linkage, request.name)
        suffixes = ('.x', '.y') if kind == 'point' else ('',)
        numbers = np.column_stack([column(f'{request.topic}{suffix}') for suffix in suffixes])
        source = f'column {printable(request.topic)}'
        measured.append(series_of(kind, request.name, times, numbers, crank, source=source))
    return measured


def _numbers(table: TextTable, name: str) -> FloatArray:
    """Return the numbers of a column; not a number where a cell is empty."""
    # Between commas a comma may group thousands.
    comma = ',' if table.delimiter == ',' else '.'
    numbers = np.empty(len(table.rows))
    for n, row in enumerate(table.rows):
        try:
            numbers[n] = float(row.cells[name].replace(',', comma) or 'nan')
        except (KeyError, ValueError) as error:  # noqa: PERF203, RUF100 - of each row
            raise MeasurementError(f'{row.place} is no table of numbers: {error}') from None
    return numbers
