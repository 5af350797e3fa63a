"""What an SQLite file says of its topics: in tables whose columns became more over the years."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
import sqlite3

from klann_ros.log.definitions import definition
from klann_ros.log.errors import UnknownTypeError
from klann_ros.log.records import Topic

from .database import columns, text

# A column that a table does not have is '' in each row.
_TOPICS = (
    'id',
    'name',
    'type',
    'serialization_format',
    'offered_qos_profiles',
    'type_description_hash',
)
_DEFINITIONS = ('topic_type', 'encoding', 'encoded_message_definition')
_METADATA = ('metadata',)
_MAX_SIZE = 32 * 1024 * 1024
_MAX_TOPICS = 65535
# Charged for each row: pages that are linked repeatedly hold endless rows of no text [bytes].
_ROW_SIZE = 64
_ENCODINGS = ('ros2msg', 'ros2idl')


@dataclass
class Described:
    """What a bag says of itself."""

    # The topics by their numbers.
    topics: dict[int, Topic] = field(default_factory=dict)
    # The texts in the table of metadata, the YAML of ``metadata.yaml`` without its root key.
    metadata: list[str] = field(default_factory=list)
    # The definitions that were taken from those installed here, by type, '' where there is none:
    # bags before Iron have none of their own.
    installed: dict[str, str] = field(default_factory=dict)
    # What was left out, one line each.
    problems: list[str] = field(default_factory=list)

    def add_topics(
        self, rows: Iterator[tuple[object, ...]], texts: Mapping[str, tuple[str, str]]
    ) -> None:
        """Take rows of the table of topics; the definitions and their encodings by type."""
        for number, *rest in rows:
            if not isinstance(number, int):
                self._leave_out('a topic without a number is left out')
            elif len(self.topics) >= _MAX_TOPICS:
                self._leave_out(f'there are more than {_MAX_TOPICS} topics')
            else:
                self.topics[number] = self._topic(*map(text, rest), texts=texts)

    def _topic(
        self,
        name: str,
        kind: str,
        encoding: str,
        qos: str,
        type_hash: str,
        *,
        texts: Mapping[str, tuple[str, str]],
    ) -> Topic:
        schema, words = texts.get(kind, ('ros2msg', ''))
        if not words:
            if kind not in self.installed:
                self.installed[kind] = _installed(kind)
            words = self.installed[kind]
        return Topic(name, kind, words, qos, type_hash, encoding, schema)

    def _leave_out(self, what: str) -> None:
        if what not in self.problems:
            self.problems.append(what)


def described(connection: sqlite3.Connection) -> Described:
    """Return what a bag says of its topics and of itself."""
    found = Described()
    definitions = _rows(connection, 'message_definitions', _DEFINITIONS, found)
    texts = _definitions(tuple(map(text, row)) for row in definitions)
    found.add_topics(_rows(connection, 'topics', _TOPICS, found), texts)
    found.metadata = [text(row[0]) for row in _rows(connection, 'metadata', _METADATA, found)]
    return found


def _definitions(rows: Iterator[tuple[str, ...]]) -> dict[str, tuple[str, str]]:
    """Return encoding and text of each type's definition, as far as it has one."""
    found = {}
    for kind, encoding, words in rows:
        if words and encoding in _ENCODINGS:
            found[kind] = encoding, words
    return found


def _rows(
    connection: sqlite3.Connection, table: str, wanted: tuple[str, ...], found: Described
) -> Iterator[tuple[object, ...]]:
    """Yield the wanted columns of a table's rows, up to what a bag may say of itself."""
    known = columns(connection, table)
    if not known:
        return
    selected = ', '.join(name if name in known else "''" for name in wanted)
    size = 0
    query = f'SELECT {selected} FROM {table} NOT INDEXED ORDER BY id'  # noqa: S608 - our own
    for row in connection.execute(query):
        size += _ROW_SIZE + sum(len(item) for item in row if isinstance(item, bytes))
        if size > _MAX_SIZE:
            found.problems.append(f'there are more than {_MAX_SIZE} bytes of {table}')
            return
        yield row


def _installed(kind: str) -> str:
    try:
        return definition(kind)
    except (UnknownTypeError, OSError):
        return ''
