"""Messages as bytes: what rclpy makes of them, and what a typed publish puts on the wire."""

from collections.abc import Callable
import struct
from typing import Any

from geometry_msgs.msg import PointStamped, TwistStamped
from hypothesis import example, given, strategies as st
from klann_ros.messages import (
    JointReading,
    JointsReader,
    JointStateTemplate,
    NumberReader,
    point_template,
    twist_template,
)
from klann_ros.nodes.endpoints import type_name
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float64, Int32

texts = st.text(st.characters(exclude_characters='\0', codec='utf-8'), max_size=12)
doubles = st.floats()
secs = st.integers(-(2**31), 2**31 - 1)
name_lists = st.lists(texts, min_size=1, max_size=7)
nanosecs = st.integers(0, 2**32 - 1)


@st.composite
def joint_states(draw: Callable[[Any], Any], names: Any = name_lists) -> JointState:
    """Make JointStates with as many positions as names; of all else there may be fewer."""
    message = JointState(name=draw(names))
    count = len(message.name)
    message.position = draw(st.lists(doubles, min_size=count, max_size=count))
    for numbers in ('velocity', 'effort'):
        # As many as names, or any fewer or more.
        size = draw(st.sampled_from([count, count, 0, count - 1, count + 1]))
        setattr(message, numbers, draw(st.lists(doubles, min_size=size, max_size=size)))
    message.header.frame_id = draw(texts)
    message.header.stamp.sec = draw(secs)
    message.header.stamp.nanosec = draw(nanosecs)
    return message


def big_endian(message: JointState) -> bytes:
    """Write what no ROS on this machine writes."""
    data = struct.pack('>iI', message.header.stamp.sec, message.header.stamp.nanosec)

    def put(kind: str, value: float) -> None:
        nonlocal data
        data += bytes(-len(data) % struct.calcsize(kind)) + struct.pack(f'>{kind}', value)

    def put_string(text: str) -> None:
        nonlocal data
        put('I', len(text.encode()) + 1)
        data += text.encode() + b'\0'

    put_string(message.header.frame_id)
    put('I', len(message.name))
    for name in message.name:
        put_string(name)
    for numbers in (message.position, message.velocity, message.effort):
        put('I', len(numbers))
        for number in numbers:
            put('d', number)
    return b'\0\0\0\0' + data


class Reader:
    """A reader of one joint."""

    def __init__(self, joint: str) -> None:
        self._joint = joint
        self._reader = JointsReader([joint])

    def read(self, data: bytes) -> JointReading:
        return self._reader.read(data)[self._joint]


def same(a: object, b: object) -> bool:
    """Compare representations: nan is nan, and -0 is not 0."""
    return repr(a) == repr(b)


def expected(message: JointState, index: int) -> JointReading:
    names = message.name
    velocities = message.velocity
    stamp = message.header.stamp
    index = list(names).index(names[index])
    velocity = velocities[index] if len(velocities) == len(names) else None
    effort = message.effort[index] if len(message.effort) == len(names) else None
    return JointReading(message.position[index], velocity, stamp.sec, stamp.nanosec, effort)


@given(doubles, st.floats(width=32), st.integers(-(2**31), 2**31 - 1))
def test_a_number_is_read_as_rclpy_reads_it(double: float, single: float, count: int) -> None:
    for message, code in (
        (Float64(data=double), 'd'),
        (Float32(data=single), 'f'),
        (Int32(data=count), 'i'),
    ):
        reader = NumberReader(type_name(type(message)))
        data = serialize_message(message)
        number = float(deserialize_message(data, type(message)).data)
        assert same(reader.read(data), number)
        assert same(reader.read(b'\0\0\0\0' + struct.pack(f'>{code}', message.data)), number)


@pytest.mark.parametrize(
    'data', [b'', b'\0\1', b'\0\1\0\0', b'\0\1\0\0' + bytes(7), b'\1\1\0\0' + bytes(8), bytes(11)]
)
def test_invalid_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match='bytes are no std_msgs/msg/Float64'):
        NumberReader('std_msgs/msg/Float64').read(data)


