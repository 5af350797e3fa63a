"""Runs to test with, and what stands where in their files."""

from pathlib import Path
import struct

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.log.writing.writer import RunWriter
import pytest

START = 1_700_000_000_000_000_000
HASH = 'RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a'


def make_topic(name='/crank_angle'):
    return Topic(
        name,
        'std_msgs/msg/Float64',
        definition('std_msgs/msg/Float64'),
        qos_to_yaml([Qos(depth=10, history='keep_last')]),
        HASH,
    )


def make_messages(count, name='/crank_angle', period=1_000_000):
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


def write_run(folder, batches, *, attachment=True, **options):
    """Write a run with a chunk for each batch of messages; return its file."""
    with RunWriter(folder, **options) as writer:
        if attachment:
            writer.attach('geometry.yaml', 'application/yaml', b'l_ab: 0.12', START)
            writer.add_metadata('solver', {'tolerance': '1e-12'})
        for batch in batches:
            for message in batch:
                writer.write(message)
            writer.flush()
    return writer.file_path


def record_spans(data):
    """Return (opcode, offset, end) of each record between the magics; an independent walk."""
    found, offset = [], 8
    while offset + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, offset)
        found.append((opcode, offset, offset + 9 + length))
        offset += 9 + length
    return found


def joined(batches):
    """Return the messages of all batches."""
    return [message for batch in batches for message in batch]


def all_but(batches, number):
    """Return the messages of all batches but one."""
    return joined(batch for other, batch in enumerate(batches) if other != number)


class Helpers:
    """What the tests share."""

    START = START
    HASH = HASH
    make_topic = staticmethod(make_topic)
    make_messages = staticmethod(make_messages)
    write_run = staticmethod(write_run)
    joined = staticmethod(joined)
    all_but = staticmethod(all_but)
    record_spans = staticmethod(record_spans)


@pytest.fixture(scope='session')
def runs():
    return Helpers


@pytest.fixture
def batches(runs):
    """Return the messages of six chunks, 40 each."""
    messages = runs.make_messages(240)
    return [messages[slice(end - 40, end)] for end in range(40, 280, 40)]


@pytest.fixture
def run_file(runs, tmp_path, batches) -> Path:
    """Write a run, closed, with a chunk for each batch; return its file."""
    return runs.write_run(tmp_path / 'walk', batches)
