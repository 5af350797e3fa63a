"""Behind damage whose end is not known all that is sound comes back, and nothing else."""

from pathlib import Path
import struct
from types import ModuleType

from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.recovery import recover
from klann_ros.log.write.writer import RunWriter
from mcap.writer import Writer
import pytest

CHUNK, ATTACHMENT, METADATA, DATA_END = 6, 9, 12, 15
SHAPES = ['zstd', 'lz4', 'none']


@pytest.fixture(params=['closed', 'killed'])
def damaged(request, runs: ModuleType, tmp_path: Path, batches: list[list[Message]]):
    """Return a function that writes a run and lets a function damage its bytes and spans."""

    def make(change, compression='zstd'):
        path = runs.write_run(tmp_path / 'walk', batches, compression=compression)
        data = bytearray(path.read_bytes())
        spans = runs.record_spans(data)
        change(data, spans)
        if request.param == 'killed':
            end = next(start for opcode, start, _ in spans if opcode == DATA_END)
            del data[end:]
        path.write_bytes(data)
        recovery = recover(path.parent, tmp_path / 'again')
        with open_log(tmp_path / 'again') as log:
            assert log.complete, log.problem
            return list(log.messages()), recovery

    return make


def chunk(spans, number):
    return [(start, end) for opcode, start, end in spans if opcode == CHUNK][number]


@pytest.mark.parametrize('compression', SHAPES)
@pytest.mark.parametrize('length', [0, 1, 77, 2**31, 2**50, 2**64 - 1])
def test_a_wrong_length_costs_its_chunk_only(
    damaged, batches: list[list[Message]], runs: ModuleType, compression, length
) -> None:
    def change(data, spans):
        struct.pack_into('<Q', data, chunk(spans, 2)[0] + 1, length)

    messages, recovery = damaged(change, compression)
    assert messages == runs.all_but(batches, 2)
    assert len(recovery.lost) == 1
    assert '40 messages' in recovery.lost[0]


@pytest.mark.parametrize('compression', SHAPES)
@pytest.mark.parametrize('filling', [b'\0', b'\xa5'])
def test_an_overwritten_region_costs_the_chunks_that_it_touches(
    damaged, batches: list[list[Message]], runs: ModuleType, compression, filling
) -> None:
    def change(data, spans):
        start, end = chunk(spans, 1)[0] + 20, chunk(spans, 3)[0] + 100
        data[start:end] = filling * (end - start)

    messages, recovery = damaged(change, compression)
    assert messages == runs.joined([batches[0], *batches[4:]])
    assert recovery.lost


def test_missing_bytes_cost_one_chunk_though_it_reaches_over_the_next(
    damaged, batches: list[list[Message]], runs: ModuleType
) -> None:
    def change(data, spans):
        start, end = chunk(spans, 2)
        del data[slice(start + 100, end - 50)]

    messages, _ = damaged(change)
    assert messages == runs.all_but(batches, 2)


def test_a_chunk_that_was_moved_onto_another_costs_that_one_only(
    damaged, batches: list[list[Message]], runs: ModuleType
) -> None:
    def change(data, spans):
        start, end = chunk(spans, 3)
        moved, data[start:end] = data[start:end], bytes(end - start)
        place = chunk(spans, 1)[0] + 20
        data[slice(place, place + len(moved))] = moved
        struct.pack_into('<Q', data, chunk(spans, 1)[0] + 1, 2**40)

    messages, recovery = damaged(change)
    assert sorted(messages, key=lambda message: message.log_time) == runs.all_but(batches, 1)
    assert recovery.lost


def test_a_chunk_that_lies_across_the_end_of_an_attachment_comes_back(
    run_file: Path, runs: ModuleType, tmp_path: Path, batches: list[list[Message]]
) -> None:
    data = run_file.read_bytes()
    spans = runs.record_spans(data)
    end = next(end for opcode, _, end in spans if opcode == ATTACHMENT)
    last = slice(*chunk(spans, 5))
    # The zeros in the chunk's length are now where the attachment's CRC was: it has none.
    run_file.write_bytes(data[: end - 7] + data[last] + data[slice(end, last.start)])
    recover(run_file, tmp_path / 'again')
    with open_log(tmp_path / 'again') as log:
        assert list(log.messages()) == runs.joined(batches)


def test_what_stands_behind_the_damage_is_more_than_chunks(
    runs: ModuleType, tmp_path: Path, batches: list[list[Message]]
) -> None:
    with RunWriter(tmp_path / 'walk') as writer:
        for message in batches[0]:
            writer.write(message)
        writer.flush()
        writer.attach('note.txt', 'text/plain', b'behind it', 1)
        writer.add_metadata('note', {'behind': 'it'})
    data = bytearray(writer.file.path.read_bytes())
    spans = runs.record_spans(data)
    struct.pack_into('<Q', data, chunk(spans, 0)[0] + 1, 2**40)
    end = next(start for opcode, start, _ in spans if opcode == DATA_END)
    writer.file.path.write_bytes(data[:end])
    recovery = recover(tmp_path / 'walk', tmp_path / 'again')
    assert (recovery.messages, recovery.attachments, recovery.metadata) == (0, 1, 1)


