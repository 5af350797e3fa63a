"""
Tables of an untrusted SQLite file of rosbag2: its topics and its messages, and nothing else.

Views, triggers, indexes and functions of the schema are refused when a statement is prepared,
before anything of it runs (https://www.sqlite.org/security.html). The file is opened immutable: no
file is made beside it, and no lock is awaited.
"""

from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
import sqlite3
from typing import NamedTuple, TypeAlias

from klann_ros.log.definitions import definition
from klann_ros.log.errors import UnknownTypeError
from klann_ros.log.records import Topic
from klann_ros.sanitize.text import printable

# Topic id, time [ns], data.
Row: TypeAlias = tuple[int, int, bytes]

_MASTER = 'sqlite_master'
_READABLE = frozenset(
    ('topics', 'messages', 'message_definitions', 'metadata', _MASTER, 'sqlite_schema')
)
_FUNCTIONS = frozenset(('count', 'length', 'max', 'min', 'sum', 'typeof'))
_SETTINGS = (
    'PRAGMA trusted_schema = OFF',
    'PRAGMA query_only = ON',
    'PRAGMA cell_size_check = ON',
    'PRAGMA mmap_size = 0',
    'PRAGMA temp_store = MEMORY',
)

# Columns of each table; '' in each row for those that an old table lacks.
_TOPIC_COLUMNS = (
    'id',
    'name',
    'type',
    'serialization_format',
    'offered_qos_profiles',
    'type_description_hash',
)
_DEFINITION_COLUMNS = ('topic_type', 'encoding', 'encoded_message_definition')
_ENCODINGS = ('ros2msg', 'ros2idl')
# Size of a table's texts [bytes], and number of topics.
_MAX_TABLE_SIZE = 32 * 1024 * 1024
_MAX_TOPICS = 65535
# Charged for each row: pages that are linked repeatedly hold endless rows without text [bytes].
_TEXT_ROW_SIZE = 64

# Messages of a range, its approximate and maximum size [bytes]; one message may be larger.
_MAX_ROWS, _RANGE_SIZE, _MAX_RANGE_SIZE = 4096, 2 * 1024 * 1024, 16 * 1024 * 1024
# Minimum size of a row: its length, its number, and the types of its columns [bytes].
_MIN_ROW_SIZE = 6
# Columns may hold values of any type, whatever their declaration.
_SOUND = (
    "typeof(data) = 'blob' AND typeof(topic_id) = 'integer' "
    "AND typeof(timestamp) = 'integer' AND timestamp >= 0"
)
# An index may disagree with its table.
_FROM = 'FROM messages NOT INDEXED'
_SURVEY = f"""
SELECT topic, sound, count(*), min(time), max(time), min(id), max(id), sum(size),
    count(DISTINCT id) FROM (
    SELECT id, CASE typeof(topic_id) WHEN 'integer' THEN topic_id END AS topic,
        CASE typeof(timestamp) WHEN 'integer' THEN timestamp END AS time,
        length(data) AS size, {_SOUND} AS sound
    {_FROM} WHERE id >= ? ORDER BY id LIMIT ?
) GROUP BY topic, sound
"""  # noqa: S608 - our own
# Limited: pages that are linked repeatedly hold endless rows.
_COUNT = f'SELECT count(*) FROM (SELECT 1 {_FROM} LIMIT ?)'  # noqa: S608 - our own
_READ = f'SELECT topic_id, timestamp, data {_FROM} WHERE id BETWEEN ? AND ? AND {_SOUND}'


class DatabaseError(Exception):
    """SQLite cannot read the file, or its rows are inconsistent; the text says why."""


