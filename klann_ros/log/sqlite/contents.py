"""What is in an SQLite file of rosbag2's: what SQLite reads; what it refuses is refused."""

from dataclasses import dataclass, field
from pathlib import Path
import shlex
import sqlite3
import struct

from klann_ros.log.errors import NotALogError
from klann_ros.log.read.temporary import TemporaryFile
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import counted, listed, printable, verb

from .database import columns, database, DatabaseError, reason_of, table_names
from .journals import left_beside, settled
from .rows import MessageRows
from .topics import Described, described

_KIND = "SQLite, rosbag2's .db3"
_MESSAGES = frozenset(('topic_id', 'timestamp', 'data'))
_TOPICS = frozenset(('name', 'type'))
# Page size and number of pages in the first page.
_HEADER = struct.Struct('>16xH10xI')
# The command is there to be copied.
_MAX_COMMAND = 1000


@dataclass
class Contents:
    """What is in a file."""

    # Its messages.
    rows: MessageRows
    # What it says of itself.
    described: Described
    # In which state it was left, one line each.
    remarks: list[str] = field(default_factory=list)
    # What of it cannot be read, one line each.
    losses: list[str] = field(default_factory=list)
    # What it is read from, if that is not the file itself.
    copy: TemporaryFile | None = None

    def notes(self) -> list[str]:
        """Return what else a recovery should say, one line each."""
        said = ['SQLite keeps no CRC, so nobody knows what is intact']
        taken = [kind for kind, words in self.described.installed.items() if words]
        if taken:
            types = listed(taken)
            said.append(f'the definitions of {types} are those installed here: it has none')
        return said

    def close(self) -> None:
        """Remove what it was read from, if that is not the file itself."""
        if self.copy is not None:
            self.copy.close()


def contents_of(path: Path, unpacked: TemporaryFile | None) -> Contents:
    """
    Return what is in a file; nothing is made or changed beside it.

    Parameters
    ----------
    path
        The file.
    unpacked
        What was in it, if it is compressed as a whole.

    Raises
    ------
    NotALogError
        It holds no bag, or nothing of it can be read.

    """
    copy = unpacked
    remarks: list[str] = []
    try:
        suffixes = [] if unpacked else left_beside(path)
        if suffixes:
            copy, remarks = _settled(path, suffixes)
        found = _contents(path, copy.path if copy else path)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None
    found.copy = copy
    found.remarks = remarks + found.remarks
    return found


def _settled(path: Path, suffixes: list[str]) -> tuple[TemporaryFile | None, list[str]]:
    """Return a copy with what is beside the file in its place, and what is to be said of it."""
    names = ' and '.join(printable(path.name) + suffix for suffix in suffixes)
    try:
        copy = settled(path, suffixes)
    except (sqlite3.Error, UnicodeDecodeError, OSError) as error:
        return None, [f'it was not closed, and {names} beside it is of no use: {reason_of(error)}']
    return copy, [f'it was not closed: {names} is beside it, and is read with it']


def _contents(path: Path, place: Path) -> Contents:
    with open_regular(place) as file:
        size = file.seek(0, 2)
    if not size:
        raise NotALogError(path, f'it should be {_KIND}, and is empty')
    try:
        return _read(path, place, size)
    except DatabaseError as error:
        raise NotALogError(path, _refusal(path, str(error))) from None


def _read(path: Path, place: Path, size: int) -> Contents:
    """Return what SQLite reads; a DatabaseError if that cannot be relied on."""
    with database(place) as connection:
        is_bag = columns(connection, 'messages') >= _MESSAGES
        if not (is_bag and columns(connection, 'topics') >= _TOPICS):
            raise NotALogError(path, _no_bag(path, table_names(connection)))
        said = described(connection)
    rows = MessageRows(place, size)
    losses = [*said.problems, *_uncommitted(place, size)]
    if rows.unsound:
        losses.append(f'{rows.unsound} rows of its table of messages hold no message')
    return Contents(rows, said, losses=losses)


def _uncommitted(place: Path, size: int) -> list[str]:
    """Return a line on the pages behind the size in the header: they were not committed."""
    with open_regular(place) as file:
        page_size, pages = _HEADER.unpack(file.read(_HEADER.size))
    more = size // (page_size if page_size > 1 else 65536) - pages
    if more <= 0:
        return []
    return [f'{counted(more, "page")} behind its last commit {verb(more, "is", "are")} left out']


def _refusal(path: Path, reason: str) -> str:
    """Return why a file is refused, and how SQLite itself may salvage it."""
    source, copy = (shlex.quote(str(file)) for file in (path, _recovered(path)))
    command = printable(f'sqlite3 {source} .recover | sqlite3 {copy}', _MAX_COMMAND)
    return f'it should be {_KIND}, but {reason}; `{command}` may salvage a part of it'


def _recovered(path: Path) -> Path:
    return path.with_name(f'{path.stem}_recovered.db3')


def _no_bag(path: Path, names: list[str]) -> str:
    if not names:
        return (
            'it is SQLite, and there is no table in it; a recorder that was killed leaves it in '
            f'{printable(path.name)}-wal, which belongs beside it'
        )
    tables = listed(names)
    return f"it is SQLite, but no bag: its tables ({tables}) are not rosbag2's topics and messages"
