"""Types are recognised by their fields, and a message is read as it was written."""

from time import perf_counter

from hypothesis import given, strategies as st
from klann_ros.log.definitions import definition
from klann_ros.messages import (
    DIAGNOSTICS,
    FLOAT64,
    IMU,
    JOINT_STATE,
    known_types,
    MessageType,
    ODOMETRY,
    POINT,
    STRING,
    Template,
    TRANSFORMS,
)
import pytest
from type_definitions import idl_definition

INSTALLED = [
    message_type
    for message_type in vars(known_types).values()
    if isinstance(message_type, MessageType) and not message_type.name.startswith(('tf2', 'visu'))
]


@pytest.mark.parametrize('message_type', INSTALLED, ids=lambda message_type: message_type.name)
def test_an_installed_type_is_recognised(message_type: MessageType) -> None:
    assert message_type.is_defined_by(definition(message_type.name), 'ros2msg')
    assert message_type.is_defined_by(idl_definition(message_type.name), 'ros2idl')
    assert message_type.is_defined_by('', 'ros2msg')
    for other in INSTALLED:
        is_same = other.fields == message_type.fields
        assert message_type.is_defined_by(definition(other.name), 'ros2msg') == is_same


@pytest.mark.parametrize(
    ('text', 'is_point'),
    [
        ('std_msgs/Header header\nPoint point', True),
        ('std_msgs/msg/Header header # when\n\nint32 A=5\ngeometry_msgs/msg/Point point', True),
        ('Header header\nPoint point', True),
        ('Header header\nfloat64 x\nfloat64 y\nfloat64 z', False),
        ('Header header\nPoint position', False),
        ('Header header\nPoint[] point', False),
        ('Header header\nPoint point\nbool valid', False),
        ('Header header\nPoint point\nMSG: geometry_msgs/Point\nfloat64 y\nfloat64 x', False),
        ('Header header\nPoint point\nMSG: geometry_msgs/Point\nfloat32 x', False),
        ('Header header\nNobody point', False),
        ('anything', False),
    ],
)  # fmt: skip
def test_a_type_has_names_and_order_of_its_fields(text: str, is_point: bool) -> None:
    assert POINT.is_defined_by(text, 'ros2msg') == is_point


def test_a_json_schema_is_no_definition() -> None:
    assert not FLOAT64.is_defined_by('', 'jsonschema')
    assert not FLOAT64.is_defined_by('float64 data', 'jsonschema')


@pytest.mark.parametrize('encoding', ['ros2msg', 'ros2idl'])
@pytest.mark.parametrize(
    'text',
    [
        # Types in themselves, and types whose fields double with each level.
        'Header header\nPoint point\nMSG: geometry_msgs/Point\nPoint x',
        'B0 a\nB0 b\n' + ''.join(f'MSG: a/B{n}\na/B{n + 1} a\na/B{n + 1} b\n' for n in range(90)),
        'float64[999999999999999999999999] header',
        'struct A { ' + '@a(' * 80_000,
        'typedef ' * 30_000,
        '"' * 250_000,
        '\\"' * 120_000,
        'sequence<' * 28_000,
        'x<' * 120_000,
        'a ' * 10_000_000,
    ],
)  # fmt: skip
def test_a_hostile_definition_costs_little(text: str, encoding: str) -> None:
    begin = perf_counter()
    assert not POINT.is_defined_by(text, encoding)
    assert perf_counter() - begin < 2.0


texts = st.text(st.characters(exclude_characters='\0', codec='utf-8'), max_size=9)
statuses = st.fixed_dictionaries(
    {
        'level': st.integers(0, 255),
        'name': texts,
        'message': texts,
        'hardware_id': texts,
        'values': st.lists(st.fixed_dictionaries({'key': texts, 'value': texts}), max_size=3),
    }
)


@given(st.lists(statuses, max_size=3), texts, st.integers(-(2**31), 2**31 - 1))
def test_a_message_is_read_as_it_was_written(
    status: list[dict[str, object]], frame: str, sec: int
) -> None:
    content = {
        'header.stamp.sec': sec,
        'header.stamp.nanosec': 7,
        'header.frame_id': frame,
        'status': status,
    }
    data = DIAGNOSTICS.write(content)
    assert DIAGNOSTICS.read(data) == content
    with pytest.raises(ValueError, match='ends too early'):
        DIAGNOSTICS.read(data[:-1])


def test_what_is_left_out_is_zero_or_empty() -> None:
    state = JOINT_STATE.read(JOINT_STATE.write({'name': ['a'], 'position': [2.5]}))
    assert state == {
        'header.stamp.sec': 0,
        'header.stamp.nanosec': 0,
        'header.frame_id': '',
        'name': ['a'],
        'position': (2.5,),
        'velocity': (),
        'effort': (),
    }
    assert STRING.write({}) == b'\0\1\0\0\1\0\0\0\0'


def test_an_array_of_a_fixed_size_is_written_whole() -> None:
    with pytest.raises(ValueError, match='orientation_covariance has 9 elements, not 1'):
        IMU.write({'orientation_covariance': [0.5]})


@given(texts, texts, st.lists(st.floats(allow_nan=False), min_size=9, max_size=9))
def test_a_template_is_a_message_with_its_numbers(
    frame: str, child: str, numbers: list[float]
) -> None:
    content = {'header.frame_id': frame, 'child_frame_id': child}
    paths = ['pose.pose', 'pose.covariance[7]', 'twist.twist.angular.z']
    odometry = ODOMETRY.read(Template(ODOMETRY, content, paths).fill(5, 7, *numbers))
    position = ['x', 'y', 'z']
    assert [odometry[f'pose.pose.position.{axis}'] for axis in position] == numbers[:3]
    assert odometry['pose.pose.orientation.w'] == numbers[6]
    assert odometry['pose.covariance'][7] == numbers[7]
    assert odometry['twist.twist.angular.z'] == numbers[8]
    assert odometry['child_frame_id'] == child
    assert (odometry['header.stamp.sec'], odometry['header.stamp.nanosec']) == (5, 7)
    template = Template(TRANSFORMS, {'transforms': [content]}, ['transforms[0].transform'])
    (transform,) = TRANSFORMS.read(template.fill(1, 2, *numbers[:7]))['transforms']
    assert transform['transform.translation.x'] == numbers[0]
    assert transform['transform.rotation.w'] == numbers[6]
    assert transform['header.frame_id'] == frame
