"""Measurements from a run, and of any source paired with the crank by their stamps."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

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
    crank_points,
    CrankSamples,
    Kind,
    kind_of,
    MeasuredSeries,
    MeasurementError,
    moving_points,
    series_of,
    TrackedCrank,
)
from .model import CAMERAS, MeasurementModel
from .search import MIN_SAMPLES, start_parameters

# Last names of topics whose points are no measurements: a solver computed them.
COMPUTED_TOPICS = ('point_h', 'velocity_h')
# Indices of the variances of x and y in the covariance of a pose.
_VARIANCES = 0, 7
# Range of a crank's numbers from which on they may be degrees, and the share of the misfit of
# radians up to which they are.
MAX_CRANK_RANGE = 20.0
MAX_UNIT_MISFIT = 0.5
DEGREES = 'the crank is in degrees, as these fit the drawing: --angle-unit rad if it is not'


class Request(NamedTuple):
    """A measured quantity, its topic, and which of the topic's frames, markers or joints."""

    name: str
    topic: str
    key: str = ''


class RawSeries(NamedTuple):
    """A measured quantity: its samples, before they have a crank angle."""

    kind: Kind
    name: str
    times: FloatArray  # [s]
    values: FloatArray  # shape (n, k) [m, rad]
    noise: float | None = None  # [m, rad]
    source: str = ''


class Loaded(NamedTuple):
    """Measurements, and what the user should know of them."""

    measured: list[MeasuredSeries]
    notes: list[str]


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
    path: str,
    leg: RobotLeg,
    requests: Sequence[Request],
    crank_topic: str = '',
    angle_unit: str = '',
) -> Loaded:
    """
    Return the requested measurements of a run.

    Crank angles are those of `crank_topic`, by default of the leg's joint in a JointState, or of a
    Float64 called crank_angle. Raises a MeasurementError for a topic that is missing or unusable.
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
    quantities = []
    for request, topic in zip(requests, measured_topics, strict=True):
        samples = _checked_samples(request, topic, leg, messages[topic.name], start)
        # A series has one noise, which a few bad samples do not change.
        variance = float(np.median(samples.variances))
        noise = variance**0.5 if 0.0 < variance < np.inf else None
        kind = kind_of(leg.linkage, request.name)
        source = printable(topic.name)
        quantities.append(
            RawSeries(kind, request.name, samples.times, samples.values, noise, source)
        )
    tracked = crank_points(leg.linkage).keys() & {request.name for request in requests}
    crank = _crank_samples(crank_topics, messages, leg, start, is_needed=not tracked)
    return paired(leg, quantities, crank, angle_unit)


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
    topics: Sequence[Topic],
    messages: Mapping[str, Sequence[Message]],
    leg: RobotLeg,
    start: int,
    *,
    is_needed: bool,
) -> tuple[FloatArray, FloatArray] | None:
    """Return the crank's times and angles of the first topic that has them."""
    for topic in topics:
        if topic.type not in {JOINT_STATE.name, *ANGLE_TYPES}:
            continue
        key = leg.crank_joint if topic.type == JOINT_STATE.name else ''
        samples = _samples(messages[topic.name], key, start)
        if len(samples.times) > 1:
            return samples.times, samples.values[:, 0]
    if not is_needed:
        return None
    names = listed([topic.name for topic in topics], 8) or 'any topic'
    raise MeasurementError(
        f'no crank angle of the joint {printable(leg.crank_joint)} is on {names}: name the topic '
        f'of a JointState with this joint, or of a Float64, with --crank'
    )


def paired(
    leg: RobotLeg,
    quantities: Sequence[RawSeries],
    crank: tuple[FloatArray, FloatArray] | None,
    unit: str = '',
) -> Loaded:
    """Return series with the crank: by its times [s] and angles, or by a point of it."""
    if crank is not None:
        times, angles = crank
        loaded = Loaded(_series(quantities, CrankSamples.of(times, angles)), [])
        is_fast = np.nanmax(angles, initial=0.0) - np.nanmin(angles, initial=0.0) > MAX_CRANK_RANGE
        if unit == 'deg' or (not unit and is_fast):
            encoder = CrankSamples.of(times, np.radians(angles))
            in_degrees = Loaded(_series(quantities, encoder), [DEGREES] if not unit else [])
            if unit or _misfit(leg, in_degrees) < MAX_UNIT_MISFIT * _misfit(leg, loaded):
                return in_degrees
        return loaded
    tracked = crank_points(leg.linkage)
    by_name = {quantity.name: quantity for quantity in quantities}
    name = next((name for name in tracked if name in by_name), None)
    if name is not None:
        encoder = TrackedCrank.by_point(tracked[name], by_name[name].times, by_name[name].values)
        return Loaded(_series(quantities, encoder), [f'the crank is that of the point {name}'])
    names = listed(tracked, 4) or 'none'
    raise MeasurementError(
        f'there is no angle of the crank: name its column, as --column crank=2, its topic with '
        f'--crank, or track a point of the crank ({names})'
    )


def _series(quantities: Sequence[RawSeries], crank: CrankSamples) -> list[MeasuredSeries]:
    return [series_of(crank=crank, **quantity._asdict()) for quantity in quantities]


def _misfit(leg: RobotLeg, loaded: Loaded) -> float:
    """Return the misfit of the drawing by any camera; infinite for too few samples."""
    model = MeasurementModel(leg.linkage, optional=CAMERAS['scale'])
    if min(len(series.times) for series in loaded.measured) < MIN_SAMPLES:
        return np.inf
    with suppress(MeasurementError):
        start = start_parameters(model, loaded.measured)
        return float(start.misfit / start.parameters[-1])
    return np.inf
