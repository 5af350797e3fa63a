"""
An SQLite file of rosbag2 as a storage.

SQLite reads it; what SQLite refuses is refused. A killed recorder leaves a write-ahead log or a
rollback journal beside its file. The log holds committed messages, and the journal undoes an
unfinished transaction. SQLite applies them to a copy: the bag is not changed.
"""

from collections.abc import Collection, Iterator
from functools import partial
from itertools import chain
from operator import itemgetter
from pathlib import Path
import shlex
import sqlite3
import struct

from klann_ros.log.bag_metadata import RECORD_KEY, RECORD_NAME
from klann_ros.log.errors import NotALogError
from klann_ros.log.records import Attachment, Message
from klann_ros.sanitize.files import is_regular_file, open_regular
from klann_ros.sanitize.text import counted, listed, printable, verb
import numpy as np

from .sqlite_database import (
    BagDescription,
    columns,
    database,
    DatabaseError,
    MessageRows,
    reason_of,
    Row,
    RowRange,
    table_names,
)
from .storage import (
    block_of_messages,
    HEAD,
    MessageBlock,
    Overview,
    Problems,
    Source,
    spanned_time,
    storage_name,
    TemporaryFile,
    Topics,
)

_WAL, _JOURNAL = '-wal', '-journal'
_JOURNAL_MAGICS = {
    _WAL: (b'\x37\x7f\x06\x82', b'\x37\x7f\x06\x83'),
    _JOURNAL: (bytes.fromhex('d9d505f920a163d7'),),
}
_MAX_MAGIC_SIZE = 8
# A journal may end in the name of another file, which SQLite then deletes; not behind this.
_NO_NAME = b'\0'
_COPY_BLOCK_SIZE = 1024 * 1024

_KIND = "SQLite, rosbag2's .db3"
_MESSAGE_COLUMNS = frozenset(('topic_id', 'timestamp', 'data'))
_TOPIC_COLUMNS = frozenset(('name', 'type'))
# Page size and number of pages in the first page.
_HEADER = struct.Struct('>16xH10xI')
# A command to be copied.
_MAX_COMMAND = 1000


class SqliteStorage:
    """
    An SQLite file of rosbag2; see :class:`~klann_ros.log.read.storage.Storage`.

    Nothing beside the file is created or changed. A NotALogError means that it is no bag, or that
    nothing of it can be read.
    """

    def __init__(self, path: Path, unpacked: TemporaryFile | None = None) -> None:
        self.path = path
        self.name = storage_name(path, unpacked)
        self._copy = unpacked
        self.problems = Problems()
        try:
            if unpacked is None:
                self._apply_journals(path)
            self.closed = not self.problems
            plain_path = path if self._copy is None else self._copy.path
            self.description, self.rows, losses = _read_bag(path, plain_path)
        except OSError as error:
            raise NotALogError(path, error.strerror or str(error)) from None
        self.size = self.rows.size
        for text in losses:
            self.problems.note_whole(text, is_loss=True)
        self.gaps: set[tuple[int, int]] = set()
        self.remarks = ['SQLite keeps no CRC, so damage in messages is unknown']
        types = [kind for kind, text in self.description.installed.items() if text]
        if types:
            remark = f'the definitions of {listed(types)} are those installed here: it has none'
            self.remarks.append(remark)
        self._channels = {topic: channel for channel, topic in enumerate(self.description.topics)}

    def _apply_journals(self, path: Path) -> None:
        """Read a copy with the journals of a database that was not closed, if there are any."""
        suffixes = [
            suffix
            for suffix, magics in _JOURNAL_MAGICS.items()
            if _starts_with(path.with_name(path.name + suffix), magics)
        ]
        if not suffixes:
            return
        names = ' and '.join(printable(path.name) + suffix for suffix in suffixes)
        try:
            self._copy = _checkpointed_copy(path, suffixes)
        except (sqlite3.Error, UnicodeDecodeError, OSError) as error:
            text = f'it was not closed, and {names} beside it is of no use: {reason_of(error)}'
        else:
            text = f'it was not closed: {names} is beside it, and is read with it'
        self.problems.note_whole(text)

    def overview(self) -> Overview:
        """Return its content, topics without messages included."""
        times = spanned_time([(rows.start, rows.end) for rows in self.rows.ranges])
        return Overview(list(self.description.topics.values()), times)

    def sources(self) -> Iterator[Source]:
        """Yield the parts that can be read separately."""
        for rows in self.rows.ranges:
            yield Source(rows.start, rows.end, partial(self._by_time, rows))

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large blocks in the order of the file, with their offsets."""
        for rows in self.rows.ranges:
            yield rows.offset, self._block(self._messages(rows))

    def first_data(self) -> bytes:
        """Return the data of the first message in the file; b'' if there is none."""
        for rows in self.rows.ranges:
            for *_, data in self._messages(rows):
                return data
        return b''

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the last row of the table of metadata, as an MCAP file has it."""
        for text in self.description.metadata[-1:]:
            yield RECORD_NAME, {RECORD_KEY: text}

    def attachments(self) -> Iterator[Attachment]:
        """Yield nothing: the format has no attachments."""
        return iter(())

    def close(self) -> None:
        """Remove its unpacked or copied files."""
        if self._copy is not None:
            self._copy.close()

    def _messages(self, rows: RowRange, topics: Collection[int] | None = None) -> list[Row]:
        """Return the rows of a range whose topics are known."""
        try:
            messages = self.rows.read(rows, topics)
        except DatabaseError as error:
            self.problems.note_whole(f'{rows} are left out: {error}', is_loss=True)
            return []
        if topics is None and len(messages) < rows.count:
            text = f'{rows.count - len(messages)} of {rows} are not all there'
            self.problems.note_whole(text, is_loss=True)
        unknown = rows.topics - self._channels.keys()
        for number in unknown:
            text = f'messages of topic {number}, whose description is lost'
            self.problems.note_whole(text, is_loss=True)
        return [row for row in messages if row[0] not in unknown] if unknown else messages

    def _by_time(self, rows: RowRange, names: Topics) -> Iterator[Message]:
        topics = self.description.topics
        numbers = None
        if names is not None:
            numbers = [number for number, topic in topics.items() if topic.name in names]
        for number, time, data in sorted(self._messages(rows, numbers), key=itemgetter(1)):
            yield Message(topics[number], data, time, time, 0)

    def _block(self, messages: list[Row]) -> MessageBlock:
        count = len(messages)
        numbers, times, data = zip(*messages, strict=True) if messages else ((), (), ())
        heads = np.zeros(count, dtype=HEAD)
        heads['channel'] = np.fromiter(map(self._channels.__getitem__, numbers), 'u2', count)
        heads['log_time'] = heads['publish_time'] = np.fromiter(times, 'u8', count)
        topics = dict(enumerate(self.description.topics.values()))
        return block_of_messages(heads, data, topics)


