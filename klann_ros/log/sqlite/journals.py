"""
What a recorder that was killed leaves beside its file: a write-ahead log, or a rollback journal.

The log holds committed messages, and the journal undoes an unfinished transaction. SQLite applies
them to a copy: the bag is not changed.
"""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
import sqlite3

from klann_ros.log.read.temporary import TemporaryFile
from klann_ros.sanitize.files import is_regular_file, open_regular

WAL, JOURNAL = '-wal', '-journal'

WAL_MAGICS = (0x377F0682, 0x377F0683)
"""The first four bytes of a write-ahead log."""

_MAGICS = {
    WAL: tuple(magic.to_bytes(4, 'big') for magic in WAL_MAGICS),
    JOURNAL: (bytes.fromhex('d9d505f920a163d7'),),
}
_MAGIC_SIZE = 8
_PIECE = 1024 * 1024
# A journal may end in the name of another file, which SQLite then deletes; not behind this.
_NO_NAME = b'\0'


def left_beside(path: Path) -> list[str]:
    """Return which of the two are beside a file and hold something: a finished one may be kept."""
    return [
        suffix for suffix, magics in _MAGICS.items() if _begins_with(beside(path, suffix), magics)
    ]


def beside(path: Path, suffix: str) -> Path:
    """Return the file whose name is longer by this."""
    return path.with_name(path.name + suffix)


def pieces(path: Path) -> Iterator[bytes]:
    """Yield what is in a file; an OSError if it cannot be read."""
    with open_regular(path) as file:
        while piece := file.read(_PIECE):
            yield piece


def settled(path: Path, suffixes: list[str]) -> TemporaryFile:
    """
    Return a copy of a file in which everything is in its place.

    Parameters
    ----------
    path, suffixes
        The file, and what of this kind is beside it.

    Raises
    ------
    NotALogError
        There is no room for a copy.
    OSError
        One of them cannot be read.
    sqlite3.Error
        What is beside the file does not belong to it.

    """
    copy = TemporaryFile(path, 'bag.db3')
    most = 0
    # What is in the log is copied before it can move on into the file.
    for suffix in (*suffixes, ''):
        place = beside(path, suffix)
        size = place.stat().st_size
        end = [_NO_NAME] if suffix == JOURNAL else []
        copy.write(chain(pieces(place), end), suffix, size)
        most += size
    _settle(copy.path)
    if copy.path.stat().st_size > most:
        raise sqlite3.DatabaseError('it claims more pages than there are')
    return copy


def _settle(path: Path) -> None:
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        connection.execute('PRAGMA trusted_schema = OFF')
        connection.execute('SELECT count(*) FROM sqlite_master').fetchone()
        connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    finally:
        connection.close()


def _begins_with(path: Path, magics: tuple[bytes, ...]) -> bool:
    if not is_regular_file(path):
        return False
    try:
        with open_regular(path) as file:
            return file.read(_MAGIC_SIZE).startswith(magics)
    except OSError:
        # What cannot be read may hold messages, and is told.
        return True
