"""From a log to a recording: decode what concerns the leg, count the rest."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from klann_ros.kinematics import GeometryError, KlannGeometry
from klann_ros.kinematics.geometry import BENDS, COORDINATES, LENGTHS
from klann_ros.log.errors import LogError
from klann_ros.log.loss import LossCounter
from klann_ros.log.reader import Log
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import solver_parameters, SOLVER_RECORD
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import yaml

from .recording import Recording, TopicFigures

JOINTS = ('alpha', 'gamma', 'beta', 'delta', 'theta')
CRANK_JOINT = 'crank'

Decoder = Callable[[bytes], Any]


class GeometryFileError(LogError):
    """A file that holds no geometry; the text says why."""


@dataclass
class _Times:
    log: list[int] = field(default_factory=list)
    publish: list[int] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)


class _Rows:
    """Collects what is decoded, row by row."""

    def __init__(self, crank_joint: str) -> None:
        self.crank_joint = crank_joint
        self.cranks: list[tuple[int, float]] = []
        self.poses: list[tuple[int, tuple[float, ...]]] = []
        self.feet: list[tuple[int, tuple[float, float]]] = []

    def add(self, message: Message, decoded: Any) -> None:
        """Add a message of a topic that concerns the leg."""
        kind = message.topic.type
        if kind == 'std_msgs/msg/Float64':
            self.cranks.append((message.publish_time, decoded.data))
        elif kind == 'geometry_msgs/msg/PointStamped':
            self.feet.append((_stamp(decoded), (decoded.point.x, decoded.point.y)))
        else:
            self._add_joint_state(message, decoded)

    def _add_joint_state(self, message: Message, decoded: Any) -> None:
        names, positions = list(decoded.name), decoded.position
        if len(names) != len(positions):
            return
        if set(JOINTS) <= set(names):
            angles = tuple(positions[names.index(joint)] for joint in JOINTS)
            self.poses.append((_stamp(decoded), angles))
        elif self.crank_joint in names:
            # The solver takes the source time for a stamp that is zero.
            stamp = _stamp(decoded) or message.publish_time
            self.cranks.append((stamp, positions[names.index(self.crank_joint)]))


def load(log: Log, geometry: KlannGeometry | None = None) -> Recording:
    """
    Decode a log.

    Parameters
    ----------
    log : Log
        An open log.
    geometry : KlannGeometry, optional
        What to hold the run against, instead of the geometry in it.

    """
    parameters = _parameters(log)
    rows = _Rows(str(parameters.get('crank_joint', CRANK_JOINT)))
    times: dict[Topic, _Times] = defaultdict(_Times)
    decoders = _decoders(log)
    for message in log.messages():
        seen = times[message.topic]
        seen.log.append(message.log_time)
        seen.publish.append(message.publish_time)
        seen.sequences.append(message.sequence)
        if message.topic in decoders:
            rows.add(message, decoders[message.topic](message.data))
    return Recording(
        path=', '.join(str(path) for path in log.paths),
        start=log.start_time,
        end=log.end_time,
        topics=tuple(_figures(topic, times[topic]) for topic in log.topics if topic in times),
        # Reading finds what an index hides, so this comes last.
        problem=log.problem,
        geometry=geometry or _geometry(parameters),
        crank_stamps=_stamps(rows.cranks),
        crank_angles=np.array([angle for _, angle in rows.cranks], dtype=np.float64),
        pose_stamps=_stamps(rows.poses),
        poses=np.array([pose for _, pose in rows.poses]).reshape(-1, len(JOINTS)),
        foot_stamps=_stamps(rows.feet),
        feet=np.array([foot for _, foot in rows.feet]).reshape(-1, 2),
    )


def geometry_from_file(path: str) -> KlannGeometry:
    """
    Return the geometry in a YAML file: a parameter file of solver_node, or a mapping of lengths.

    Raises
    ------
    GeometryFileError
        The file cannot be read, or holds no geometry.

    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
        parameters = _ros_parameters(content)
        return KlannGeometry(**_numbers(parameters))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, GeometryError) as error:
        msg = f'{path} holds no geometry: {" ".join(str(error).split())}'
        raise GeometryFileError(msg) from error


def _ros_parameters(content: Any) -> Mapping[str, Any]:
    if not isinstance(content, dict):
        msg = 'it must be a mapping, such as config/sem104.yaml is'
        raise TypeError(msg)
    for value in content.values():
        if isinstance(value, dict):
            return value.get('ros__parameters', value)  # type: ignore[no-any-return]
    return content


def _numbers(parameters: Mapping[str, Any]) -> dict[str, Any]:
    names = (*LENGTHS, *COORDINATES, *BENDS, 'assembly')
    numbers = {name: parameters[name] for name in names if name in parameters}
    if not numbers:
        msg = f'none of {", ".join(names)} is in it'
        raise TypeError(msg)
    return numbers


def _parameters(log: Log) -> Mapping[str, Any]:
    """Return the parameters of the last solver that the run tells of; none if it does not."""
    records = log.metadata.get(SOLVER_RECORD)
    try:
        return solver_parameters(records[-1])[1] if records else {}
    except ValueError:
        return {}


def _geometry(parameters: Mapping[str, Any]) -> KlannGeometry | None:
    try:
        return KlannGeometry(**_numbers(parameters))
    except (TypeError, GeometryError):
        return None


def _decoders(log: Log) -> dict[Topic, Decoder]:
    """Return a decoder for each topic that concerns the leg."""
    wanted = {
        'crank_angle': 'std_msgs/msg/Float64',
        'crank_state': 'sensor_msgs/msg/JointState',
        'joint_states': 'sensor_msgs/msg/JointState',
        'point_h': 'geometry_msgs/msg/PointStamped',
    }
    factory, decoders = DecoderFactory(), {}
    for number, topic in enumerate(log.topics, start=1):
        if wanted.get(topic.name.rpartition('/')[2]) == topic.type:
            schema = Schema(
                id=number,
                data=topic.definition.encode(),
                encoding=topic.schema_encoding,
                name=topic.type,
            )
            decoder = factory.decoder_for(topic.message_encoding, schema)
            if decoder is not None:
                decoders[topic] = decoder
    return decoders


def _figures(topic: Topic, times: _Times) -> TopicFigures:
    gaps = np.diff(np.array(times.log)) / 1e9
    latencies = (np.array(times.log) - np.array(times.publish)) / 1e9
    return TopicFigures(
        name=topic.name,
        type=topic.type,
        count=len(times.log),
        rate=1.0 / float(gaps.mean()) if gaps.any() else float('nan'),
        longest_gap=float(gaps.max()) if gaps.size else float('nan'),
        latency=float(np.median(latencies)),
        lost=_lost(topic, times.sequences),
    )


def _lost(topic: Topic, sequences: Iterable[int]) -> int | None:
    """Count by sequence numbers, where there are any and they are one publisher's."""
    counter, known = LossCounter(), False
    for sequence in sequences:
        known = known or sequence != 0
        # Sequence numbers begin at 1; 0 is what recorders write that do not know them.
        counter.count(sequence or None)
    publishers = topic.qos.count('history:')
    return counter.lost if known and publishers <= 1 else None


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _stamps(rows: Iterable[tuple[int, Any]]) -> np.ndarray[Any, np.dtype[np.int64]]:
    return np.array([stamp for stamp, _ in rows], dtype=np.int64)