def _read_bag(path: Path, plain_path: Path) -> tuple[BagDescription, MessageRows, list[str]]:
    """Return the content of a bag or its plain copy, and its unreadable parts, one line each."""
    with open_regular(plain_path) as file:
        size = file.seek(0, 2)
        file.seek(0)
        head = file.read(_HEADER.size)
    if not size:
        raise NotALogError(path, f'it should be {_KIND}, and is empty')
    try:
        with database(plain_path) as connection:
            is_bag = columns(connection, 'messages') >= _MESSAGE_COLUMNS
            if not (is_bag and columns(connection, 'topics') >= _TOPIC_COLUMNS):
                raise NotALogError(path, _no_bag(path, table_names(connection)))
            description = BagDescription()
            description.read(connection)
        rows = MessageRows(plain_path, size)
    except DatabaseError as error:
        raise NotALogError(path, _refusal(path, str(error))) from None
    losses = [*description.problems]
    # Pages behind the size in the header were not committed.
    page_size, pages = _HEADER.unpack(head)
    uncommitted = size // (page_size if page_size > 1 else 65536) - pages
    if uncommitted > 0:
        left_out = f'behind its last commit {verb(uncommitted, "is", "are")} left out'
        losses.append(f'{counted(uncommitted, "page")} {left_out}')
    if rows.unsound:
        losses.append(f'{rows.unsound} rows of its table of messages hold no message')
    return description, rows, losses


def _refusal(path: Path, reason: str) -> str:
    """Return why a file is refused, and how SQLite itself may salvage it."""
    copy = shlex.quote(str(path.with_name(f'{path.stem}_recovered.db3')))
    source = shlex.quote(str(path))
    command = printable(f'sqlite3 {source} .recover | sqlite3 {copy}', _MAX_COMMAND)
    return f'it should be {_KIND}, but {reason}; `{command}` may salvage a part of it'


def _no_bag(path: Path, names: list[str]) -> str:
    if not names:
        return (
            'it is SQLite, and there is no table in it; a recorder that was killed leaves it in '
            f'{printable(path.name)}-wal, which belongs beside it'
        )
    tables = listed(names)
    return f"it is SQLite, but no bag: its tables ({tables}) are not rosbag2's topics and messages"


def _starts_with(path: Path, magics: tuple[bytes, ...]) -> bool:
    """Return whether a journal has content: SQLite may keep an empty one."""
    if not is_regular_file(path):
        return False
    try:
        with open_regular(path) as file:
            return file.read(_MAX_MAGIC_SIZE).startswith(magics)
    except OSError:
        # A file that cannot be read may hold messages: the copy fails with the reason.
        return True


def _checkpointed_copy(path: Path, suffixes: list[str]) -> TemporaryFile:
    """
    Return a copy of a file to which SQLite has applied its journals.

    A NotALogError means that there is no room, an OSError that a file cannot be read, an
    sqlite3.Error that a journal does not belong to the file.
    """
    copy = TemporaryFile(path, 'bag.db3')
    max_size = 0
    # The log first: a recorder may move its content into the file meanwhile.
    for suffix in (*suffixes, ''):
        source = path.with_name(path.name + suffix)
        size = source.stat().st_size
        end = [_NO_NAME] if suffix == _JOURNAL else []
        copy.write(chain(_blocks(source), end), suffix, size)
        max_size += size
    connection = sqlite3.connect(copy.path, isolation_level=None)
    try:
        connection.execute('PRAGMA trusted_schema = OFF')
        connection.execute('SELECT count(*) FROM sqlite_master').fetchone()
        connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    finally:
        connection.close()
    if copy.path.stat().st_size > max_size:
        raise sqlite3.DatabaseError('it claims more pages than there are')
    return copy


def _blocks(path: Path) -> Iterator[bytes]:
    with open_regular(path) as file:
        while block := file.read(_COPY_BLOCK_SIZE):
            yield block
