"""What is written is read back equal, by us and by others."""

from importlib.metadata import distributions
from pathlib import Path
import tempfile

from crank_runs import (
    BATCHES,
    HASH,
    make_messages,
    make_topic,
    record_spans,
    START,
    write_mcap,
    write_run,
)
from hypothesis import given, settings, strategies as st
from klann_ros.log.bag_metadata import ros_distro
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.reader import MAX_LOG_DURATION, open_log
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.log.write.writer import RunWriter
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex, MessageIndex, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, MCAP0_MAGIC
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores
import yaml

U64 = st.integers(0, 2**64 - 1)
texts = st.text(st.characters(codec='utf-8'), max_size=12)
topics = st.builds(
    Topic,
    name=texts,
    type=texts,
    definition=texts,
    qos=st.sampled_from(['', qos_to_yaml([Qos()]), qos_to_yaml([Qos(), Qos(depth=3)])]),
    type_hash=texts,
    extra=st.dictionaries(st.text('abc', min_size=1, max_size=3), texts, max_size=2).map(
        lambda entries: tuple(entries.items())
    ),
).map(
    lambda topic: (
        topic if topic.type or topic.definition else Topic(topic.name, '', schema_encoding='')
    )
)
names = st.dictionaries(texts, texts, max_size=3)


@st.composite
def contents(draw):
    """Draw messages of a few topics, and the places where the writer flushes."""
    few_topics = draw(st.lists(topics, min_size=1, max_size=4))
    message = st.builds(
        Message,
        topic=st.sampled_from(few_topics),
        # As CDR begins; a zstd frame would be unpacked.
        data=st.binary(max_size=60).map(b'\0'.__add__),
        log_time=U64,
        publish_time=U64,
        sequence=st.integers(0, 2**32 - 1),
    )
    return draw(st.lists(message, max_size=30)), draw(st.sets(st.integers(0, 29)))


@settings(max_examples=30)
@given(
    contents(),
    st.sampled_from(['zstd', 'lz4', 'none']),
    st.integers(1, 500),
    st.lists(st.builds(Attachment, texts, texts, st.binary(max_size=50), U64, U64), max_size=3),
    st.lists(st.tuples(st.sampled_from('ab'), names), max_size=3),
)
def test_everything_is_read_back_equal(
    content, compression, chunk_size, attachments, metadata
) -> None:
    messages, flushes = content
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder, 'run')
        with RunWriter(run, compression=compression, chunk_size=chunk_size) as writer:
            for number, message in enumerate(messages):
                writer.write(message)
                if number in flushes:
                    writer.flush()
            for item in attachments:
                writer.attach(
                    item.name, item.media_type, item.data, item.log_time, item.create_time
                )
            for name, mapping in metadata:
                writer.add_metadata(name, mapping)
        with open_log(run) as log:
            assert log.complete, log.problem
            # sorted() is stable: messages of one time keep their order.
            assert list(log.messages()) == sorted(messages, key=lambda item: item.log_time)
            assert log.attachments == tuple(attachments)
            log.metadata.pop('rosbag2')
            assert log.metadata == {
                name: [mapping for record_name, mapping in metadata if record_name == name]
                for name in dict(metadata)
            }
            assert set(log.topics) == {message.topic for message in messages}
            times = [message.log_time for message in messages] or [0]
            # Times ten years apart are not all possible.
            if max(times) - min(times) < MAX_LOG_DURATION:
                assert (log.start_time, log.end_time) == (min(times), max(times))
            else:
                assert min(times) <= log.start_time <= log.end_time <= max(times)


