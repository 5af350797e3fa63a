"""A file costs work in proportion to its bytes and the messages in it, whatever it asks for."""

from contextlib import closing
import pickle
import subprocess
import sys

from call_counter import Work
from klann_ros.log.bag_metadata import QOS_KEY
from klann_ros.log.mcap import decompression
from klann_ros.log.mcap.growing import GrowingFile
from klann_ros.log.qos import MAX_QOS_DISTINCT, MAX_QOS_TEXT, MAX_QOS_TOTAL, Qos, qos_to_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.records import Topic
from klann_ros.log.recovery import recover
from klann_ros.sanitize import yaml_text
from mcap_bytes import records as mcap
from mcap_bytes.hostile import (
    CHANNEL,
    EMPTY,
    file_of,
    file_of_chunks,
    HEADER,
    INSIDE,
    named_often,
    OUTSIDE,
    overlapping,
    packed_chunk,
)
import pytest

SIZE = 5000
# Calls for a byte of the file, and at all. Damage behind each record costs most.
EACH, ONCE = 100, 5000
# Calls to write a run.
WRITING = 50_000
# Calls for a message in a file that is sound.
MESSAGE = 15


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a file as a review does: how much work, how many messages."""
    path = tmp_path / 'x.mcap'

    def work(data):
        path.write_bytes(data)
        with Work() as done, open_log(path) as log:
            message_count = sum(map(len, log.blocks()))
        return done.calls, message_count

    return work


@pytest.mark.slow
@pytest.mark.parametrize('shape', OUTSIDE)
def test_twice_the_bytes_take_no_more_than_twice_the_work(read, shape) -> None:
    once, _ = read(file_of(shape, SIZE))
    twice, _ = read(file_of(shape, 2 * SIZE))
    assert twice <= 2.5 * once + ONCE
    assert twice <= EACH * 2 * SIZE + ONCE


def test_damage_everywhere_is_recovered_at_the_same_cost(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(file_of('a bad byte behind each metadata record', SIZE))
    with Work() as done:
        recovery = recover(path, tmp_path / 'again')
    assert recovery.metadata > 100
    assert done.calls <= 2 * EACH * SIZE + WRITING


def test_sound_messages_outside_of_chunks_cost_little(read) -> None:
    calls, message_count = read(HEADER + CHANNEL + EMPTY * 10_000)
    assert message_count == 10_000
    assert calls <= MESSAGE * message_count + ONCE


def test_zeros_in_a_chunk_are_skipped(read, tmp_path) -> None:
    data = HEADER + packed_chunk(CHANNEL + EMPTY + bytes(2**20))
    calls, message_count = read(data)
    assert message_count == 1
    assert calls <= ONCE
    with open_log(tmp_path / 'x.mcap') as log:
        assert 'in part only: what stands in it is no record' in log.problems[-1]


@pytest.mark.slow
@pytest.mark.parametrize('shape', INSIDE)
def test_many_chunks_of_no_use_cost_hardly_more_than_some(read, shape, monkeypatch) -> None:
    monkeypatch.setattr(decompression, '_BUDGET', 2**20)
    few_calls, _ = read(file_of_chunks(shape, 2**18, 5))
    many_calls, _ = read(file_of_chunks(shape, 2**18, 25))
    size = len(file_of_chunks(shape, 2**18, 20))
    assert many_calls <= 1.2 * few_calls + EACH * size


def test_useless_decompression_is_limited(read, monkeypatch) -> None:
    """Each unpacks to 10 MB that have another CRC: all of it is needed to know that."""
    monkeypatch.setattr(decompression, '_BUDGET', 2**25)
    unpacked = []
    unpack = decompression._DECOMPRESSORS['zstd']

    def count(data, size):
        for piece in unpack(data, size):
            unpacked.append(len(piece))
            yield piece

    monkeypatch.setitem(decompression._DECOMPRESSORS, 'zstd', count)
    chunk = packed_chunk(EMPTY * (10 * 2**20 // len(EMPTY)), crc=1)
    read(HEADER + chunk * 30)
    passes = 2
    assert sum(unpacked) <= passes * (
        2**25 + 2 * 10 * 2**20 + decompression.FREE_RATIO * 31 * len(chunk)
    )


def test_a_limit_that_was_met_is_reported_and_later_messages_are_read(
    read, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(decompression, '_BUDGET', 2**20)
    useless = file_of_chunks('private records', 2**20, 3)
    _, message_count = read(useless + packed_chunk(CHANNEL + EMPTY * 100))
    assert message_count == 100
    with open_log(tmp_path / 'x.mcap') as log:
        assert any('more records in it that are no messages' in text for text in log.problems)
        assert any('too many useless bytes' in text for text in log.problems)


def test_private_records_around_messages_are_not_counted_as_useless(read, monkeypatch) -> None:
    """A recorder may put some of its own beside each message; a sound file has no limit."""
    monkeypatch.setattr(decompression, '_BUDGET', 2**20)
    chunk = packed_chunk(CHANNEL + (EMPTY + mcap.record(0x80, b'mine') * 5) * 200)
    _, message_count = read(HEADER + chunk * 20)
    assert message_count == 4000


def test_an_index_that_names_a_record_often_is_not_asked_for_it_often(read, tmp_path) -> None:
    once, _ = read(named_often(20))
    twice, message_count = read(named_often(40))
    assert message_count == 1000
    assert twice <= 2.5 * once
    with open_log(tmp_path / 'x.mcap') as log:
        assert len(list(log.messages())) == 1000
        assert len(log.attachments) == 1
        assert 'the index is wrong' in log.problem


def test_chunks_that_cannot_be_merged_are_read_in_one_pass(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(overlapping(5, 20 * 2**20))
    with open_log(path) as log:
        sequences = sorted(message.sequence for message in log.messages())
        assert sequences == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
        assert log.problems == ()
    path.write_bytes(overlapping(20, 2**20))
    with open_log(path) as log:
        assert [message.sequence for message in log.messages()] == [*range(20)] * 2
        assert log.problems == ()


def test_a_chunk_larger_than_its_index_entry_is_reported(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(overlapping(2, 20 * 2**20, honest=False))
    with open_log(path) as log:
        assert list(log.messages()) == []
        assert 'the index is wrong about this chunk, which is left out' in log.problem
    path.write_bytes(overlapping(2, 1000, honest=False))
    with open_log(path) as log:
        assert len(list(log.messages())) == 2
        assert 'the index is wrong about this chunk' in log.problem


def file_of_channels(channels, schema=b''):
    """Return a file of channels that share a schema, a message of each; a channel is a mapping."""
    numbered = list(enumerate(channels, start=1))
    definitions = b''.join(
        mcap.channel(n, 1, entry.get('topic', f'/{n}'), 'cdr', entry.get('metadata', {}))
        for n, entry in numbered
    )
    messages = b''.join(mcap.message(n, 1, n, n, b'') for n, _ in numbered)
    about = mcap.schema(1, 'a/msg/B', 'ros2msg', schema)
    return HEADER + packed_chunk(about + definitions) + packed_chunk(messages)


def test_channels_that_differ_in_little_are_reported_apart_at_no_cost(read) -> None:
    def channels(count):
        return file_of_channels([{'topic': '/a', 'metadata': {'x': str(n)}} for n in range(count)])

    once, message_count = read(channels(1000))
    twice, _ = read(channels(2000))
    assert message_count == 1000
    assert twice <= 2.5 * once


def test_a_topic_is_the_same_in_another_process() -> None:
    code = (
        'import pickle, sys\n'
        'topic = pickle.load(sys.stdin.buffer)\n'
        'same = type(topic)(topic.name, topic.type, topic.definition)\n'
        'sys.exit(0 if topic in {same} else 1)'
    )
    topic = Topic('/a', 'a/msg/B', 'text')
    subprocess.run([sys.executable, '-c', code], input=pickle.dumps(topic), check=True)


def test_many_channels_share_the_text_of_their_schema(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(file_of_channels([{}] * 500, schema=b'#' + b'x' * 10**5))
    with open_log(path) as log:
        texts = {id(topic.definition) for topic in log.topics}
        assert len(log.topics) == 500
        assert {len(topic.definition) for topic in log.topics} == {10**5 + 1}
        assert len(texts) == 1


def test_a_schema_that_changes_is_of_its_own_channels_alone(tmp_path) -> None:
    """Channel 1 has the first schema, which is there a second time in two other words."""
    path = tmp_path / 'x.mcap'
    schema_1, schema_2 = (mcap.schema(n, 'a/msg/B', 'ros2msg', b'uint8 a') for n in (1, 2))
    better = mcap.schema(1, 'a/msg/B', 'ros2msg', b'uint8 b')
    channels = mcap.channel(1, 1, '/one', 'cdr', {}) + mcap.channel(2, 2, '/two', 'cdr', {})
    messages = mcap.message(1, 1, 1, 1, b'') + mcap.message(2, 1, 1, 1, b'')
    definitions = packed_chunk(schema_1 + schema_2 + channels + messages)
    path.write_bytes(HEADER + definitions + packed_chunk(better) * 2)
    with open_log(path) as log:
        definitions_read = {topic.name: topic.definition for topic in log.topics}
    assert definitions_read == {'/one': 'uint8 b', '/two': 'uint8 a'}


def test_a_schema_that_comes_late_to_a_growing_file_is_taken_from_then_on(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    first, second = (mcap.message(1, n, n, n, b'') for n in (1, 2))
    channel, schema = mcap.channel(1, 1, '/a', 'cdr', {}), mcap.schema(1, 'a/msg/B', '', b'')
    path.write_bytes(HEADER + packed_chunk(channel + first) + packed_chunk(schema + second))
    with closing(GrowingFile(path)) as file:
        assert [message.sequence for message in file.read()] == [2]


PROFILE = qos_to_yaml([Qos()])
TEXT, LONG = f'{PROFILE}\n# of this test alone', '[]' + ' ' * 2**17
# The texts of a file's channels, the characters that are parsed, and the profiles left out.
PROFILES = {
    'the same once': ([TEXT] * 50, len(TEXT), 0, ''),
    'too long': (
        ['\n' * (MAX_QOS_TEXT + 1), '\n' * 10],
        10,
        1,
        f'/1: left out: malformed quality of service: it has {MAX_QOS_TEXT + 1} characters, more',
    ),
    'too long together, all different': (
        ['\n' * (2**17 + n) for n in range(12)],
        7 * 2**17 + sum(range(7)),
        5,
        f'the profiles that differ have more than {MAX_QOS_DISTINCT}',
    ),
    'too long together, all equal': (
        [LONG] * 40,
        len(LONG),
        40 - MAX_QOS_TOTAL // len(LONG),
        f'the profiles of all topics have more than {MAX_QOS_TOTAL}',
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize('kind', PROFILES)
def test_profiles_are_parsed_once_and_within_limits(tmp_path, monkeypatch, kind) -> None:
    texts, characters, count, reason = PROFILES[kind]
    path = tmp_path / 'x.mcap'
    path.write_bytes(file_of_channels([{'metadata': {QOS_KEY: text}} for text in texts]))
    parsed, load = [], yaml_text.load
    monkeypatch.setattr(yaml_text, 'load', lambda text: parsed.append(text) or load(text))
    recovery = recover(path, tmp_path / 'again')
    assert sum(map(len, parsed)) == characters
    assert (recovery.messages, recovery.lost) == (len(texts), [])
    said = [text for text in recovery.remarks if 'quality of service' in text]
    assert len(said) == count
    assert all(reason in text for text in said)
    with open_log(tmp_path / 'again') as log:
        assert sum(topic.qos != '' for topic in log.topics) == len(texts) - count


def test_ten_thousand_topics_may_have_profiles() -> None:
    assert len(PROFILE) * 10_000 <= MAX_QOS_TOTAL
