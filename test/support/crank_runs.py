"""Runs of a crank's angle, and what stands where in their files."""

from collections.abc import Iterable
from pathlib import Path
import struct
from typing import Any

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.writer import RunWriter
from mcap.writer import IndexType, Writer

START = 1_700_000_000_000_000_000
HEADER, MESSAGE, CHUNK, ATTACHMENT, METADATA, DATA_END = 1, 5, 6, 9, 12, 15
HASH = 'RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a'


def make_topic(name: str = '/crank_angle') -> Topic:
    return Topic(
        name,
        'std_msgs/msg/Float64',
        definition('std_msgs/msg/Float64'),
        qos_to_yaml([Qos(depth=10, history='keep_last')]),
        HASH,
    )


def make_messages(
    count: int, name: str = '/crank_angle', period: int = 1_000_000
) -> list[Message]:
    """Return messages whose data, times and numbers all differ."""
    topic = make_topic(name)
    return [
        Message(
            topic,
            b'\x00\x01\x00\x00' + struct.pack('<d', 0.01 * n),
            START + n * period,
            START + n * period - 100_000,
            n + 1,
        )
        for n in range(count)
    ]


def write_run(
    folder: Path, batches: Iterable[Iterable[Message]], *, attachment: bool = True, **options: Any
) -> Path:
    """Write a run with a chunk for each batch of messages; return its file."""
    with RunWriter(folder, **options) as writer:
        if attachment:
            writer.attach('geometry.yaml', 'application/yaml', b'l_ab: 0.12', START)
            writer.add_metadata('solver', {'tolerance': '1e-12'})
        for batch in batches:
            for message in batch:
                writer.write(message)
            writer.flush()
    return writer.file.path


NO_INDEX = {
    'index_types': IndexType.NONE,
    'use_statistics': False,
    'repeat_channels': False,
    'repeat_schemas': False,
    'use_summary_offsets': False,
}


def write_mcap(
    path: Path,
    batches: Iterable[Iterable[Message]],
    *,
    profile: str = 'ros2',
    others: bool = False,
    metadata: Iterable[tuple[str, dict[str, str]]] = (),
    **options: Any,
) -> Path:
    """Write a file by the MCAP library alone, a chunk or more for each batch of messages."""
    with path.open('wb') as file:
        writer = Writer(file, **options)
        writer.start(profile)
        channels: dict[Topic, int] = {}
        schemas: dict[str, int] = {}
        for batch in batches:
            for message in batch:
                topic = message.topic
                if topic not in channels:
                    if topic.type not in schemas:
                        definition_text = topic.definition.encode()
                        schemas[topic.type] = writer.register_schema(
                            topic.type, 'ros2msg', definition_text
                        )
                    about = {'offered_qos_profiles': topic.qos, 'topic_type_hash': topic.type_hash}
                    channels[topic] = writer.register_channel(
                        topic.name, 'cdr', schemas[topic.type], about
                    )
                writer.add_message(
                    channels[topic],
                    message.log_time,
                    message.data,
                    message.publish_time,
                    message.sequence,
                )
            writer.flush()  # type: ignore[no-untyped-call] # theirs
        for name, content in metadata:
            writer.add_metadata(name, content)
        if others:
            writer.add_attachment(1, 2, 'a', 'text/plain', b'x' * 100)
            writer.add_metadata('m', {'k': 'v'})
        writer.finish()  # type: ignore[no-untyped-call] # theirs
    return path


def record_spans(data: bytes) -> list[tuple[int, int, int]]:
    """Return (opcode, offset, end) of each record between the magics; an independent walk."""
    spans = []
    offset = 8
    while offset + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, offset)
        spans.append((opcode, offset, offset + 9 + length))
        offset += 9 + length
    return spans


def spans_of(data: bytes, opcode: int) -> list[tuple[int, int]]:
    return [(start, end) for kind, start, end in record_spans(data) if kind == opcode]


def killed(data: bytes) -> bytes:
    """Return a file as a kill leaves it: without the end of its data."""
    ((end, _),) = spans_of(data, DATA_END)
    return data[:end]


MESSAGES = make_messages(240)
BATCHES = [MESSAGES[slice(end - 40, end)] for end in range(40, 280, 40)]
"""The messages of six chunks, 40 each."""


def joined(batches: Iterable[Iterable[Message]]) -> list[Message]:
    return [message for batch in batches for message in batch]


def all_but(number: int) -> list[Message]:
    return joined(batch for k, batch in enumerate(BATCHES) if k != number)
