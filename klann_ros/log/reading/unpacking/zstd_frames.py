"""The frames and blocks of a zstd file, found without unpacking it (RFC 8878)."""

from __future__ import annotations

from typing import NamedTuple, TYPE_CHECKING

import zstandard

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
"""The first bytes of a zstd frame."""

_SKIPPABLE = b'\x2a\x4d\x18'
_SKIPPABLE_HEAD = 8
_LONGEST_HEADER = 18
_BLOCK_HEAD, _CHECKSUM = 3, 4
_RLE = 1
# A block unpacks to 128 KiB at most, whatever it is.
_BLOCKS = 8


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
