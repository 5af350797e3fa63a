"""SQLite files as rosbag2 wrote them in its time, by hand."""

from contextlib import closing
from pathlib import Path
import sqlite3
import struct

START = 1_700_000_000_000_000_000
FLOAT = 'std_msgs/msg/Float64'
HASH = 'RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a'

# What rosbag2 made when, by the version of the schema: topics, and what came with them.
_MESSAGES = """
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
    timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""
_METADATA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
    metadata TEXT NOT NULL);
"""
_DEFINITIONS = """
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
    encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
"""
_COLUMNS = 'id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL'
TABLES = {
    'dashing': f'CREATE TABLE topics({_COLUMNS}, serialization_format TEXT NOT NULL);',
    'foxy': f"""CREATE TABLE topics({_COLUMNS}, serialization_format TEXT NOT NULL,
        offered_qos_profiles TEXT NOT NULL);""",
}
TABLES['humble'] = TABLES['foxy'] + _METADATA
TABLES['jazzy'] = f"""CREATE TABLE topics({_COLUMNS}, serialization_format TEXT NOT NULL,
    offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
    {_METADATA}{_DEFINITIONS}"""


def number(n: int) -> bytes:
    """Return a Float64."""
    return b'\0\1\0\0' + struct.pack('<d', n)


def make_db3(path: Path, age: str = 'jazzy', count: int = 100, size: int = 0) -> Path:
    """Write a file as rosbag2 of an age did: numbers, each with a number of bytes behind it."""
    with closing(sqlite3.connect(path)) as bag, bag:
        begin(bag, age)
        add(bag, range(count), size)
    return path


def begin(bag: sqlite3.Connection, age: str = 'jazzy', messages: str = _MESSAGES) -> None:
    """Make the tables, that of the messages by a statement of its own, and a topic."""
    bag.executescript(TABLES[age] + messages)
    columns = len(bag.execute('PRAGMA table_info(topics)').fetchall())
    row = (1, '/number', FLOAT, 'cdr', '', HASH)[:columns]
    marks = ', '.join('?' * columns)
    bag.execute(f'INSERT INTO topics VALUES ({marks})', row)  # noqa: S608 - question marks


def add(bag: sqlite3.Connection, numbers: range, size: int = 0) -> None:
    """Add messages of the topic, a millisecond apart."""
    bag.executemany(
        'INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)',
        ((START + n * 1_000_000, number(n) + bytes(size)) for n in numbers),
    )