@pytest.fixture(params=['zstd', 'lz4', 'none'])
def mixed_run(request, tmp_path):
    """Write a run of joint states and crank angles, and what went into it as rosbags' objects."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    text, _ = store.generate_msgdef('sensor_msgs/msg/JointState', ros_version=2)
    joint_states = Topic(
        '/joint_states',
        'sensor_msgs/msg/JointState',
        text,
        qos_to_yaml([Qos(history='keep_last', depth=2000)]),
        store.hash_rihs01('sensor_msgs/msg/JointState'),
    )
    written = []
    for n, message in enumerate(make_messages(50)):
        stamp = types['builtin_interfaces/msg/Time'](1_700_000_000, n)
        state = types['sensor_msgs/msg/JointState'](
            header=types['std_msgs/msg/Header'](stamp, 'leg_plane'),
            name=['alpha', 'beta'],
            position=np.array([0.01 * n, -0.5]),
            velocity=np.array([1.0, n]),
            effort=np.array([]),
        )
        data = bytes(store.serialize_cdr(state, 'sensor_msgs/msg/JointState'))
        time = message.log_time + 10
        written += [(message, 0.01 * n), (Message(joint_states, data, time, time - 5, n), state)]
    run = tmp_path / 'mixed'
    write_run(run, [[message for message, _ in written]], compression=request.param)
    return run, written


def test_rosbags_finds_messages_times_qos_and_hashes(mixed_run) -> None:
    run, written = mixed_run
    with Reader(run) as reader:
        messages = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
        assert (reader.message_count, reader.start_time) == (100, START)
        by_topic = {connection.topic: connection for connection in reader.connections}
    assert messages == [(m.topic.name, m.log_time, m.data) for m, _ in written]
    assert {connection.msgcount for connection in by_topic.values()} == {50}
    assert by_topic['/crank_angle'].digest == HASH
    (qos,) = by_topic['/joint_states'].ext.offered_qos_profiles
    assert (qos.history.name, qos.depth, qos.reliability.name) == ('KEEP_LAST', 2000, 'RELIABLE')


def test_mcap_ros2_decodes_the_same_values(mixed_run) -> None:
    run, written = mixed_run
    with (run / 'mixed_0.mcap').open('rb') as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        decoded_messages = list(reader.iter_decoded_messages())
    assert len(decoded_messages) == 100
    for item, (message, content) in zip(decoded_messages, written, strict=True):
        assert item.channel.topic == message.topic.name
        assert item.message.log_time == message.log_time
        assert item.message.publish_time == message.publish_time
        assert item.message.sequence == message.sequence
        if message.topic.name == '/crank_angle':
            assert item.decoded_message.data == content
        else:
            assert item.decoded_message.position == list(content.position)
            assert item.decoded_message.header.stamp.nanosec == content.header.stamp.nanosec


def test_the_file_has_the_metadata_that_tools_expect(run_file) -> None:
    with run_file.open('rb') as file:
        reader = make_reader(file)
        header, summary = reader.get_header(), reader.get_summary()
    assert (header.profile, header.library.split()[0]) == ('ros2', 'klann_ros')
    (channel,) = summary.channels.values()
    assert (channel.message_encoding, summary.schemas[channel.schema_id].encoding) == (
        'cdr',
        'ros2msg',
    )
    topic = make_topic()
    about = {'offered_qos_profiles': topic.qos, 'topic_type_hash': topic.type_hash}
    assert channel.metadata == about
    data = run_file.read_bytes()
    assert 0x0E in [opcode for opcode, _, _ in record_spans(data)], 'summary offsets'
    assert data.endswith(MCAP0_MAGIC)


def test_metadata_yaml_and_the_record_in_the_file_agree(run_file) -> None:
    root = yaml.safe_load((run_file.parent / 'metadata.yaml').read_text())
    metadata = root['rosbag2_bagfile_information']
    assert metadata['version'] == 9
    assert metadata['relative_file_paths'] == ['walk_0.mcap']
    assert metadata['message_count'] == 240
    assert metadata['duration'] == {'nanoseconds': 239_000_000}
    assert metadata['starting_time'] == {'nanoseconds_since_epoch': START}
    (topic,) = metadata['topics_with_message_count']
    assert topic['topic_metadata']['type_description_hash'] == HASH
    with open_log(run_file) as log:
        (record,) = log.metadata['rosbag2']
    assert yaml.safe_load(record['serialized_metadata']) == metadata


@pytest.mark.parametrize('compression', CompressionType)
def test_chunks_and_their_indexes_are_those_of_the_mcap_library(tmp_path, compression) -> None:
    batches = [[*batch, *make_messages(5, '/other'), *batch[:3]] for batch in BATCHES]
    name = compression.name.lower()
    ours = write_run(tmp_path / 'run', batches, compression=name)
    theirs = write_mcap(tmp_path / 'x.mcap', batches, compression=compression)
    records_of_files = []
    for path in (ours, theirs):
        with path.open('rb') as file:
            records = [*StreamReader(file, emit_chunks=True).records]
        kinds = Chunk, MessageIndex, ChunkIndex, Statistics
        records_of_files.append(
            {kind: [record for record in records if type(record) is kind] for kind in kinds}
        )
        (statistics,) = records_of_files[-1][Statistics]
        statistics.attachment_count = statistics.metadata_count = 0
        for index in records_of_files[-1][ChunkIndex]:
            start, index.chunk_start_offset = index.chunk_start_offset, 0
            places = index.message_index_offsets.items()
            index.message_index_offsets = {channel: place - start for channel, place in places}
    assert records_of_files[0] == records_of_files[1]
    assert [len(records) for records in records_of_files[0].values()] == [6, 12, 6, 1]
    # Topics of one type share a schema, and equal topics a channel.
    (statistics,) = records_of_files[0][Statistics]
    assert (statistics.schema_count, statistics.channel_count) == (1, 2)


def test_the_metadata_name_the_distribution_of_the_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('rclpy')
    names = [distribution.name for distribution in distributions()]
    wheels = [name for name in ('jazzy', 'kilted') if f'ros-{name}-rclpy' in names]
    if not wheels:
        pytest.skip('ROS is not from wheels')
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    assert [ros_distro()] == wheels


@pytest.mark.parametrize(('sourced', 'recorded'), [('kilted', 'kilted'), ('', 'jazzy')])
def test_the_metadata_name_the_sourced_distribution(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, sourced: str, recorded: str
) -> None:
    monkeypatch.setenv('ROS_DISTRO', sourced)
    write_run(tmp_path / 'run', BATCHES)
    metadata = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text(encoding='utf-8'))
    assert metadata['rosbag2_bagfile_information']['ros_distro'] == recorded
