"""
What a recorder that was killed had written, and not committed: SQLite takes all of it back.

The pages are there, in the file or in its write-ahead log, and so are the messages in them.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from klann_ros.log.reading.unpacking.temporary import TemporaryFile
from klann_ros.untrusted.files import open_plain

from .journals import beside, JOURNAL, pieces, WAL, WAL_MAGICS
from .pages import form_of, HEADER_SIZE

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path
    from typing import BinaryIO

_WAL_HEAD = struct.Struct('>IIIIQII')
_FRAME_HEAD = struct.Struct('>IIQII')


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
