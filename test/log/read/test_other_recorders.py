"""Logs of other recorders and in other shapes are read completely."""

import random

from crank_runs import make_messages, NO_INDEX, write_mcap
from klann_ros.log.reader import open_log
from mcap.writer import CompressionType, IndexType, Writer
import pytest

SHAPES = {
    'zstd': {'compression': CompressionType.ZSTD},
    'lz4': {'compression': CompressionType.LZ4},
    'none': {'compression': CompressionType.NONE},
    'without CRC': {'enable_crcs': False},
    'unchunked': {'use_chunking': False},
    'without any index': NO_INDEX,
    'without message index': {'index_types': IndexType.CHUNK},
    'without statistics': {'use_statistics': False},
    'without repeated channels': {'repeat_channels': False, 'repeat_schemas': False},
    'without profile': {'profile': ''},
}


@pytest.mark.parametrize('shape', SHAPES)
def test_a_file_of_any_shape_is_read_completely(shape, tmp_path) -> None:
    messages = sorted(
        make_messages(60) + make_messages(60, '/other', 1_500_000),
        key=lambda message: message.log_time,
    )
    path = tmp_path / 'log.mcap'
    write_mcap(path, [messages], others=True, **{'chunk_size': 800, **SHAPES[shape]})
    with open_log(path) as log:
        assert log.complete, log.problem
        assert list(log.messages()) == messages
        assert [message.topic.name for message in log.messages(['/other'])] == ['/other'] * 60
        assert list(log.messages([])) == []
        assert {topic.name for topic in log.topics} == {'/crank_angle', '/other'}
        assert log.start_time == messages[0].log_time
        assert log.end_time == messages[-1].log_time
        assert log.metadata == {'m': [{'k': 'v'}]}
        assert [item.data for item in log.attachments] == [b'x' * 100]
        assert log.complete, log.problem


def test_messages_that_stand_out_of_order_come_in_order(tmp_path) -> None:
    messages = make_messages(200)
    shuffled = random.Random(4).sample(messages, 200)  # noqa: S311 - no secret
    write_mcap(tmp_path / 'log.mcap', [shuffled], chunk_size=500)
    with open_log(tmp_path / 'log.mcap') as log:
        assert list(log.messages()) == messages


def test_a_json_channel_is_reported_from_a_ros_one(tmp_path) -> None:
    with (tmp_path / 'log.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start('')
        schema = writer.register_schema('thing', 'jsonschema', b'{}')
        channel = writer.register_channel('/thing', 'json', schema, {'more': 'yes'})
        writer.add_message(channel, 1, b'{}', 1)
        writer.finish()
    with open_log(tmp_path / 'log.mcap') as log:
        (topic,) = log.topics
    assert (topic.message_encoding, topic.schema_encoding) == ('json', 'jsonschema')
    assert topic.extra == (('more', 'yes'),)