@contextmanager
def database(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a file without its journal; texts are bytes; a DatabaseError if SQLite refuses it."""
    uri = f'{path.absolute().as_uri()}?mode=ro&immutable=1'
    try:
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as connection:
            connection.text_factory = bytes
            for setting in _SETTINGS:
                connection.execute(setting).close()
            connection.set_authorizer(_authorize)
            yield connection
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise DatabaseError(reason_of(error)) from None


def _authorize(
    action: int, first: str | None, second: str | None, _: str | None, source: str | None
) -> int:
    """Allow only these actions, and not from inside a view or a trigger."""
    allowed = {
        sqlite3.SQLITE_SELECT: True,
        sqlite3.SQLITE_READ: first in _READABLE,
        sqlite3.SQLITE_FUNCTION: second in _FUNCTIONS,
        sqlite3.SQLITE_PRAGMA: first == 'table_xinfo',
    }
    is_allowed = source is None and allowed.get(action, False)
    return sqlite3.SQLITE_OK if is_allowed else sqlite3.SQLITE_DENY


def reason_of(error: Exception) -> str:
    """Return why SQLite failed; its own message may quote names that are no UTF-8."""
    if isinstance(error, UnicodeDecodeError):
        return 'its schema is damaged: a name in it is no UTF-8 text'
    return printable(error)


def columns(connection: sqlite3.Connection, table: str) -> frozenset[str]:
    """Return the columns of a table of rosbag2; none if it is no table with numbered rows."""
    condition = f"type = 'table' AND name = '{table}'"
    query = f'SELECT rootpage FROM {_MASTER} WHERE {condition}'  # noqa: S608 - our own
    root_page = connection.execute(query).fetchone()
    # Virtual tables have no page of their own.
    if root_page is None or not root_page[0]:
        return frozenset()
    stored = set()
    is_numbered = False
    description = connection.execute(f'PRAGMA table_xinfo({table})')
    for _, name, kind, _, _, primary_key, hidden in description.fetchall():
        is_numbered |= (name, kind, primary_key) == (b'id', b'INTEGER', 1)
        # Hidden columns are computed when they are read.
        if not hidden:
            stored.add(_text(name))
    return frozenset(stored) if is_numbered and 'id' in stored else frozenset()


def table_names(connection: sqlite3.Connection) -> list[str]:
    """Return the names of the first tables."""
    query = f"SELECT name FROM {_MASTER} WHERE type = 'table' LIMIT 5"  # noqa: S608
    return [_text(name) for (name,) in connection.execute(query)]


def _text(cell: object) -> str:
    return cell.decode(errors='replace') if isinstance(cell, bytes) else str(cell)


@dataclass
class BagDescription:
    """The tables of a bag beside its messages; `read` fills it."""

    # The topics by their ids.
    topics: dict[int, Topic] = field(default_factory=dict)
    # YAML of ``metadata.yaml`` without its root key, the last one last.
    metadata: list[str] = field(default_factory=list)
    # Installed definitions by type, '' without one: bags before Iron have none of their own.
    installed: dict[str, str] = field(default_factory=dict)
    # The parts that were left out, one line each.
    problems: list[str] = field(default_factory=list)

    def read(self, connection: sqlite3.Connection) -> None:
        """Read the tables."""
        definitions = {}
        for row in self._text_rows(connection, 'message_definitions', _DEFINITION_COLUMNS):
            kind, encoding, text = map(_text, row)
            if text and encoding in _ENCODINGS:
                definitions[kind] = encoding, text
        for number, *texts in self._text_rows(connection, 'topics', _TOPIC_COLUMNS):
            if not isinstance(number, int):
                self._leave_out('a topic without a number is left out')
            elif len(self.topics) >= _MAX_TOPICS:
                self._leave_out(f'there are more than {_MAX_TOPICS} topics')
            else:
                name, kind, encoding, qos, type_hash = map(_text, texts)
                schema, text = definitions.get(kind, ('ros2msg', ''))
                text = text or self._installed(kind)
                self.topics[number] = Topic(name, kind, text, qos, type_hash, encoding, schema)
        for (yaml,) in self._text_rows(connection, 'metadata', ('metadata',)):
            self.metadata.append(_text(yaml))

    def _installed(self, kind: str) -> str:
        if kind not in self.installed:
            try:
                self.installed[kind] = definition(kind)
            except (UnknownTypeError, OSError):
                self.installed[kind] = ''
        return self.installed[kind]

    def _leave_out(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)

    def _text_rows(
        self, connection: sqlite3.Connection, table: str, names: tuple[str, ...]
    ) -> Iterator[tuple[object, ...]]:
        """Yield some columns of a table's rows, up to a size."""
        existing = columns(connection, table)
        if not existing:
            return
        selected = ', '.join(name if name in existing else "''" for name in names)
        size = 0
        query = f'SELECT {selected} FROM {table} NOT INDEXED ORDER BY id'  # noqa: S608 - our own
        for row in connection.execute(query):
            size += _TEXT_ROW_SIZE + sum(len(cell) for cell in row if isinstance(cell, bytes))
            if size > _MAX_TABLE_SIZE:
                self.problems.append(f'there are more than {_MAX_TABLE_SIZE} bytes of {table}')
                return
            yield row


@dataclass(frozen=True)
class RowRange:
    """Messages that are read together."""

    # The first and the last row.
    first: int
    last: int
    # Earliest and latest time [ns].
    start: int
    end: int
    # Topic ids.
    topics: frozenset[int]
    # Number of messages.
    count: int
    # Approximate place in the file [bytes].
    offset: int

    def __str__(self) -> str:
        """Return its name in messages."""
        return f'messages {self.first} to {self.last}'


class _Group(NamedTuple):
    """Rows of a topic that all hold messages, or none: a row of `_SURVEY`."""

    topic: int
    is_sound: int
    row_count: int
    # Earliest and latest time [ns].
    start: int
    end: int
    # The first and the last row.
    first: int
    last: int
    # Size of the data [bytes]; None if no row has any.
    size: int | None
    # Number of different rows: linked pages repeat some.
    distinct_count: int


class MessageRows:
    """
    The table of messages, in `ranges` of rows as large as a chunk; `unsound` rows hold no message.

    A DatabaseError means that SQLite refuses it or that its rows are inconsistent.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.ranges: list[RowRange] = []
        self.count = self.unsound = 0
        self._path = path
        self.size = size
        with database(path) as connection:
            self._survey(connection)
            expected = self.count + self.unsound
            (row_count,) = connection.execute(_COUNT, (expected + 1,)).fetchone()
        if row_count != expected:
            raise DatabaseError('its rows are out of order')

    def read(self, rows: RowRange, topics: Collection[int] | None = None) -> list[Row]:
        """Return the messages of a range, of some topics or all; a DatabaseError if refused."""
        numbers = rows.topics if topics is None else rows.topics & set(topics)
        if not numbers:
            return []
        query = _READ
        if numbers != rows.topics:
            query += f' AND topic_id IN ({",".join(map(str, sorted(numbers)))})'
        with database(self._path) as connection:
            ends = rows.first, rows.last
            return connection.execute(f'{query} ORDER BY id', ends).fetchall()

    def _survey(self, connection: sqlite3.Connection) -> None:
        """Split the table into ranges; their lengths follow the sizes of earlier messages."""
        first_id = -(2**63)
        limit = 64
        offset = 0
        while groups := [_Group(*row) for row in connection.execute(_SURVEY, (first_id, limit))]:
            count = sum(group.row_count for group in groups)
            size = sum(group.size or 0 for group in groups)
            if size > _MAX_RANGE_SIZE and limit > 1:
                limit = max(1, min(limit, count) // 2)
                continue
            first = min(group.first for group in groups)
            last = max(group.last for group in groups)
            distinct_count = sum(group.distinct_count for group in groups)
            if first < first_id or distinct_count < count or count > last - first + 1:
                raise DatabaseError('its rows are out of order')
            min_size = offset + size + _MIN_ROW_SIZE * (self.count + self.unsound + count)
            # Pages that contain each other.
            if min_size > self.size:
                raise DatabaseError('its rows are larger than the file')
            self._add_range(groups, first, last, offset)
            offset += size
            if last == 2**63 - 1:
                return
            first_id = last + 1
            limit = min(_MAX_ROWS, max(1, _RANGE_SIZE * count // (size + 1)))

    def _add_range(self, groups: list[_Group], first: int, last: int, offset: int) -> None:
        sound_groups = [group for group in groups if group.is_sound]
        count = sum(group.row_count for group in sound_groups)
        self.count += count
        self.unsound += sum(group.row_count for group in groups) - count
        if sound_groups:
            start = min(group.start for group in sound_groups)
            end = max(group.end for group in sound_groups)
            topics = frozenset(group.topic for group in sound_groups)
            self.ranges.append(RowRange(first, last, start, end, topics, count, offset))
