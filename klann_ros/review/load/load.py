"""From a log to a recording: messages of legs are decoded, all others counted."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from klann_ros.calibration import COMPUTED_TOPICS, POINT_FIELDS
from klann_ros.kinematics.arrays import IndexArray
from klann_ros.log import (
    ANNOTATION,
    FAULT_RECORD,
    FINDING_RECORD,
    MessageBlock,
    PAUSE_RECORD,
    recorded_finding,
    recorded_pause,
    Topic,
)
from klann_ros.messages import (
    CLOCK,
    DIAGNOSTICS,
    FLOAT64,
    JOINT_STATE,
    ODOMETRY,
    POINT,
    POSE,
    POSE_WITH_COVARIANCE,
    STRING,
    TRANSFORM,
)
from klann_ros.review.model.answers import MAX_RESPONSE_TIME
from klann_ros.review.model.recording import RunRecording, Undecoded
from klann_ros.review.model.times import (
    CLOCK as CLOCK_TOPIC,
    is_time_of_log,
    LAST_TIME,
    merge_intervals,
)
from klann_ros.review.model.topics import TopicRecording
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable_line
import numpy as np

from .batches import Batch, TopicReader
from .collectors import (
    ClockCollector,
    COMMAND,
    IterationCollector,
    ODOMETRY_TOPICS,
    PointCollector,
    STATE,
    WalkCollector,
)
from .geometry import DESCRIPTION, Descriptions, with_dynamics
from .legs import is_leg_topic, LegCollector, LegDefinitions
from .series import ArrayPool
from .topics import recorded_losses, TopicCollector

if TYPE_CHECKING:
    from klann_ros.log import Log

    from .window import Window

RecordT = TypeVar('RecordT')
# A larger latency mixes two clocks [s].
MAX_LATENCY = 3600.0
# Types of messages with a single measured point.
_POINT_TYPES = {
    message_type.name: message_type
    for message_type in (POINT, POSE, POSE_WITH_COVARIANCE, TRANSFORM)
}
Handler = Callable[[MessageBlock, IndexArray], object]


class _Dispatcher:
    """Gives the messages of each topic to the collector of its type."""

    def __init__(self, definitions: LegDefinitions, rate_kind: str) -> None:
        self.legs = LegCollector(definitions, rate_kind)
        self.walks = WalkCollector()
        self.clock = ClockCollector()
        self.points = PointCollector()
        self.iterations = IterationCollector()
        self.descriptions = Descriptions()
        self._handlers: dict[Topic, Handler | None] = {}
        # The readers of topics of legs and walkers, whose messages must be of their type.
        self._required: list[TopicReader] = []

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add the messages of a topic in a block."""
        if topic not in self._handlers:
            self._handlers[topic] = None if ANNOTATION in topic.extra else self._handler(topic)
        handle = self._handlers[topic]
        if handle is not None:
            handle(block, rows)

    def undecoded(self) -> Iterator[Undecoded]:
        """Yield the topics of legs and walkers with undecodable messages."""
        for reader in self._required:
            yield from reader.undecoded()

    def _handler(self, topic: Topic) -> Handler | None:
        """Return what takes the messages of a topic; None if nothing does."""
        name = topic.name.rpartition('/')[2]
        handler: Handler | None = None
        if is_leg_topic(topic) or (topic.type == ODOMETRY.name and name in ODOMETRY_TOPICS):
            handler = self._leg_handler(topic)
        elif (topic.type, topic.name) == (CLOCK.name, CLOCK_TOPIC):
            handler = partial(_add_batches, TopicReader(topic, CLOCK, ()), self.clock.add)
        elif (topic.type, name) == (STRING.name, DESCRIPTION):
            handler = partial(self.descriptions.add, topic)
        elif topic.type == DIAGNOSTICS.name:
            handler = self.iterations.add
        elif topic.type in _POINT_TYPES and name not in COMPUTED_TOPICS:
            reader = TopicReader(topic, _POINT_TYPES[topic.type], (POINT_FIELDS[topic.type],))
            handler = partial(_add_batches, reader, self.points.add)
        return handler

    def _leg_handler(self, topic: Topic) -> Handler:
        """Return what takes the messages of a topic of a leg or a walker."""
        message_type, paths, add = {
            JOINT_STATE.name: (JOINT_STATE, ('position', 'velocity', 'effort'), None),
            FLOAT64.name: (FLOAT64, ('data',), self.legs.add_angles),
            POINT.name: (POINT, ('point',), self.legs.add_feet),
            ODOMETRY.name: (ODOMETRY, ('pose.pose',), self.walks.add_poses),
        }[topic.type]
        reader = TopicReader(topic, message_type, paths, 'name')
        self._required.append(reader)
        if add is None:
            return partial(self._add_joints, reader)
        return partial(_add_batches, reader, add)

    def _add_joints(self, reader: TopicReader, block: MessageBlock, rows: IndexArray) -> None:
        for batch in reader.read(block, rows):
            if self.legs.lacks_positions(batch):
                reader.refuse(batch.times)
                continue
            self.legs.add_joints(batch)
            if batch.last_name in (COMMAND, STATE):
                self.walks.add_cranks(batch)


