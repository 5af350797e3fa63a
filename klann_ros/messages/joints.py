"""Joints of successive sensor_msgs/JointState messages, and numbers of std_msgs, one at a time."""

from collections.abc import Iterable, Sequence
import struct
from typing import NamedTuple

from klann_ros.sanitize.text import printable

from .cdr import HEADER_SIZE, ORDERS, STAMP_SIZE
from .known_types import FLOAT32, FLOAT64, INT32, JOINT_STATE, POINT, TWIST_STAMPED
from .message_type import Template

# Names in the refusal of a message without the joint, and their length [characters].
_MAX_NAMES = 5
_MAX_NAME_LENGTH = 40
# The types that angles come in, by their names.
_NUMBER_TYPES = {kind.name: kind for kind in (FLOAT32, FLOAT64, INT32)}


class JointReading(NamedTuple):
    """A joint in a JointState."""

    # [rad] of a revolute joint.
    position: float
    # None unless there are as many velocities as names.
    velocity: float | None
    sec: int
    nanosec: int
    # [N m] of a revolute joint; None unless there are as many efforts as names.
    effort: float | None = None


class NumberReader:
    """Read the number in messages of a type: Float64, Float32 or Int32 of std_msgs."""

    def __init__(self, type_name: str) -> None:
        self._type_name = type_name
        code = _NUMBER_TYPES[type_name].fields[0].kind
        self._structs = {begin: struct.Struct(order + code) for begin, order in ORDERS.items()}

    def read(self, data: bytes) -> float:
        """Return the number; a ValueError for another message."""
        try:
            (number,) = self._structs[data[:2]].unpack_from(data, HEADER_SIZE)
        except (KeyError, struct.error) as error:
            raise ValueError(f'{len(data)} bytes are no {self._type_name}') from error
        return float(number)


class JointsReader:
    """Read joints of successive sensor_msgs/JointState messages."""

    def __init__(self, joints: Iterable[str]) -> None:
        self._places: dict[str, _JointPlace | None] = dict.fromkeys(joints)

    def read(self, data: bytes) -> dict[str, JointReading]:
        """Return the joints that are in a message; a ValueError without any, or if malformed."""
        readings = {}
        refusal = ValueError()
        for joint, last_place in self._places.items():
            place = last_place
            # Most messages differ from the last one in their numbers only.
            if place is None or not place.fits(data):
                try:
                    place = self._places[joint] = _find_joint(data, joint)
                except ValueError as error:
                    refusal = error
                    continue
            readings[joint] = place.read(data)
        if not readings:
            raise refusal
        return readings


class _JointPlace(NamedTuple):
    """The place of a joint's numbers in a JointState, and the bytes that identify its layout."""

    size: int
    # All but stamp, positions, velocities and efforts, with their offsets.
    constants: tuple[bytes, ...]
    offsets: tuple[int, ...]
    numbers: struct.Struct
    has_velocity: bool
    has_effort: bool

    def fits(self, data: bytes) -> bool:
        return len(data) == self.size and all(map(data.startswith, self.constants, self.offsets))

    def read(self, data: bytes) -> JointReading:
        sec, nanosec, position, *optional = self.numbers.unpack_from(data)
        velocity = optional[0] if self.has_velocity else None
        effort = optional[-1] if self.has_effort else None
        return JointReading(position, velocity, sec, nanosec, effort)


def _find_joint(data: bytes, joint: str) -> _JointPlace:
    """Return the place of a joint in messages that are like this one."""
    try:
        layout = JOINT_STATE.layout(data)
    except ValueError as error:
        raise ValueError(f'{len(data)} bytes are no {JOINT_STATE.name}') from error
    names = layout.texts['name']
    spans = [layout.span(path) for path in ('position', 'velocity', 'effort')]
    if len(names) != spans[0].length:
        raise ValueError(
            f'{len(names)} names and {spans[0].length} positions: there must be as many of each'
        )
    if joint.encode() not in names:
        name = printable(joint, _MAX_NAME_LENGTH)
        raise ValueError(f'there is no joint {name} among its {len(names)} ({_listed(names)})')
    index = names.index(joint.encode())
    numbers = f'{layout.order}{HEADER_SIZE}xiI'
    stamp_end = HEADER_SIZE + STAMP_SIZE
    last_end = stamp_end
    for span in spans:
        if span.length == len(names):
            begin = span.begin + 8 * index
            numbers += f'{begin - last_end}xd'
            last_end = begin + 8
    # All but stamp, positions, velocities and efforts is constant.
    offsets = (0, stamp_end, spans[0].end, spans[1].end)
    ends = (2, *(span.begin for span in spans))
    return _JointPlace(
        len(data),
        tuple(data[begin:end] for begin, end in zip(offsets, ends, strict=True)),
        offsets,
        struct.Struct(numbers),
        has_velocity=spans[1].length == len(names),
        has_effort=spans[2].length == len(names),
    )


def _listed(names: Sequence[bytes]) -> str:
    first_names = [name.decode(errors='replace') for name in names[:_MAX_NAMES]]
    text = ', '.join(printable(name, _MAX_NAME_LENGTH) for name in first_names)
    return text if len(names) <= _MAX_NAMES else f'{text}, ...'


class JointStateTemplate:
    """A sensor_msgs/JointState of which only stamp, positions and velocities change."""

    def __init__(self, names: Sequence[str], frame_id: str = '') -> None:
        zeros = [0.0] * len(names)
        content = {'header.frame_id': frame_id, 'name': names, 'position': zeros}
        self._still = Template(JOINT_STATE, content, ['position'])
        moving = {**content, 'velocity': zeros}
        self._moving = _MovingTemplate(JOINT_STATE, moving, ['position', 'velocity'])
        # Offset of the first position [bytes].
        self.first_number = self._still.first_number

    def fill(
        self, sec: int, nanosec: int, positions: Sequence[float], velocities: Sequence[float] = ()
    ) -> bytes:
        """Return the message; there are as many velocities as names, or none."""
        if velocities:
            return self._moving.fill_both(sec, nanosec, positions, velocities)
        return self._still.fill(sec, nanosec, *positions)


class _MovingTemplate(Template):
    """A JointState with velocities, whose number stands before them."""

    def fill_both(
        self, sec: int, nanosec: int, positions: Sequence[float], velocities: Sequence[float]
    ) -> bytes:
        (count,) = self._constants
        return self._pack(self._head, sec, nanosec, self._texts, *positions, count, *velocities)


def point_template(frame_id: str) -> Template:
    """Return a geometry_msgs/PointStamped of which only stamp, x and y change; z is 0."""
    return Template(POINT, {'header.frame_id': frame_id}, ['point.x', 'point.y'])


def twist_template(frame_id: str) -> Template:
    """Return a geometry_msgs/TwistStamped of which only stamp, linear x and y change."""
    content = {'header.frame_id': frame_id}
    return Template(TWIST_STAMPED, content, ['twist.linear.x', 'twist.linear.y'])
