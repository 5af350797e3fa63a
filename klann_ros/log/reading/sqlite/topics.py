"""What an SQLite file says of its topics: in tables whose columns became more over the years."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
import sqlite3

from klann_ros.log.definitions import definition
from klann_ros.log.errors import UnknownTypeError
from klann_ros.log.records import Topic

from .database import columns, text
from .records import Field

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
    """
    Return what a bag says of its topics and of itself.

    Raises
    ------
    sqlite3.Error
        It cannot be read.

    """
    found = Described()
    definitions = _rows(connection, 'message_definitions', _DEFINITIONS, found)
    texts = _definitions(tuple(map(text, row)) for row in definitions)
    found.add_topics(_rows(connection, 'topics', _TOPICS, found), texts)
    found.metadata = [text(row[0]) for row in _rows(connection, 'metadata', _METADATA, found)]
    return found


class Words:
    """
    MessageRows of texts that were found without knowing of which table they are.

    Parameters
    ----------
    encoding
        How the texts are written.

    """

    def __init__(self, encoding: str) -> None:
        self._encoding = encoding
        self._left = _MAX_SIZE
        self._topics: list[tuple[object, ...]] = []
        self._definitions: list[tuple[str, ...]] = []
        self._metadata: list[str] = []

    def want(self, size: int, columns: list[Field]) -> bool:
        """Return whether a row of this size [bytes] may be of a table that tells of the bag."""
        return size <= self._left and len(columns) > 2 and not columns[0].kind

    def take(self, number: int, record: bytes, columns: list[Field]) -> None:
        """Take a row by its number that was wanted."""
        self._left -= len(record)
        texts = [
            column.raw(record).decode(self._encoding, 'replace') if column.is_text else None
            for column in columns[1:]
        ]
        known = [item for item in texts if item is not None]
        if len(columns) == 3 and columns[1].is_integer and known:
            self._metadata.append(known[0])
        elif len(known) < 3 or len(known) != len(texts):
            return
        elif known[1] in _ENCODINGS and len(known) == 4:
            self._definitions.append(tuple(known[:3]))
        else:
            missing = len(_TOPICS) - 1 - len(known)
            self._topics.append((number, *known, *[''] * missing))

    def described(self) -> Described:
        """Return what the rows say."""
        found = Described()
        found.add_topics(iter(self._topics), _definitions(iter(self._definitions)))
        found.metadata = self._metadata
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
        size += sum(len(item) for item in row if isinstance(item, bytes))
        if size > _MAX_SIZE:
            found.problems.append(f'there are more than {_MAX_SIZE} bytes of {table}')
            return
        yield row


def _installed(kind: str) -> str:
    try:
        return definition(kind)
    except (UnknownTypeError, OSError):
        return ''
