"""
A run in which every name is one that would rather be something else on a terminal.

Names of topics, types, encodings, records, files, legs and nodes clear the screen, change its
colours and its title, turn the direction of a line, and forge lines of the report.
"""

from dataclasses import replace
import json
import struct

from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import LOSS_RECORD, PAUSE_RECORD, SOLVER_RECORD
from klann_ros.messages import JointStateTemplate
from mcap.writer import Writer
import yaml

FORGED = 'ERROR forged'
BREAKS = '\n', '\r', '\r\n', '\v', '\f', '\x1c', '\x1e', '\x85', '\u2028', '\u2029'
EVIL = ''.join(f'{line_break}{FORGED}' for line_break in BREAKS) + (
    '\x1b[2J\x1b]0;title\x07\x9b31m\x9d0;t\x9c\b\x7f\u202e\u2066\u200f\u200b\ufeff\U000e0041\0'
)
JOINTS = 'alpha', 'gamma', 'beta', 'delta', 'theta'
START = 1_700_000_000_000_000_000
COUNT = 30


def hostile_run(place, first=()):
    """Write such a run; return its folder, and its messages with those that are to be first."""
    folder = place / 'hostile'
    folder.mkdir(parents=True)
    name = f'hostile{EVIL}_0.mcap'.replace('\0', '')[:60]
    messages = [*first, *_messages()]
    with (folder / name).open('wb') as file:
        writer = Writer(file, chunk_size=1500)
        writer.start('ros2' + EVIL, EVIL)
        channels = {}
        for number, message in enumerate(messages):
            topic = message.topic
            if topic not in channels:
                channels[topic] = _channel(writer, topic)
            times = message.log_time, message.publish_time
            writer.add_message(channels[topic], times[0], message.data, times[1], message.sequence)
            if number == len(messages) // 2:
                writer.add_attachment(1, 2, EVIL, EVIL, b'x' * 50)
        for record, content in _records():
            writer.add_metadata(record, content)
        writer.finish()
    names = [name, f'gone{EVIL}_1.mcap', EVIL, '..']
    metadata = {'compression_mode': EVIL, 'relative_file_paths': names}
    text = yaml.safe_dump({'rosbag2_bagfile_information': metadata, EVIL: EVIL})
    (folder / 'metadata.yaml').write_text(text)
    return folder, messages


def _channel(writer, topic):
    schema = writer.register_schema(
        topic.type, topic.schema_encoding, topic.definition.encode('utf-8', 'replace')
    )
    metadata = {'offered_qos_profiles': topic.qos, EVIL: EVIL}
    return writer.register_channel(topic.name, topic.message_encoding, schema, metadata)


def _messages():
    """Yield some messages of each kind: cranks, poses, feet, reports, and of unknown types."""
    crank, state = 'std_msgs/msg/Float64', 'sensor_msgs/msg/JointState'
    foot, report = 'geometry_msgs/msg/PointStamped', 'diagnostic_msgs/msg/DiagnosticArray'
    topics = [
        Topic(f'/{EVIL}{suffix}', kind, definition(kind), f'- {{history: "{FORGED}\\u202e"}}')
        for suffix, kind in (
            ('/crank_angle', crank),
            ('/joint_states', state),
            ('/point_h', foot),
            ('/diagnostics', report),
        )
    ]
    topics += [
        Topic(f'/x{EVIL}', EVIL, EVIL),
        replace(topics[1], name='/joint_states', definition=f'{EVIL}\na/{EVIL} y\nx\n'),
        Topic('/other/point_h', foot, f'float64 {EVIL}\n', f'{EVIL}: ['),
        replace(topics[0], name=f'/json{EVIL}', message_encoding=EVIL, schema_encoding=EVIL),
        Topic('/long' + 'x' * 5000 + EVIL, crank, definition(crank)),
    ]
    # A leg whose name is as bad as all others.
    pose = JointStateTemplate([f'{EVIL[:-1]}/{joint}' for joint in JOINTS])
    for number in range(COUNT):
        for position, topic in enumerate(topics):
            time = START + (number * len(topics) + position) * 1_000_000
            data = b'\0\1\0\0' + struct.pack('<d', 0.1 * number)
            if topic.type == state:
                data = pose.fill(1, number, [0.1 * number] * 5)
            yield Message(topic, data, time, time - 1000, number + 1 + number // 10)


def _records():
    legs = {'legs': [EVIL[:-1], EVIL], EVIL: EVIL, f'{EVIL}.l_ab': EVIL}
    for node in ('/solver_node', f'/{EVIL}/solver_node'):
        record = {'node': node, 'time': '1', 'parameters': json.dumps({**legs, 'l_ab': 0.12})}
        yield SOLVER_RECORD, record
    count = {'received': 9, 'written': 5, 'dropped': 4, 'skipped': 0, 'missed': 3, 'lost': 7}
    count |= {'before_discovery': 0, 'departed': 0}
    yield LOSS_RECORD, {f'/lost{EVIL}': json.dumps(count), EVIL: json.dumps(count)}
    yield PAUSE_RECORD, {'from': EVIL, 'to': '1', 'skipped': '{}'}
    yield EVIL, {EVIL: EVIL}
