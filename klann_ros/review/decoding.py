"""From a message's bytes to what it says about a leg."""

from array import array
from collections.abc import Callable, Sequence
from typing import Any

from klann_ros.kinematics.klann.pose import JOINTS
from klann_ros.kinematics.leg_types import Leg
from klann_ros.log.records import Message, Topic
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
import numpy as np

from .recording import Series, Undecoded
from .solvers import LegSolver

CRANK_ANGLE = 'std_msgs/msg/Float64'
FOOT = 'geometry_msgs/msg/PointStamped'
JOINT_STATE = 'sensor_msgs/msg/JointState'
# A JointState tells by its joints what it is; of numbers and points there are many others.
LAST_PARTS = {CRANK_ANGLE: 'crank_angle', FOOT: 'point_h'}

_INT64 = np.iinfo(np.int64)

Decoder = Callable[[bytes], Any]

# A message of the three types is much smaller; what a small file unpacks to may be anything.
MAX_MESSAGE = 256 * 1024


def may_tell_a_leg(topic: Topic) -> bool:
    """Return whether a topic's messages may say something about a leg."""
    last_part = topic.name.rpartition('/')[2]
    return topic.type == JOINT_STATE or LAST_PARTS.get(topic.type) == last_part


def nanoseconds(time: int) -> int:
    """Return a time as one that fits into an array: a log may hold any 64 bits."""
    return min(max(time, int(_INT64.min)), int(_INT64.max))


class Rows:
    """
    Rows of a log time, a stamp [ns] and numbers, in arrays: there may be a million of them.

    Parameters
    ----------
    columns : int
        How many numbers a row has; 0 for one that is no column of a table.

    """

    def __init__(self, columns: int = 0) -> None:
        self.times = array('q')
        self._stamps = array('q')
        self._values = array('d')
        self._shape = (-1, columns) if columns else (-1,)

    def __len__(self) -> int:
        return len(self.times)

    def add(self, time: int, stamp: int, *values: float) -> None:
        """Add a row."""
        self.times.append(time)
        self._stamps.append(stamp)
        self._values.extend(values)

    def series(self) -> Series:
        """Return the rows as arrays that do not change any more."""
        return Series(
            np.array(self.times, dtype=np.int64),
            np.array(self._stamps, dtype=np.int64),
            np.array(self._values, dtype=np.float64).reshape(self._shape),
        )


class LegRows:
    """
    Collects what is said about the leg in a namespace, row by row.

    Parameters
    ----------
    solver : LegSolver
        What the run tells of its solver.
    given : KlannLeg or LinkageLeg, optional
        The leg it is held against, instead of the solver's.

    """

    def __init__(self, solver: LegSolver, given: Leg | None = None) -> None:
        self.solver = solver
        self.leg = given or solver.leg
        # A run that tells no leg may still hold the poses of a Klann leg.
        self.joint_names = self.leg.joint_names if self.leg else JOINTS
        self.cranks = Rows()
        self.poses = Rows(len(self.joint_names))
        self.feet = Rows(2)

    def __len__(self) -> int:
        return len(self.cranks) + len(self.poses) + len(self.feet)

    def add(self, message: Message, decoded: Any) -> None:
        """Add what a message says; raise whatever comes of a field that is not there."""
        kind, time = message.topic.type, nanoseconds(message.log_time)
        if kind == CRANK_ANGLE:
            self._add_crank(message, 0, decoded.data)
        elif kind == FOOT:
            foot = (float(decoded.point.x), float(decoded.point.y))
            self.feet.add(time, _stamp(decoded), *foot)
        else:
            self._add_joint_state(message, decoded)

    def _add_joint_state(self, message: Message, decoded: Any) -> None:
        names, positions = list(decoded.name), decoded.position
        if len(names) != len(positions):
            return
        if set(self.joint_names) <= set(names):
            pose = tuple(float(positions[names.index(joint)]) for joint in self.joint_names)
            self.poses.add(nanoseconds(message.log_time), _stamp(decoded), *pose)
        elif self.solver.crank_joint in names:
            angle = positions[names.index(self.solver.crank_joint)]
            self._add_crank(message, _stamp(decoded), angle)

    def _add_crank(self, message: Message, stamp: int, angle: Any) -> None:
        """Add a crank input; the solver takes the source time for a stamp that is zero."""
        if stamp == 0 and self.solver.sim_time:
            # Its answer has the simulated time of a moment that the run does not tell.
            return
        stamp = stamp or nanoseconds(message.publish_time)
        self.cranks.add(nanoseconds(message.log_time), stamp, float(angle))


class LegDecoder:
    """Decodes what may tell a leg, and counts what stands in the way."""

    def __init__(self, topics: Sequence[Topic]) -> None:
        self._factory = DecoderFactory()
        self._decoders = {
            topic: self._decoder(topic, number)
            for number, topic in enumerate(topics, start=1)
            if may_tell_a_leg(topic)
        }
        self._failures: dict[str, list[int]] = {}

    def add(self, message: Message, rows: LegRows) -> None:
        """Add to the rows what a message says."""
        if message.topic not in self._decoders:
            return
        try:
            rows.add(message, self._decode(message))
        except Exception:  # noqa: BLE001, RUF100 - the bytes, and their schema, may be anything
            self._failures.setdefault(message.topic.name, []).append(message.log_time)

    def undecoded(self) -> tuple[Undecoded, ...]:
        """Return what could not be decoded so far."""
        return tuple(
            Undecoded(name, len(times), nanoseconds(min(times)))
            for name, times in self._failures.items()
        )

    def _decode(self, message: Message) -> Any:
        decoder = self._decoders[message.topic]
        if decoder is None:
            msg = f'no decoder for {message.topic.name}'
            raise ValueError(msg)
        if len(message.data) > MAX_MESSAGE:
            msg = f'{len(message.data)} bytes, more than the limit of {MAX_MESSAGE}'
            raise ValueError(msg)
        return decoder(message.data)

    def _decoder(self, topic: Topic, number: int) -> Decoder | None:
        schema = Schema(
            id=number,
            data=topic.definition.encode(),
            encoding=topic.schema_encoding,
            name=topic.type,
        )
        try:
            return self._factory.decoder_for(topic.message_encoding, schema)
        except Exception:  # noqa: BLE001, RUF100 - as above
            return None


def _stamp(decoded: Any) -> int:
    stamp = decoded.header.stamp
    return nanoseconds(int(stamp.sec) * 10**9 + int(stamp.nanosec))