def test_a_log_in_an_attachment_is_not_read_as_messages_of_the_run(
    run_file: Path, runs: ModuleType, tmp_path: Path, batches: list[list[Message]]
) -> None:
    inner = run_file.read_bytes()
    with RunWriter(tmp_path / 'outer') as writer:
        for message in batches[0]:
            writer.write(message)
        writer.flush()
        writer.attach('inner.mcap', 'application/mcap', inner, 1)
        for message in batches[1]:
            writer.write(message)
    data = bytearray(writer.file.path.read_bytes())
    spans = runs.record_spans(data)
    # The chunk before it is damaged without an end, the one behind it is rotten.
    struct.pack_into('<Q', data, chunk(spans, 0)[0] + 1, 2**40)
    data[chunk(spans, 1)[1] - 5] ^= 1
    end = next(start for opcode, start, _ in spans if opcode == DATA_END)
    writer.file.path.write_bytes(data[:end])
    recovery = recover(tmp_path / 'outer', tmp_path / 'again')
    assert (recovery.messages, recovery.attachments) == (0, 1)
    with open_log(tmp_path / 'again') as log:
        assert log.attachments[0].data == inner


def test_a_log_in_an_attachment_of_a_wrong_length_is_not_read_as_the_run(
    run_file: Path, runs: ModuleType, tmp_path: Path, batches: list[list[Message]]
) -> None:
    with RunWriter(tmp_path / 'outer') as writer:
        writer.attach('inner.mcap', 'application/mcap', run_file.read_bytes(), 1)
        for message in batches[1]:
            writer.write(message)
    data = bytearray(writer.file.path.read_bytes())
    start = next(start for opcode, start, _ in runs.record_spans(data) if opcode == ATTACHMENT)
    struct.pack_into('<Q', data, start + 1, 2**40)
    writer.file.path.write_bytes(data)
    recovery = recover(tmp_path / 'outer', tmp_path / 'again')
    assert (recovery.messages, recovery.attachments) == (len(batches[1]), 0)


def test_messages_come_back_though_their_topic_is_described_only_behind_them(
    runs: ModuleType, tmp_path: Path, batches: list[list[Message]]
) -> None:
    """Other recorders describe a topic within each chunk: the first chunk here has lost it."""
    topic = batches[0][0].topic
    path = tmp_path / 'log.mcap'
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=1)
        writer.start('ros2')
        schema = writer.register_schema(topic.type, 'ros2msg', topic.definition.encode())
        channel = writer.register_channel(topic.name, 'cdr', schema)
        for message in batches[0][:3]:
            writer.add_message(channel, message.log_time, message.data, message.publish_time)
        writer.finish()
    data = path.read_bytes()
    spans = runs.record_spans(data)
    chunks = [data[slice(start, end)] for opcode, start, end in spans if opcode == CHUNK]
    start = data[: spans[0][2]]
    path.write_bytes(start + chunks[1] + chunks[2] + chunks[0])
    recover(path, tmp_path / 'again')
    with open_log(tmp_path / 'again') as log:
        assert [item.data for item in log.messages()] == [item.data for item in batches[0][:3]]
        assert {item.name for item in log.topics} == {topic.name}


def test_of_two_descriptions_that_differ_the_one_under_a_crc_counts(
    run_file: Path, runs: ModuleType, tmp_path: Path
) -> None:
    """The library writes them into the chunk, this package once more before it, without a CRC."""
    data = run_file.read_bytes()
    end = next(start for opcode, start, _ in runs.record_spans(data) if opcode == DATA_END)
    run_file.write_bytes(data[:end].replace(b'/crank_angle', b'/crank_bngle', 1))
    recovery = recover(run_file, tmp_path / 'again')
    assert [*recovery.counts] == ['/crank_angle']
    assert any('described in 2 ways' in remark for remark in recovery.remarks)


def test_unchunked_messages_are_found_again_one_by_one(runs: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    topic = Topic('/a', 'std_msgs/msg/Float64')
    messages = [Message(topic, bytes(12), n, n, n) for n in range(1, 101)]
    with path.open('wb') as file:
        writer = Writer(file, use_chunking=False)
        writer.start('ros2')
        channel = writer.register_channel('/a', 'cdr', writer.register_schema(topic.type, '', b''))
        for item in messages:
            writer.add_message(channel, item.log_time, item.data, item.publish_time, item.sequence)
        writer.finish()
    data = bytearray(path.read_bytes())
    starts = [start for opcode, start, _ in runs.record_spans(data) if opcode == 5]
    struct.pack_into('<Q', data, starts[40] + 1, 2**60)
    path.write_bytes(data)
    recover(path, tmp_path / 'again')
    with open_log(tmp_path / 'again') as log:
        found = [message.sequence for message in log.messages()]
    assert found == [*range(1, 41), *range(42, 101)]
