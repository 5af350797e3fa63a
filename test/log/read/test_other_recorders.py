"""Logs of other recorders."""

import random

from crank_runs import make_messages, write_mcap
from klann_ros.log.reader import open_log
from mcap.writer import Writer


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
