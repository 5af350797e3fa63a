"""Messages in bulk are what mcap-ros2-support reads one by one; blocks are what mcap reads."""

from itertools import chain
import struct

from hypothesis import given, settings, strategies as st
from klann_ros.log.definitions import definition
from klann_ros.log.mcap.content import content_of
from klann_ros.log.read.compressed import is_compressed
from klann_ros.log.reader import open_log
from klann_ros.log.records import Topic
from klann_ros.messages import ColumnReader, FLOAT64, JOINT_STATE as JOINT_STATES, POINT
from leg_runs import make, STORE
from mcap.reader import NonSeekingReader
from mcap.records import Schema
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
import numpy as np

CRANK_ANGLE, FOOT, JOINT_STATE = FLOAT64.name, POINT.name, JOINT_STATES.name
# The numbers of each type.
READ = {
    CRANK_ANGLE: (FLOAT64, ('data',)),
    FOOT: (POINT, ('point',)),
    JOINT_STATE: (JOINT_STATES, ('position', 'velocity', 'effort')),
}
KINDS = {
    kind: Topic(f'/{number}', kind, definition(kind))
    for number, kind in enumerate((CRANK_ANGLE, FOOT, JOINT_STATE))
}
DECODE = {
    kind: DecoderFactory().decoder_for(
        'cdr', Schema(id=number, name=kind, encoding='ros2msg', data=topic.definition.encode())
    )
    for number, (kind, topic) in enumerate(KINDS.items(), start=1)
}

numbers = st.floats(width=64)
# A text ends at its first zero.
texts = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=12)


def foot_message(sec, nanosec, frame, xyz):
    stamp = make('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)
    header = make('std_msgs/msg/Header', stamp=stamp, frame_id=frame)
    point = make('geometry_msgs/msg/Point', **dict(zip('xyz', xyz, strict=True)))
    return make(FOOT, header=header, point=point)


@st.composite
def serialized(draw):
    """Draw alike messages as type and bytes; some are cut off, or have more behind them."""
    kind = draw(st.sampled_from([*KINDS]))
    little_endian = draw(st.booleans())
    frame = draw(texts)
    names = draw(st.lists(texts, max_size=4))
    sizes = draw(st.tuples(*[st.integers(0, 4)] * 3))

    def doubles(size):
        return np.array(draw(st.lists(numbers, min_size=size, max_size=size)), dtype=np.float64)

    messages = []
    for _ in range(draw(st.integers(1, 4))):
        sec = draw(st.integers(-(2**31), 2**31 - 1))
        nanosec = draw(st.integers(0, 2**32 - 1))
        content = foot_message(sec, nanosec, frame, doubles(3).tolist())
        if kind == CRANK_ANGLE:
            content = make(CRANK_ANGLE, data=draw(numbers))
        elif kind == JOINT_STATE:
            arrays = zip(('position', 'velocity', 'effort'), map(doubles, sizes), strict=True)
            content = make(kind, header=content.header, name=names, **dict(arrays))
        data = bytes(STORE.serialize_cdr(content, kind, little_endian=little_endian))
        cut = draw(st.one_of(st.just(len(data)), st.integers(0, len(data))))
        more = draw(st.one_of(st.just(b''), st.binary(max_size=9)))
        messages.append((kind, data[:cut] + more))
    return messages


def block_of(messages):
    """Return the block of messages; each type has a channel."""
    channels = list(KINDS)
    data = b''
    for number, (kind, content) in enumerate(messages):
        head = struct.pack('<BQHIQQ', 5, 22 + len(content), channels.index(kind), 0, number, 0)
        data += head + content
    content = content_of(data, verified=True)
    assert not content.broken
    return content.block({})


def read_in_bulk(messages):
    """Return the content of each message, by its row, and how many failed."""
    block = block_of(messages)
    contents = {}
    refused = []
    for number, topic in enumerate(KINDS.values()):
        reader = ColumnReader(*READ[topic.type], 'name')
        rows = np.flatnonzero(block.heads['channel'] == number)
        for columns in reader.read(block, rows, refused.extend):
            for i, row in enumerate(columns.rows.tolist()):
                contents[row] = [int(columns.stamps[i]), columns.names, b'', b'', b'']
                for column, field_numbers in enumerate(columns.numbers.values(), start=2):
                    contents[row][column] = field_numbers[i].tobytes()
    return contents, len(refused)


def read_one(kind, data):
    """Return the content of a message by mcap-ros2-support; None if it cannot be read."""
    try:
        decoded = DECODE[kind](data)
    except Exception:
        return None
    stamp = 0
    if kind != CRANK_ANGLE:
        stamp = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
    if kind == CRANK_ANGLE:
        fields = (), decoded.data, (), ()
    elif kind == FOOT:
        fields = (), [decoded.point.x, decoded.point.y, decoded.point.z], (), ()
    else:
        fields = decoded.name, decoded.position, decoded.velocity, decoded.effort
    names, *arrays = fields
    data = [np.array(array, dtype=np.float64).tobytes() for array in arrays]
    return [stamp, tuple(names), *data]


@settings(max_examples=40)
@given(st.lists(serialized(), max_size=6), st.randoms())
def test_bulk_reading_is_that_of_the_library(families, random) -> None:
    messages = [*chain(*families)]
    random.shuffle(messages)
    contents, failed = read_in_bulk(messages)
    assert [contents.get(row) for row in range(len(messages))] == [read_one(*m) for m in messages]
    assert failed == len(messages) - len(contents)


@settings(max_examples=20)
@given(st.binary(min_size=2, max_size=2))
def test_padding_between_fields_is_ignored(padding) -> None:
    # A frame of one letter and its end leave two bytes before the numbers.
    foot = foot_message(1, 2, 'f', (1.0, 2.0, 3.0))
    plain = bytes(STORE.serialize_cdr(foot, FOOT))
    assert plain[18:20] == b'\0\0'
    odd = plain[:18] + padding + plain[20:]
    contents, failed = read_in_bulk([(FOOT, plain), (FOOT, odd)])
    assert (contents[0], failed) == (contents[1], 0)


FIELDS = ['channel', 'sequence', 'log_time', 'publish_time']


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2),
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**63),
            st.integers(0, 2**63),
            # No CDR begins as a zstd frame does, which is taken for a packed message.
            st.binary(max_size=40).filter(lambda data: not is_compressed(data)),
        ),
        max_size=30,
    ),
    st.sampled_from(CompressionType),
    st.integers(30, 400),
)
def test_blocks_equal_the_messages_of_the_mcap_library(
    tmp_path_factory, messages, kind, size
) -> None:
    path = tmp_path_factory.mktemp('blocks') / 'log.mcap'
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=size, compression=kind)
        writer.start('ros2')
        schema = writer.register_schema('a/msg/B', 'ros2msg', b'')
        channels = [writer.register_channel(f'/{n}', 'cdr', schema) for n in range(3)]
        for number, sequence, log_time, publish_time, data in messages:
            writer.add_message(channels[number], log_time, data, publish_time, sequence)
        writer.finish()
    contents = []
    with open_log(path) as log:
        for block in log.blocks():
            for row, (channel, *times) in enumerate(block.heads[FIELDS].tolist()):
                contents.append((block.topics[channel].name, *times, block.message(row)))
        assert log.complete
    with path.open('rb') as file:
        read = NonSeekingReader(file).iter_messages(log_time_order=False)
        assert contents == [
            (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
            for _, channel, message in read
        ]
