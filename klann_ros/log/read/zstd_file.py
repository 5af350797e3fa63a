"""A file that was compressed as a whole: unpacked piece by piece, to where it can be read."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from klann_ros.log.errors import NotALogError
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable
import zstandard

from .temporary import TemporaryFile

SUFFIXES = ('.zstd', '.zst')
"""What stands behind the name of such a file."""

MIN_LIMIT = 2**30
"""So much any file may unpack to [bytes]."""

MAX_RATIO = 64
"""A file may unpack to more than MIN_LIMIT if it is at least so much of that itself."""

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
"""The first bytes of a zstd frame."""

_SKIPPABLE = b'\x2a\x4d\x18'
_SKIPPABLE_HEAD = 8
_LONGEST_HEADER = 18
_BLOCK_HEAD, _CHECKSUM = 3, 4
_RLE = 1
# A block unpacks to 128 KiB at most, whatever it is.
_BLOCKS = 8


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
        with open_regular(path) as file:
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


class Part(NamedTuple):
    """Some blocks of a frame, whether they are its first, and whether its last."""

    data: bytes
    begins: bool
    ends: bool


def parts(file: BinaryIO) -> Iterator[Part]:
    """
    Yield an open file in parts, each of which unpacks to 1 MiB at most.

    The last is no end where the file is cut off, or goes on with something else.
    """
    place = 0
    while True:
        file.seek(place)
        head = file.read(_LONGEST_HEADER)
        if head[1:4] == _SKIPPABLE and head[0] >> 4 == 5:
            place += _SKIPPABLE_HEAD + int.from_bytes(head[4:8], 'little')
            continue
        if not head:
            return
        size = _header_size(head)
        if not size:
            yield Part(b'', begins=False, ends=False)
            return
        part = Part(b'', begins=True, ends=False)
        for start, end, is_last in _ranges(file, place, size, has_checksum=bool(head[4] & 4)):
            file.seek(start)
            data = file.read(end - start)
            part = Part(data, start == place, is_last and len(data) == end - start)
            yield part
        if not part.ends:
            return
        place = end


def _header_size(head: bytes) -> int:
    """Return how long the header of a frame is [bytes]; 0 if it is none."""
    try:
        return zstandard.frame_header_size(head) if head.startswith(ZSTD_MAGIC) else 0
    except zstandard.ZstdError:
        return 0


def _ranges(
    file: BinaryIO, start: int, size: int, *, has_checksum: bool
) -> Iterator[tuple[int, int, bool]]:
    """Yield from where to where blocks of a frame stand, some together, and whether it ends."""
    end, last, count = start + size, False, 0
    while not last:
        file.seek(end)
        head = file.read(_BLOCK_HEAD)
        block = int.from_bytes(head, 'little')
        last, kind, length = bool(block & 1), block >> 1 & 3, block >> 3
        end += _BLOCK_HEAD + (1 if kind == _RLE else length)
        count += 1
        if len(head) < _BLOCK_HEAD:
            break
        if count == _BLOCKS and not last:
            yield start, end, False
            start, count = end, 0
    yield start, end + (_CHECKSUM if has_checksum and last else 0), last
