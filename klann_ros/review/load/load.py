"""From a log to a recording: messages of legs are decoded, all others counted."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

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
from klann_ros.review.model.answers import MAX_RESPONSE_TIME
from klann_ros.review.model.recording import Drive, LegRecording, RunRecording
from klann_ros.review.model.times import (
    is_simulated,
    is_time_of_log,
    LAST_TIME,
    merge_intervals,
    no_series,
    Series,
)
from klann_ros.review.model.topics import TopicRecording
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable_line
import numpy as np

from .geometry import Descriptions, with_dynamics
from .legs import ALL_JOINTS, LegCollector
from .series import (
    ArrayPool,
    ClockCollector,
    IterationCollector,
    PointCollector,
    WalkCollector,
)
from .topics import recorded_losses, TopicCollector

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
    legs_ = LegCollector(records, robot, rates=rates)
    topics_, iterations, descriptions = TopicCollector(), IterationCollector(), Descriptions()
    walks, simulated, points = WalkCollector(), ClockCollector(), PointCollector()
    for block in log.blocks(progress):
        for topic, rows in by_topic(block):
            topics_.add(topic, block, rows)
            if ANNOTATION in topic.extra:
                continue
            pieces = legs_.add(topic, block, rows)
            iterations.add(topic, block, rows)
            descriptions.add(topic, block, rows)
            simulated.add(topic, block, rows)
            walks.add(topic, pieces)
            points.add(topic, block, rows)
    # Damage is known after reading only.
    pauses = [*_records(log, PAUSE_RECORD, recorded_pause)]
    # After a stall of the recorder, the solver needs time to answer.
    paused = ((p.begin, p.end + (MAX_RESPONSE_TIME if p.reason else 0)) for p in pauses)
    unrecorded = merge_intervals([*paused, *log.gaps])
    shared = ArrayPool()
    topics = topics_.topics(recorded_losses(log.metadata), unrecorded)
    clock = simulated.series()
    if is_time_of_log(clock):
        topics = tuple(map(_without_wall_times, topics))
    legs = [*_legs(legs_, iterations, descriptions, shared, clock)]
    # Masses serve the efforts only.
    if legs_.efforts:
        legs = [replace(leg, solver=with_dynamics(leg, records, robot)) for leg in legs]
    return RunRecording(
        path=str(log.path),
        files=tuple((path.name, path.stat().st_size) for path in log.paths),
        start=min(log.start_time, LAST_TIME),
        end=min(log.end_time, LAST_TIME),
        topics=tuple(replace(topic, times=shared.one(topic.times)) for topic in topics),
        problems=log.problems,
        undecoded=tuple(legs_.undecoded()),
        unrecorded=unrecorded,
        stalls=tuple(pause for pause in pauses if pause.reason),
        clock=clock,
        legs=tuple(legs),
        walks=tuple(walks.walks(shared)),
        stopped=_file_faults(log, 'stopped'),
        file_fault=_file_faults(log, 'faults'),
        drives=tuple(_drives(legs_, legs, shared)),
        measured=points.series(shared),
        recorder_findings=tuple(_records(log, FINDING_RECORD, recorded_finding)),
    )


def _records(
    log: 'Log | Window', name: str, parse: Callable[[Mapping[str, str]], RecordT]
) -> Iterator[RecordT]:
    """Yield the valid records of the recorder of one kind."""
    for record in log.metadata.get(name, ()):
        with suppress(ValueError):
            yield parse(record)


def _drives(
    legs_: LegCollector, legs: Sequence[LegRecording], shared: ArrayPool
) -> Iterator[Drive]:
    """Yield the joints with efforts, with their legs."""
    for (namespace, joint), columns in legs_.efforts.items():
        there = [(k, leg) for k, leg in enumerate(legs) if leg.namespace == namespace]
        own = [k for k, leg in there if leg.crank_pose_joint == joint]
        turned = own or [k for k, leg in there if leg.solver.crank_joint == joint]
        if turned:
            yield Drive(joint, tuple(turned), not own, columns.series(shared))


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


def _legs(
    legs_: LegCollector,
    iterations: IterationCollector,
    descriptions: Descriptions,
    shared: ArrayPool,
    clock: Series,
) -> Iterator[LegRecording]:
    """Yield the legs of solvers with poses; without any, legs with inputs or feet only."""
    feet = {namespace: columns.series(shared) for namespace, columns in legs_.feet.items()}
    cranks = {place: columns.series(shared) for place, columns in legs_.cranks.items()}
    nothing = np.empty(0, dtype=np.int64)
    unstamped = {place: times.array() for place, times in legs_.unstamped.items()}
    places = legs_.places() or sorted({(namespace, '') for namespace, _ in cranks})
    for namespace, name in places or [(path, '') for path in sorted(feet)]:
        solver = legs_.solver(namespace, name)
        columns = legs_.poses.get((namespace, name))
        poses = columns.series(shared) if columns else no_series(len(solver.joint_names))
        if solver.leg is None:
            solver = descriptions.described(solver, namespace, name, poses)
        if is_simulated(poses, clock):
            solver = replace(solver, sim_time=True)
        rates = legs_.rates.get((namespace, name))
        joints = [(namespace, joint) for joint in (ALL_JOINTS, solver.crank_joint)]
        yield LegRecording(
            namespace,
            name,
            solver,
            frozenset(legs_.pose_topics.get((namespace, name), ())),
            frozenset().union(*(legs_.crank_topics.get(joint, ()) for joint in joints)),
            cranks=_merged([cranks[joint] for joint in joints if joint in cranks]),
            poses=poses,
            iterations=iterations.series(name),
            feet=feet.get(f'{namespace}/{name}' if name else namespace, no_series(2)),
            unstamped=np.sort(
                np.concatenate([nothing, *(unstamped.get(joint, ()) for joint in joints)])
            ),
            **({'rates': rates.series(shared).values} if rates else {}),
        )


def _merged(inputs: list[Series]) -> Series:
    """Return the inputs of several topics by their log times."""
    if len(inputs) < 2:
        return inputs[0] if inputs else no_series(1)
    times, stamps, values = (
        np.concatenate([getattr(series, name) for series in inputs])
        for name in ('times', 'stamps', 'values')
    )
    order = np.argsort(times, kind='stable')
    return Series(times[order], stamps[order], values[order])


def _without_wall_times(topic: TopicRecording) -> TopicRecording:
    """Return a topic without latencies between wall time and simulated time."""
    with np.errstate(invalid='ignore'):
        mixed = np.abs(topic.latencies) > MAX_LATENCY
    return replace(topic, latencies=np.where(mixed, np.float32(np.nan), topic.latencies))
