"""Runs of a crank's angle, and what stands where in their files."""

from collections.abc import Iterable
from pathlib import Path
import struct
from typing import Any

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.writer import RunWriter

START = 1_700_000_000_000_000_000
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


def record_spans(data: bytes) -> list[tuple[int, int, int]]:
    """Return (opcode, offset, end) of each record between the magics; an independent walk."""
    found, offset = [], 8
    while offset + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, offset)
        found.append((opcode, offset, offset + 9 + length))
        offset += 9 + length
    return found


def joined(batches: Iterable[Iterable[Message]]) -> list[Message]:
    """Return the messages of all batches."""
    return [message for batch in batches for message in batch]


def all_but(batches: Iterable[Iterable[Message]], number: int) -> list[Message]:
    """Return the messages of all batches but one."""
    return joined(batch for other, batch in enumerate(batches) if other != number)
