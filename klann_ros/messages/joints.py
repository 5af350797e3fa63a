"""Joints of successive sensor_msgs/JointState messages, and numbers of std_msgs, one at a time."""

from collections.abc import Iterable, Sequence
import struct
from typing import NamedTuple

from klann_ros.sanitize.text import listed, printable

from .cdr import HEADER_SIZE, ORDERS
from .known_types import FLOAT32, FLOAT64, INT32, JOINT_STATE, POINT, TWIST_STAMPED
from .message_type import NumberPlaces, Template

# Names in the refusal of a message without the joint, and the joint's length [characters].
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
        self._joints = tuple(joints)
        self._places: _JointPlaces | None = None

    def read(self, data: bytes) -> dict[str, JointReading]:
        """Return the joints that are in a message; a ValueError without any, or if malformed."""
        # Most messages differ from the last one in their numbers only.
        if self._places is None or not self._places.numbers.fits(data):
            self._places = _find_joints(data, self._joints)
        places, joints, has_velocities, has_efforts = self._places
        sec, nanosec, *numbers = places.read(data)
        readings = {}
        for index, joint in enumerate(joints):
            velocity = numbers[index + len(joints)] if has_velocities else None
            effort = numbers[index - len(joints)] if has_efforts else None
            readings[joint] = JointReading(numbers[index], velocity, sec, nanosec, effort)
        return readings


class _JointPlaces(NamedTuple):
    """The stamp and the joints in a JointState: positions, and velocities and efforts if any."""

    numbers: NumberPlaces
    joints: list[str]
    has_velocities: bool
    has_efforts: bool


def _find_joints(data: bytes, joints: Sequence[str]) -> _JointPlaces:
    """Return the places of those joints that are in a message."""
    try:
        layout = JOINT_STATE.layout(data)
    except ValueError as error:
        raise ValueError(f'{len(data)} bytes are no {JOINT_STATE.name}') from error
    names = layout.texts['name']
    counts = {path: layout.span(path).length for path in ('position', 'velocity', 'effort')}
    if len(names) != counts['position']:
        text = f'{len(names)} names and {counts["position"]} positions'
        raise ValueError(f'{text}: there must be as many of each')
    indices = sorted((names.index(j.encode()), j) for j in joints if j.encode() in names)
    if not indices:
        name = printable(joints[-1], _MAX_NAME_LENGTH)
        listing = listed([joint.decode(errors='replace') for joint in names], _MAX_NAMES)
        raise ValueError(f'there is no joint {name} among its {len(names)} ({listing})')
    paths = ['header.stamp.sec', 'header.stamp.nanosec']
    complete = [path for path, count in counts.items() if count == len(names)]
    for path in complete:
        paths += [f'{path}[{index}]' for index, _ in indices]
    present_joints = [joint for _, joint in indices]
    places = NumberPlaces(layout, paths)
    return _JointPlaces(places, present_joints, 'velocity' in complete, 'effort' in complete)


class JointStateTemplate:
    """A sensor_msgs/JointState of which only stamp, positions and velocities change."""

    def __init__(self, names: Sequence[str], frame_id: str = '') -> None:
        zeros = [0.0] * len(names)
        content = {'header.frame_id': frame_id, 'name': names, 'position': zeros}
        self._still = Template(JOINT_STATE, content, ['position'])
        moving = {**content, 'velocity': zeros}
        self._moving = Template(JOINT_STATE, moving, ['position', 'velocity'])
        # Offset of the first position [bytes].
        self.first_number = self._still.first_number

    def fill(
        self, sec: int, nanosec: int, positions: Sequence[float], velocities: Sequence[float] = ()
    ) -> bytes:
        """Return the message; there are as many velocities as names, or none."""
        if not velocities:
            return self._still.fill(sec, nanosec, *positions)
        # The number of velocities stands before them.
        (count,) = self._moving.constants
        return self._moving.fill(sec, nanosec, *positions, count, *velocities)


def point_template(frame_id: str) -> Template:
    """Return a geometry_msgs/PointStamped of which only stamp, x and y change; z is 0."""
    return Template(POINT, {'header.frame_id': frame_id}, ['point.x', 'point.y'])


def twist_template(frame_id: str) -> Template:
    """Return a geometry_msgs/TwistStamped of which only stamp, linear x and y change."""
    content = {'header.frame_id': frame_id}
    return Template(TWIST_STAMPED, content, ['twist.linear.x', 'twist.linear.y'])
