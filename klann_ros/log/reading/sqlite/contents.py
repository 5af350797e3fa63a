"""What is in an SQLite file of rosbag2's, read by the one that can: SQLite, or page by page."""

from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
import sqlite3

from klann_ros.log.errors import NotALogError
from klann_ros.log.reading.temporary import TemporaryFile
from klann_ros.untrusted.files import open_plain
from klann_ros.untrusted.text import counted, listed, printable, verb

from .database import columns, connect, table_names
from .journals import left_beside, settled, uncommitted
from .paged_rows import PagedRows
from .rows import MessageRows, RowsBehind, RowsError, SqlRows
from .topics import Described, described

_KIND = "SQLite, rosbag2's .db3"
_MESSAGES = frozenset(('topic_id', 'timestamp', 'data'))
_TOPICS = frozenset(('name', 'type'))


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
    # From when to when messages are missing [ns].
    holes: list[tuple[int, int]] = field(default_factory=list)
    # What it is read from, if that is not the file itself.
    copies: list[TemporaryFile] = field(default_factory=list)

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
        for copy in self.copies:
            copy.close()


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
            suffixes = suffixes if copy else []
        place = copy.path if copy else path
        others = uncommitted(path, place, suffixes)
        found = _contents(path, place, others[0] if others else None)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None
    found.copies = [item for item in (copy, others[1] if others else None) if item is not None]
    found.remarks = remarks + found.remarks
    return found


def _settled(path: Path, suffixes: list[str]) -> tuple[TemporaryFile | None, list[str]]:
    """Return a copy with what is beside the file in its place, and what is to be said of it."""
    names = ' and '.join(printable(path.name) + suffix for suffix in suffixes)
    try:
        copy = settled(path, suffixes)
    except (sqlite3.Error, OSError) as error:
        return None, [f'it was not closed, and {names} beside it is of no use: {printable(error)}']
    return copy, [f'it was not closed: {names} is beside it, and is read with it']


def _contents(path: Path, place: Path, others: Path | None) -> Contents:
    """Return what is in a file, by the pages that were not committed if there is more in them."""
    with open_plain(place) as file:
        size = file.seek(0, 2)
    if not size and others is None:
        raise NotALogError(path, f'it should be {_KIND}, and is empty')
    try:
        committed = _by_sqlite(path, place, size)
    except (sqlite3.Error, RowsError) as error:
        return _damaged(path, others or place, printable(error))
    if others is None:
        return committed
    last = max((piece.last for piece in committed.rows.pieces), default=0)
    more = _by_pages(others, last)
    count = more.rows.count
    if not count:
        return committed
    committed.rows = RowsBehind(committed.rows, more.rows)
    committed.described.topics = more.described.topics | committed.described.topics
    committed.holes += more.holes
    committed.losses += more.losses
    were = verb(count, 'message in it was', 'messages in it were')
    committed.remarks.append(f'{count} {were} not committed, and read as well')
    return committed


def _by_sqlite(path: Path, place: Path, size: int) -> Contents:
    """Return what SQLite reads; it raises, as the rows do, if that cannot be relied on."""
    with closing(connect(place)) as connection:
        is_bag = columns(connection, 'messages') >= _MESSAGES
        if not (is_bag and columns(connection, 'topics') >= _TOPICS):
            raise NotALogError(path, _no_bag(path, table_names(connection)))
        said = described(connection)
    rows = SqlRows(place, size)
    losses = list(said.problems)
    if rows.unsound:
        losses.append(f'{rows.unsound} rows of its table of messages hold no message')
    return Contents(rows, said, losses=losses)


def _no_bag(path: Path, names: list[str]) -> str:
    if not names:
        return (
            'it is SQLite, and there is no table in it; a recorder that was killed leaves it in '
            f'{printable(path.name)}-wal, which belongs beside it'
        )
    tables = listed(names)
    return f"it is SQLite, but no bag: its tables ({tables}) are not rosbag2's topics and messages"


def _damaged(path: Path, place: Path, reason: str) -> Contents:
    found = _by_pages(place)
    if not found.rows.pieces:
        raise NotALogError(
            path, f'it should be {_KIND}, but {reason}, and there is no message in its pages'
        )
    found.losses.insert(0, f'{reason}; its pages were gone through one by one')
    return found


def _by_pages(place: Path, behind: int = 0) -> Contents:
    """Return what is found without SQLite, page by page, behind the message of a number."""
    rows = PagedRows(place, behind)
    leaves, form = rows.leaves, rows.form
    losses = [] if form.sound else ['its first bytes are not those of SQLite']
    if form.said > rows.pages:
        missing = form.said - rows.pages
        losses.append(f'it is cut off: {missing} of its {form.said} pages are missing')
    if leaves.missing:
        are = verb(leaves.missing, 'message is', 'messages are')
        losses.append(
            f'{leaves.missing} {are} missing by the numbers, '
            f'the first behind number {leaves.missing_behind}'
        )
    if rows.broken:
        losses.append(f'{counted(rows.broken, "row")} cannot be read')
    losses += rows.described.problems
    return Contents(rows, rows.described, losses=losses, holes=leaves.holes)
