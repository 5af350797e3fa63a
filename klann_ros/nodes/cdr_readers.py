"""
Serialized messages (CDR), read by `struct` alone.

Conversion between bytes and a Python message costs more than the solution of a pose. Here only the
needed numbers are unpacked and packed; constant parts are read, or made, once.

A message begins with four bytes, the second of which is the byte order. All else is aligned from
there on: a number begins at a multiple of its size, strings and sequences begin with their length.
Bytes behind the end of a message are ignored, as by rclpy: `serialize_message()` leaves some.

The templates of the answers are in :mod:`klann_ros.sanitize.cdr`.
"""

from collections.abc import Iterable, Sequence
import struct
from typing import NamedTuple

from klann_ros.sanitize.cdr import CdrCursor, HEADER_SIZE, ORDERS, read_joint_state, STAMP_SIZE
from klann_ros.sanitize.text import printable

# Maximum number of names in the refusal of a message without the joint, and their maximum length
# [characters].
_MAX_NAMES = 5
_MAX_NAME_LENGTH = 40
# The numbers of std_msgs that angles come in, in struct's notation.
_NUMBERS = {'std_msgs/msg/Float64': 'd', 'std_msgs/msg/Float32': 'f', 'std_msgs/msg/Int32': 'i'}


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

    def __init__(self, kind: str) -> None:
        self._kind = kind
        code = _NUMBERS[kind]
        self._layouts = {begin: struct.Struct(order + code) for begin, order in ORDERS.items()}

    def read(self, data: bytes) -> float:
        """Return the number; a ValueError for another message."""
        try:
            (number,) = self._layouts[data[:2]].unpack_from(data, HEADER_SIZE)
        except (KeyError, struct.error) as error:
            raise ValueError(f'{len(data)} bytes are no {self._kind}') from error
        return float(number)


class JointsReader:
    """Read joints of successive sensor_msgs/JointState messages."""

    def __init__(self, joints: Iterable[str]) -> None:
        self._layouts: dict[str, _Layout | None] = dict.fromkeys(joints)

    def read(self, data: bytes) -> dict[str, JointReading]:
        """Return the joints that are in a message; a ValueError without any, or if malformed."""
        readings = {}
        problem = ValueError()
        for joint, last_layout in self._layouts.items():
            layout = last_layout
            # Most messages differ from the last one in their numbers only.
            if layout is None or not layout.fits(data):
                try:
                    layout = self._layouts[joint] = _layout(data, joint)
                except ValueError as error:
                    problem = error
                    continue
            readings[joint] = layout.joint(data)
        if not readings:
            raise problem
        return readings


class _Layout(NamedTuple):
    """The places of the numbers in a JointState, and the constant bytes that identify them."""

    size: int
    fixed: tuple[bytes, ...]
    places: tuple[int, ...]
    numbers: struct.Struct
    has_velocity: bool
    has_effort: bool

    def fits(self, data: bytes) -> bool:
        return len(data) == self.size and all(map(data.startswith, self.fixed, self.places))

    def joint(self, data: bytes) -> JointReading:
        sec, nanosec, position, *optional = self.numbers.unpack_from(data)
        velocity = optional[0] if self.has_velocity else None
        effort = optional[-1] if self.has_effort else None
        return JointReading(position, velocity, sec, nanosec, effort)


def _listed(names: Sequence[bytes]) -> str:
    first_names = [name.decode(errors='replace') for name in names[:_MAX_NAMES]]
    text = ', '.join(printable(name, _MAX_NAME_LENGTH) for name in first_names)
    return text if len(names) <= _MAX_NAMES else f'{text}, ...'


def _layout(data: bytes, joint: str) -> _Layout:
    try:
        cursor = CdrCursor(data)
        names, sequences = read_joint_state(cursor)
        begins, counts = zip(*sequences, strict=True)
    except ValueError as error:
        raise ValueError(f'{len(data)} bytes are no sensor_msgs/msg/JointState') from error
    if len(names) != counts[0]:
        raise ValueError(
            f'{len(names)} names and {counts[0]} positions: there must be as many of each'
        )
    if joint.encode() not in names:
        text = printable(joint, _MAX_NAME_LENGTH)
        raise ValueError(f'there is no joint {text} among its {len(names)} ({_listed(names)})')
    offset = 8 * names.index(joint.encode())
    numbers = f'{cursor.order}{HEADER_SIZE}xiI'
    stamp_end = HEADER_SIZE + STAMP_SIZE
    last_end = stamp_end
    for begin, count in sequences:
        if count == len(names):
            numbers += f'{begin + offset - last_end}xd'
            last_end = begin + offset + 8
    # All but stamp, positions, velocities and efforts is fixed.
    places = (0, stamp_end, begins[0] + 8 * counts[0], begins[1] + 8 * counts[1])
    ends = (2, *begins)
    return _Layout(
        len(data),
        tuple(data[begin:end] for begin, end in zip(places, ends, strict=True)),
        places,
        struct.Struct(numbers),
        has_velocity=counts[1] == len(names),
        has_effort=counts[2] == len(names),
    )
