"""
What a recorder that was killed leaves beside its file: a write-ahead log, or a rollback journal.

Part of the messages is in the one, and the other takes back what was written by halves. SQLite
itself puts that in order, in a copy: the bag is not changed. What had been written and not
committed SQLite takes back; the pages are there all the same, and so are the messages in them.
"""

from collections.abc import Collection, Iterator
from itertools import chain
from pathlib import Path
import sqlite3
import struct
from typing import BinaryIO

from klann_ros.log.reading.temporary import TemporaryFile
from klann_ros.untrusted.files import is_plain, open_plain

from .pages import form_of, HEADER_SIZE

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
_WAL_HEAD = struct.Struct('>IIIIQII')
_FRAME_HEAD = struct.Struct('>IIQII')


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
    with open_plain(path) as file:
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
    if not is_plain(path):
        return False
    try:
        with open_plain(path) as file:
            return file.read(_MAGIC_SIZE).startswith(magics)
    except OSError:
        # What cannot be read may hold messages, and is told.
        return True


def uncommitted(
    source: Path, place: Path, suffixes: Collection[str]
) -> tuple[Path, TemporaryFile | None] | None:
    """
    Return the file that has all pages, and whether it is a copy; None if there are no others.

    Parameters
    ----------
    source
        The file.
    place
        The same file, with what was committed in its place.
    suffixes
        What of a journal is beside the file.

    Raises
    ------
    NotALogError
        There is no room for a copy.
    OSError
        One of them cannot be read.

    """
    if JOURNAL in suffixes:
        return source, None
    with open_plain(place) as file:
        form, size = form_of(file.read(HEADER_SIZE)), file.seek(0, 2)
    if WAL in suffixes:
        with open_plain(beside(source, WAL)) as log:
            frames = _frames_behind_commit(log, form.page_size)
            return _with_frames(source, place, log, frames, form.page_size) if frames else None
    return (place, None) if form.sound and 0 < form.said * form.page_size < size else None


def _frames_behind_commit(log: BinaryIO, page_size: int) -> list[tuple[int, int]]:
    """Return of the pages in a log that were not committed: number, and place in the log."""
    head = log.read(_WAL_HEAD.size)
    if len(head) < _WAL_HEAD.size:
        return []
    magic, _, own_size, _, salts, *_ = _WAL_HEAD.unpack(head)
    if magic not in WAL_MAGICS or own_size != page_size:
        return []
    found: list[tuple[int, int]] = []
    place, size = _WAL_HEAD.size, log.seek(0, 2)
    while place + _FRAME_HEAD.size + page_size <= size:
        log.seek(place)
        number, commits, own_salts, *_ = _FRAME_HEAD.unpack(log.read(_FRAME_HEAD.size))
        if own_salts != salts:
            # From here on it is what was in the log before it was begun anew.
            break
        found.append((number, place + _FRAME_HEAD.size))
        if commits:
            found.clear()
        place += _FRAME_HEAD.size + page_size
    return found


def _with_frames(
    source: Path, place: Path, log: BinaryIO, frames: list[tuple[int, int]], page_size: int
) -> tuple[Path, TemporaryFile]:
    copy = TemporaryFile(source, 'bag.db3')
    size = place.stat().st_size
    copy.write(pieces(place), size=size + len(frames) * page_size)
    # A page that is new is one of these.
    most = -(-size // page_size) + len(frames)
    with copy.path.open('r+b') as file:
        for number, start in frames:
            if 0 < number <= most:
                log.seek(start)
                file.seek((number - 1) * page_size)
                file.write(log.read(page_size))
    return copy.path, copy
