"""A file that was compressed as a whole: unpacked piece by piece, to where it can be read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from klann_ros.log.errors import NotALogError
from klann_ros.untrusted.files import open_plain
from klann_ros.untrusted.text import printable
import zstandard

from .temporary import TemporaryFile
from .zstd_frames import parts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from typing import BinaryIO

SUFFIXES = ('.zstd', '.zst')
"""What stands behind the name of such a file."""

MIN_LIMIT = 2**30
"""So much any file may unpack to [bytes]."""

MAX_RATIO = 64
"""A file may unpack to more than MIN_LIMIT if it is at least so much of that itself."""


def unpack(path: Path, is_log: Callable[[bytes], bool]) -> tuple[TemporaryFile, str]:
    """
    Unpack a file to a temporary one.

    Parameters
    ----------
    path
        The compressed file.
    is_log
        Whether what starts with these bytes is worth being unpacked.

    Returns
    -------
    TemporaryFile
        What was in it.
    str
        What is wrong with it; '' if it is whole.

    Raises
    ------
    NotALogError
        It cannot be read, what is in it is no log, there is no room for it, or it unpacks to more
        than a file of its size may.

    """
    name = path.name
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    try:
        with open_plain(path) as file:
            return _unpack(path, file, name or 'log', is_log)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None


def _unpack(
    path: Path, file: BinaryIO, name: str, is_log: Callable[[bytes], bool]
) -> tuple[TemporaryFile, str]:
    unpacking = _Unpacking(path, file, is_log)
    made = TemporaryFile(path, name)
    made.write(unpacking.pieces())
    return made, unpacking.damage


class _Unpacking:
    """Unpacks a file, and notes what was wrong with it."""

    def __init__(self, path: Path, file: BinaryIO, is_log: Callable[[bytes], bool]) -> None:
        self.damage = ''
        self._path = path
        self._file = file
        self._limit = max(MIN_LIMIT, MAX_RATIO * file.seek(0, 2))
        self._is_log = is_log

    def pieces(self) -> Iterator[bytes]:
        """Yield what is in the file, up to its end or to what is damaged."""
        done = 0
        for piece in filter(None, self._unpacked()):
            if not done and not self._is_log(piece):
                reason = 'it is a zstd file, but what is in it is neither MCAP nor SQLite'
                raise NotALogError(self._path, reason)
            done += len(piece)
            if done > self._limit:
                reason = f'it unpacks to more than {self._limit / 1e6:.0f} MB'
                raise NotALogError(
                    self._path, f'{reason}; if that is right, unpack it by `zstd -d` first'
                )
            yield piece
        if not done:
            reason = self.damage or 'there is nothing in it'
            raise NotALogError(self._path, f'it is a zstd file, but {reason}')

    def _unpacked(self) -> Iterator[bytes]:
        unpacker = zstandard.ZstdDecompressor().decompressobj()
        ends = True
        for part in parts(self._file):
            ends = part.ends
            if part.begins:
                unpacker = zstandard.ZstdDecompressor().decompressobj()
            try:
                yield unpacker.decompress(part.data) if part.data else b''
            except (zstandard.ZstdError, MemoryError) as error:
                self.damage = f'it can be unpacked in part only: {printable(error)}'
                return
        if not ends:
            self.damage = 'it is cut off: its last zstd frame has no end'
