"""Small logs as other recorders write them, to be played."""

from pathlib import Path
import struct
from typing import Any

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from mcap.writer import Writer
import yaml

START = 1_700_000_000_000_000_000
PERIOD = 10_000_000
COUNT = 100
LENGTH = (COUNT - 1) * PERIOD / 1e9
LATCHED = qos_to_yaml([Qos(history='keep_last', depth=1, durability='transient_local')])


def number(n: int) -> bytes:
    return b'\0\1\0\0' + struct.pack('<d', n)


def text(words: str) -> bytes:
    data = words.encode() + b'\0'
    return b'\0\1\0\0' + struct.pack('<I', len(data)) + data


def write_bag(path: Path, numbers: range = range(COUNT), **options: Any) -> Path:
    """
    Write a file with the library alone: a number every 10 ms, and at its start what is latched.

    A channel is JSON's, one is of a type that nobody has, one of a type that its topic had not;
    and one message is larger than its type can be.
    """
    with path.open('wb') as file:
        writer = Writer(file, **{'chunk_size': 500, **options})
        writer.start('ros2')
        channels = {name: _channel(writer, name, *more) for name, more in CHANNELS.items()}
        for n in numbers:
            time = START + n * PERIOD
            if n == 0:
                for name, data in FIRST:
                    writer.add_message(channels[name], time, data, time)
            writer.add_message(channels['number'], time, number(n), time - 1000, n)
            if n == 1:
                writer.add_message(channels['robot_description'], time, text('newer'), time)
        writer.finish()
    return path


def write_split_bag(folder: Path) -> Path:
    """Write a folder with two files, as rosbag2 splits a recording."""
    folder.mkdir()
    half = COUNT // 2
    for k, numbers in enumerate((range(half), range(half, COUNT))):
        write_bag(folder / f'{folder.name}_{k}.mcap', numbers)
    names = [f'{folder.name}_{k}.mcap' for k in range(2)]
    metadata = {'rosbag2_bagfile_information': {'version': 9, 'relative_file_paths': names}}
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(metadata))
    return folder


CHANNELS = {
    'number': ('std_msgs/msg/Float64', '', 'cdr'),
    'number as text': ('std_msgs/msg/String', '', 'cdr'),
    'robot_description': ('std_msgs/msg/String', LATCHED, 'cdr'),
    'clock': ('std_msgs/msg/String', '', 'cdr'),
    'unknown': ('nobody_msgs/msg/Has', '', 'cdr'),
    'json': ('std_msgs/msg/String', '', 'json'),
}
FIRST = (
    ('robot_description', text('older')),
    ('clock', text('no clock')),
    ('number as text', text('none')),
    ('number', bytes(100_000)),
    ('unknown', number(0)),
    ('json', b'{}'),
)


def _channel(writer: Writer, name: str, kind: str, qos: str, encoding: str) -> int:
    known = kind.startswith('std_msgs')
    words = definition(kind) if known else 'float64 data'
    schema = writer.register_schema(kind, 'ros2msg', words.encode())
    topic = f'/{name.partition(" ")[0]}'
    return writer.register_channel(topic, encoding, schema, {'offered_qos_profiles': qos})
