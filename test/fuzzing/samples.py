"""Runs to damage: ours and other recorders', small, of a dozen chunks each."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
import random
import shutil
import struct

from crank_runs import NO_INDEX, write_mcap
from fuzzing.hostile import hostile_run
from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.writer import RunWriter
from mcap.writer import CompressionType
from mcap_bytes.conformance import CHUNKS as CHUNKED, FLAGS, legal_file
from rosbag2_bags import KINDS, write_bag
from rosbags.typesys import get_typestore, Stores
import yaml
import zstandard

START = 1_700_000_000_000_000_000
CHUNKS, MESSAGES = 10, 24


@dataclass(frozen=True)
class Sample:
    """A run's folder, and what it holds: data, log time, publish time and sequence of each."""

    name: str
    folder: Path
    messages: frozenset


def make_samples(place):
    """Write all kinds of runs into a folder; return them."""
    messages = make_messages()
    folders = [_write(place / f'ours_{c}', messages, c).parent for c in ('zstd', 'lz4', 'none')]
    folders += [
        _killed(place, messages),
        _split(place, messages),
        _others(place, 'without_crc', messages, enable_crcs=False),
        _others(place, 'unchunked', messages, use_chunking=False),
        _others(place, 'without_index', messages, **NO_INDEX),
        _others(place, 'plain', messages, compression=CompressionType.NONE, enable_crcs=False),
        _extended(place / 'extended', messages, FLAGS),
        _extended(place / 'extended_without_index', messages, [CHUNKED]),
    ]
    folders.append(_packed(place / 'packed', place / 'ours_zstd' / 'ours_zstd_0.mcap'))
    contents = frozenset(map(content, messages))
    hostile, hostile_messages = hostile_run(place, messages)
    return [
        *(Sample(folder.name, folder, contents) for folder in folders),
        Sample(hostile.name, hostile, frozenset(map(content, hostile_messages))),
        *_rosbag2(place, messages),
    ]


def _packed(folder, file):
    """Write a run whose file is compressed as a whole, by whatever tool."""
    folder.mkdir()
    packed = zstandard.ZstdCompressor().compress(file.read_bytes())
    (folder / f'{folder.name}_0.mcap.zstd').write_bytes(packed)
    return folder


def _rosbag2(place, messages):
    """Yield bags of rosbag2's own ways, in which a message has one time and no number."""
    for storage, mode in KINDS:
        name = f'{storage.name}_{mode.name}'.lower()
        folder = write_bag(place / name, messages, storage, mode)
        contents = ((message.data, message.log_time, message.log_time, 0) for message in messages)
        yield Sample(name, folder, frozenset(contents))


def content(message):
    """Return what must not change in a message."""
    return message.data, message.log_time, message.publish_time, message.sequence


@cache
def make_messages():
    """Return the messages of all samples."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = {'/crank_angle': 'std_msgs/msg/Float64', '/point_h': 'geometry_msgs/msg/PointStamped'}
    topics = []
    for depth, (name, kind) in enumerate(kinds.items()):
        qos = qos_to_yaml([Qos(depth=depth)])
        topics.append(Topic(name, kind, definition(kind), qos, 'RIHS01_' + 'a' * 64))
    header = store.types['std_msgs/msg/Header']
    time = store.types['builtin_interfaces/msg/Time'](1, 2)
    point = store.types['geometry_msgs/msg/Point']
    messages = []
    for n in range(CHUNKS * MESSAGES):
        topic = topics[n % 2 if n > MESSAGES else 0]
        if topic is topics[0]:
            data = b'\0\1\0\0' + struct.pack('<d', 0.01 * n)
        else:
            place = store.types[topic.type](header(time, 'leg_plane'), point(0.1 * n, 0.2, 0.0))
            data = bytes(store.serialize_cdr(place, topic.type))
        messages.append(Message(topic, data, START + n * 10**6, START + n * 10**6 - 1000, n + 1))
    return messages


def _chunks(messages):
    return [messages[slice(n, n + MESSAGES)] for n in range(0, len(messages), MESSAGES)]


def _write(folder, messages, compression='zstd'):
    with RunWriter(folder, compression=compression) as writer:
        writer.attach('geometry.yaml', 'application/yaml', b'l_ab: 0.12\n' * 20, START)
        writer.add_metadata('solver', {'tolerance': '1e-12'})
        for number, chunk in enumerate(_chunks(messages)):
            for message in chunk:
                writer.write(message)
            writer.flush()
            if number == 3:
                writer.attach('note.txt', 'text/plain', b'in the middle', START)
                writer.add_metadata('note', {'where': 'in the middle'})
    return writer.file.path


def _extended(folder, messages, flags):
    """Write a run as a later version of MCAP might: legal, and longer."""
    folder.mkdir()
    # Nothing large: a chunk that damage moved into it would be no longer of the file.
    chance, options = random.Random(5), {'large': False, 'compression': 'zstd'}  # noqa: S311
    data = legal_file(messages, chance, flags={*flags}, **options)
    (folder / f'{folder.name}_0.mcap').write_bytes(data)
    return folder


def _killed(place, messages):
    folder = place / 'killed'
    path = _write(folder, messages)
    data = path.read_bytes()
    # In the middle of the last chunk's index.
    end = data.rindex(b'\x0c', 0, data.rindex(b'serialized_metadata')) - 20
    path.write_bytes(data[:end])
    return folder


def _split(place, messages):
    folder = place / 'split'
    folder.mkdir()
    names, middle = [], len(messages) // 2
    for number, half in enumerate((messages[:middle], messages[middle:])):
        path = _write(place / f'half{number}', half)
        names.append(f'split_{number}.mcap')
        shutil.copy(path, folder / names[-1])
        shutil.rmtree(path.parent)
    metadata = {'rosbag2_bagfile_information': {'version': 9, 'relative_file_paths': names}}
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(metadata))
    return folder


def _others(place, name, messages, **options):
    folder = place / name
    folder.mkdir()
    write_mcap(folder / f'{name}_0.mcap', [messages], others=True, chunk_size=1500, **options)
    return folder
