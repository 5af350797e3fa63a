"""
Chunks: unpack them and check them.

The size that a chunk claims is not believed: it is unpacked piece by piece up to a limit, so that
a flipped bit does not ask for all memory, and so that its CRC has the last word.
"""

from collections.abc import Callable, Iterator
from typing import TypeAlias
import zlib

from klann_ros.log.errors import DamagedError
from klann_ros.sanitize.text import printable
from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped] # lz4 has no types
from mcap.opcode import Opcode
from mcap.records import Chunk
import zstandard

from .content import Content, content_of, Patience
from .parsing import parse

Bytes: TypeAlias = bytes | bytearray
Unpack: TypeAlias = Callable[[bytes, int], Iterator[bytes]]

MIN_LIMIT = 40 * 1024 * 1024
"""So much any chunk may unpack to [bytes]; usual are 1 MB."""

MAX_RATIO = 8
"""
A chunk may unpack to more than MIN_LIMIT if it is at least an eighth of that in the file.

So an image of 100 MB is read, and what a small file can ask for stays below 200 MB: writing a
message anew takes four times its size.
"""

_PIECE = 1024 * 1024


def chunk_content(record: bytes, offset: int, patience: Patience) -> Content:
    """
    Return what is in a chunk record.

    Parameters
    ----------
    record
        Its content.
    offset
        Where it stands, for the error's message.
    patience
        What it unpacks to in vain is noted there.

    """
    chunk = parse(Chunk, record, offset)
    try:
        unpack = _UNPACK[chunk.compression]
    except KeyError:
        reason = f"the compression '{printable(chunk.compression)}' is not known"
        raise DamagedError(reason, offset, Opcode.CHUNK) from None
    packed = len(chunk.data)
    allowed = patience.allowed(packed)
    data: Bytes = chunk.data
    try:
        if unpack is not None:
            data = unpacked = bytearray()
            _fill(unpacked, unpack, chunk.data, allowed)
        _check(chunk, data, offset)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        patience.spend(len(data), packed)
        reason = f'the chunk cannot be unpacked ({error})'
        raise DamagedError(reason, offset, Opcode.CHUNK) from None
    except DamagedError:
        patience.spend(len(data), packed)
        raise
    content = content_of(data, verified=chunk.uncompressed_crc != 0, allowed=allowed)
    patience.spend(content.wasted, packed)
    return content


def _check(chunk: Chunk, data: Bytes, offset: int) -> None:
    if chunk.uncompressed_crc:
        crc = zlib.crc32(data)
        if crc != chunk.uncompressed_crc:
            reason = f'the CRC of the chunk is {crc:08x}, {chunk.uncompressed_crc:08x} is recorded'
            raise DamagedError(reason, offset, Opcode.CHUNK)
    elif len(data) != chunk.uncompressed_size:
        reason = f'the chunk unpacks to {len(data)} bytes, {chunk.uncompressed_size} are recorded'
        raise DamagedError(reason, offset, Opcode.CHUNK)


def _fill(data: bytearray, unpack: Unpack, packed: bytes, allowed: int) -> None:
    """Unpack into what is given: it grows in place, which takes half of what joining takes."""
    limit = max(MIN_LIMIT, MAX_RATIO * len(packed))
    reason = 'which is the limit'
    if allowed < limit:
        limit, reason = allowed, 'which is the limit behind so much that is of no use'
    for piece in unpack(packed, min(limit + 1, _PIECE)):
        data += piece
        if len(data) > limit:
            raise MemoryError(
                f'its {len(packed)} bytes unpack to more than {limit} bytes, {reason}'
            )


def _unpack_zstd(data: bytes, size: int) -> Iterator[bytes]:
    """Yield pieces of at most a size."""
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        yield from iter(lambda: stream.read(size), b'')


def _unpack_lz4(data: bytes, size: int) -> Iterator[bytes]:
    """Yield pieces of at most a size."""
    frame, given = LZ4FrameDecompressor(), data
    while not frame.eof:
        piece = frame.decompress(given, max_length=size)
        given = b''
        if not piece and frame.needs_input:
            raise RuntimeError('it is cut off')
        yield piece


_UNPACK: dict[str, Unpack | None] = {
    '': None,
    'zstd': _unpack_zstd,
    'lz4': _unpack_lz4,
}

COMPRESSIONS = tuple(name.encode() for name in _UNPACK)
"""The names of those that are known, as they stand in a file."""
