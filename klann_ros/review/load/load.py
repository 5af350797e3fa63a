"""From a log to a recording: what concerns legs decoded, all the rest counted."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import (
    FINDING_RECORD,
    HARM_RECORD,
    Pause,
    pause_of,
    PAUSE_RECORD,
    told_finding,
    ToldFinding,
)
from klann_ros.review.model.recording import (
    Drive,
    LegRecording,
    no_series,
    RunRecording,
    Series,
)
from klann_ros.review.model.simulated_time import is_simulated, is_time_of_log
from klann_ros.review.model.times import Hole, LAST_TIME, merged, RowIndices
from klann_ros.review.model.topics import TopicRecording
from klann_ros.review.model.unanswered import SOON
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable_line
import numpy as np

from .columns import Shared
from .gathering import ALL_JOINTS, Gathering
from .other_topics import Descriptions, Iterations, SimulatedTime
from .solvers import Metadata, solver_records
from .topics import recorded_losses, TopicTally
from .walks import Walks
from .weights import dynamics_of

# A greater latency is from one clock to another [s].
MAX_LATENCY = 3600.0


class Loadable(Protocol):
    """What can be loaded: an open log, or what looks like one. See `klann_ros.log.reader.Log`."""

    path: Path

    @property
    def metadata(self) -> Metadata:
        """Return the contents of its metadata records under their names."""

    @property
    def paths(self) -> Sequence[Path]:
        """Return its files."""

    @property
    def start_time(self) -> int:
        """Return the log time of the earliest message [ns]."""

    @property
    def end_time(self) -> int:
        """Return that of the latest."""

    @property
    def problems(self) -> tuple[str, ...]:
        """Return what is wrong with it."""

    @property
    def holes(self) -> tuple[Hole, ...]:
        """Return the log times of what is damaged."""

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """Yield the messages in large pieces."""


def load(
    log: Loadable,
    robot: Robot | None = None,
    *,
    rates: str = '',
    progress: Callable[[float], object] | None = None,
) -> RunRecording:
    """Decode a log; see `review_run`. `progress` gets how much was read, from 0 to 1."""
    records = solver_records(log.metadata)
    gathering = Gathering(records, robot, rates=rates)
    tally, iterations, descriptions = TopicTally(), Iterations(), Descriptions()
    walks, simulated = Walks(), SimulatedTime()
    for block in log.blocks(progress):
        for topic, rows in by_topic(block):
            tally.add(topic, block, rows)
            pieces = gathering.add(topic, block, rows)
            iterations.add(topic, block, rows)
            descriptions.add(topic, block, rows)
            simulated.add(topic, block, rows)
            walks.add(topic, block, rows, pieces)
    # Reading finds what an index hides, so this comes last.
    pauses = [*_pauses(log.metadata.get(PAUSE_RECORD, ()))]
    # After a stall of the recorder all others have to run again, too.
    ends = ((pause.begin, pause.end + (SOON if pause.reason else 0)) for pause in pauses)
    holes = merged([*ends, *log.holes])
    shared = Shared()
    topics = tally.topics(recorded_losses(log.metadata), holes)
    clock = simulated.series()
    if is_time_of_log(clock):
        topics = tuple(map(_without_wall_times, topics))
    drives = gathering.efforts
    legs = [
        # What nobody asks for is not weighed.
        leg if not drives else replace(leg, solver=dynamics_of(leg, records, robot))
        for leg in _legs(gathering, iterations, descriptions, shared, clock)
    ]
    return RunRecording(
        path=str(log.path),
        files=tuple((path.name, path.stat().st_size) for path in log.paths),
        start=min(log.start_time, LAST_TIME),
        end=min(log.end_time, LAST_TIME),
        topics=tuple(replace(topic, times=shared.one(topic.times)) for topic in topics),
        problems=log.problems,
        undecoded=(*gathering.undecoded(), *walks.undecoded()),
        holes=holes,
        stalls=tuple(pause for pause in pauses if pause.reason),
        clock=clock,
        legs=tuple(legs),
        walks=tuple(walks.walks(shared)),
        stopped=_harm(log, 'stopped'),
        harmed=_harm(log, 'harmed'),
        drives=tuple(_drives(gathering, legs, shared)),
        told=tuple(_told(log)),
    )


def _told(log: Loadable) -> Iterator[ToldFinding]:
    """Yield what the recorder told while it recorded."""
    for record in log.metadata.get(FINDING_RECORD, ()):
        with suppress(ValueError):
            yield told_finding(record)


def _drives(gathering: Gathering, legs: Sequence[LegRecording], shared: Shared) -> Iterator[Drive]:
    """Yield the joints that tell efforts, with the legs that they turn."""
    for (namespace, joint), columns in gathering.efforts.items():
        there = [(k, leg) for k, leg in enumerate(legs) if leg.namespace == namespace]
        own = [k for k, leg in there if leg.crank_pose_joint == joint]
        turned = own or [k for k, leg in there if leg.solver.crank_joint == joint]
        if turned:
            yield Drive(joint, tuple(turned), not own, columns.series(shared))


def _harm(log: Loadable, key: str) -> str:
    """Return what the recorder tells of what was done to it, in one line."""
    found = (record.get(key, '') for record in log.metadata.get(HARM_RECORD, ()))
    return printable_line('; '.join(filter(None, found)))


def by_topic(block: MessageBlock) -> Iterator[tuple[Topic, RowIndices]]:
    """Yield the topics in a block that are known, and which messages are theirs."""
    channels = block.heads['channel']
    order = np.argsort(channels, kind='stable')
    ordered = channels[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    for channel, rows in zip(ordered[begins].tolist(), np.split(order, begins[1:]), strict=False):
        topic = block.topics.get(channel)
        if topic is not None:
            yield topic, rows


def _legs(
    gathering: Gathering,
    iterations: Iterations,
    descriptions: Descriptions,
    shared: Shared,
    clock: Series,
) -> Iterator[LegRecording]:
    """Yield the legs of solvers with poses; where there is none at all, what else is of a leg."""
    feet = {namespace: columns.series(shared) for namespace, columns in gathering.feet.items()}
    cranks = {place: columns.series(shared) for place, columns in gathering.cranks.items()}
    unstamped = {place: times.array() for place, times in gathering.unstamped.items()}
    places = gathering.places() or sorted({(namespace, '') for namespace, _ in cranks})
    for namespace, name in places or [(path, '') for path in sorted(feet)]:
        solver = gathering.solver(namespace, name)
        columns = gathering.poses.get((namespace, name))
        poses = columns.series(shared) if columns else no_series(len(solver.joint_names))
        if solver.leg is None:
            solver = descriptions.described(solver, namespace, name, poses)
        if is_simulated(poses, clock):
            solver = replace(solver, sim_time=True)
        rates = gathering.rates.get((namespace, name))
        joints = [(namespace, joint) for joint in (ALL_JOINTS, solver.crank_joint)]
        yield LegRecording(
            namespace,
            name,
            solver,
            frozenset(gathering.pose_topics.get((namespace, name), ())),
            frozenset().union(*(gathering.crank_topics.get(joint, ()) for joint in joints)),
            cranks=_merged([cranks[joint] for joint in joints if joint in cranks]),
            poses=poses,
            iterations=iterations.series(name),
            feet=feet.get(f'{namespace}/{name}' if name else namespace, no_series(2)),
            unstamped=np.sort(
                np.concatenate(
                    [np.empty(0, np.int64), *(unstamped.get(joint, ()) for joint in joints)]
                )
            ),
            **({'rates': rates.series(shared).values} if rates else {}),
        )


def _merged(inputs: list[Series]) -> Series:
    """Return the inputs of several topics by their log times."""
    if len(inputs) == 1:
        return inputs[0]
    if not inputs:
        return no_series(1)
    times = np.concatenate([series.times for series in inputs])
    order = np.argsort(times, kind='stable')
    stamps = np.concatenate([series.stamps for series in inputs])
    values = np.concatenate([series.values for series in inputs])
    return Series(times[order], stamps[order], values[order])


def _pauses(records: Iterable[Mapping[str, str]]) -> Iterator[Pause]:
    """Yield the pauses and stalls of the recorder, as its records say."""
    for record in records:
        with suppress(ValueError):
            yield pause_of(record)


def _without_wall_times(topic: TopicRecording) -> TopicRecording:
    """Return a topic without latencies from the wall time of sending to a simulated log time."""
    with np.errstate(invalid='ignore'):
        mixed = np.abs(topic.latencies) > MAX_LATENCY
    return replace(topic, latencies=np.where(mixed, np.float32(np.nan), topic.latencies))