def _add_batches(
    reader: TopicReader, add: Callable[[Batch], object], block: MessageBlock, rows: IndexArray
) -> None:
    for batch in reader.read(block, rows):
        add(batch)


def load(
    log: 'Log | Window',
    robot: Robot | None = None,
    *,
    rates: str = '',
    progress: Callable[[float], object] | None = None,
) -> RunRecording:
    """Decode a log, or a window; see `review_run`. `progress` gets the read share, 0 to 1."""
    records = log.solvers
    receptions = TopicCollector()
    collected = _Dispatcher(LegDefinitions(records, robot), rates)
    for block in log.blocks(progress):
        for topic, rows in by_topic(block):
            receptions.add(topic, block, rows)
            collected.add(topic, block, rows)
    # Damage is known after reading only.
    pauses = [*_records(log, PAUSE_RECORD, recorded_pause)]
    # After a stall of the recorder, the solver needs time to answer.
    paused = ((p.begin, p.end + (MAX_RESPONSE_TIME if p.reason else 0)) for p in pauses)
    unrecorded = merge_intervals([*paused, *log.gaps])
    topics = receptions.topics(recorded_losses(log.metadata), unrecorded)
    clock = collected.clock.series()
    if is_time_of_log(clock):
        topics = tuple(map(_without_wall_times, topics))
    shared = ArrayPool()
    legs = [*collected.legs.legs(collected.iterations, collected.descriptions, shared, clock)]
    # Masses serve the efforts only.
    if collected.legs.has_efforts:
        legs = [replace(leg, solver=with_dynamics(leg, records, robot)) for leg in legs]
    return RunRecording(
        path=str(log.path),
        files=tuple((path.name, path.stat().st_size) for path in log.paths),
        start=min(log.start_time, LAST_TIME),
        end=min(log.end_time, LAST_TIME),
        topics=tuple(replace(topic, times=shared.share(topic.times)) for topic in topics),
        problems=log.problems,
        is_refused_only=log.is_refused_only,
        undecoded=tuple(collected.undecoded()),
        unrecorded=unrecorded,
        stalls=tuple(pause for pause in pauses if pause.reason),
        clock=clock,
        legs=tuple(legs),
        walks=tuple(collected.walks.walks(shared)),
        stopped=_file_faults(log, 'stopped'),
        file_fault=_file_faults(log, 'faults'),
        drives=tuple(collected.legs.drives(legs, shared)),
        measured=collected.points.series(shared),
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
    found = (record.get(key, '') for record in log.metadata.get(FAULT_RECORD, ()))
    return printable_line('; '.join(filter(None, found)))


def by_topic(block: MessageBlock) -> Iterator[tuple[Topic, IndexArray]]:
    """Yield the known topics of a block, with the rows of their messages."""
    channels = block.heads['channel']
    order = np.argsort(channels, kind='stable')
    ordered = channels[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    for channel, rows in zip(ordered[begins].tolist(), np.split(order, begins[1:]), strict=False):
        topic = block.topics.get(channel)
        if topic is not None:
            yield topic, rows


def _without_wall_times(topic: TopicRecording) -> TopicRecording:
    """Return a topic without latencies between wall time and simulated time."""
    with np.errstate(invalid='ignore'):
        mixed = np.abs(topic.latencies) > MAX_LATENCY
    return replace(topic, latencies=np.where(mixed, np.float32(np.nan), topic.latencies))