@given(st.lists(joint_states(), min_size=1, max_size=3), st.data())
def test_joints_are_read_as_rclpy_reads_them(messages: list[JointState], data: Any) -> None:
    index = data.draw(st.integers(0, len(messages[0].name) - 1))
    reader = Reader(messages[0].name[index])
    # Each is read twice, as the first of its layout and as one of many.
    for message in [m for m in messages for _ in range(2)]:
        for wire in (serialize_message(message), big_endian(message)):
            decoded = deserialize_message(wire, JointState)
            assert same(decoded, message)
            if messages[0].name[index] in message.name:
                index_in_message = list(message.name).index(messages[0].name[index])
                assert same(reader.read(wire), expected(decoded, index_in_message))
            else:
                with pytest.raises(ValueError, match='there is no joint'):
                    reader.read(wire)


@given(joint_states(st.just(['a', 'crank'])), joint_states(st.just(['a', 'crank'])))
def test_a_layout_that_changes_is_noticed(first: JointState, second: JointState) -> None:
    reader = Reader('crank')
    for message in (first, second, first):
        assert same(reader.read(serialize_message(message)), expected(message, 1))


@given(joint_states(st.just(['a', 'crank'])), st.data())
def test_a_message_that_is_cut_off_is_refused(message: JointState, data: Any) -> None:
    reader = Reader('crank')
    encoded = big_endian(message)
    reader.read(encoded)
    end = data.draw(st.integers(0, len(encoded) - 1))
    with pytest.raises(ValueError, match='are no sensor_msgs/msg/JointState'):
        reader.read(encoded[:end])
    assert same(reader.read(encoded), expected(message, 1))


def test_names_and_positions_must_be_as_many() -> None:
    data = serialize_message(JointState(name=['crank', 'a'], position=[1.0]))
    with pytest.raises(ValueError, match='2 names and 1 positions'):
        Reader('crank').read(data)


@given(joint_states(st.just(['a', 'crank'])), st.data())
def test_a_few_wrong_bytes_are_read_as_rclpy_reads_them_or_refused(
    message: JointState, data: Any
) -> None:
    reader = Reader('crank')
    encoded = bytearray(big_endian(message))
    reader.read(bytes(encoded))
    for _ in range(data.draw(st.integers(1, 3))):
        position = data.draw(st.integers(0, len(encoded) - 1))
        encoded[position] = data.draw(st.integers(0, 255))
    try:
        joint = reader.read(bytes(encoded))
    except ValueError:
        return
    decoded = deserialize_message(bytes(encoded), JointState)
    assert same(joint, expected(decoded, list(decoded.name).index('crank')))


@given(st.binary(max_size=200))
@example(b'\0\1\0\0' + b'\xff' * 100)
@example(b'\0\0\0\0' + b'\xff' * 100)
def test_garbage_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r'JointState|joint|names'):
        Reader('crank').read(data)
    for code in (b'\0\1\0\0', b'\0\0\0\0'):
        with pytest.raises(ValueError, match=r'JointState|joint|names'):
            Reader('crank').read(code + data)


def written(
    kind: str, stamp: tuple[int, int], frame_id: str, names: list[str], numbers: list[float]
) -> tuple[Any, bytes]:
    """Return a message of a kind, and what its template makes of the same."""
    x, y = numbers[:2]
    if kind == 'point':
        message = PointStamped()
        message.point.x, message.point.y = x, y
        data = point_template(frame_id).fill(*stamp, x, y)
    elif kind == 'twist':
        message = TwistStamped()
        message.twist.linear.x, message.twist.linear.y = x, y
        data = twist_template(frame_id).fill(*stamp, x, y)
    else:
        count = len(names)
        positions = numbers[:count]
        velocities = numbers[::-1][:count] if kind == 'rates' else []
        message = JointState(name=names, position=positions, velocity=velocities)
        template = JointStateTemplate(names, frame_id)
        data = template.fill(*stamp, positions, velocities)
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    return message, data


KINDS = ['point', 'twist', 'joints', 'rates']
many = st.lists(doubles, min_size=8, max_size=8)


@given(
    *(st.sampled_from(KINDS), st.tuples(secs, nanosecs), texts),
    *(st.lists(texts, min_size=1, max_size=8), many),
)
def test_templates_write_messages_that_rclpy_reads(
    kind: str, stamp: tuple[int, int], frame_id: str, names: list[str], numbers: list[float]
) -> None:
    message, data = written(kind, stamp, frame_id, names, numbers)
    assert same(deserialize_message(data, type(message)), message)
    # serialize_message() lets bytes behind the end that are not sent.
    assert len(data) <= len(serialize_message(message)) <= len(data) + 8
