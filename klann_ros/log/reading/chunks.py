"""
Chunks: unpack them and check them.

The size that a chunk claims is not believed: it is unpacked piece by piece up to a limit, so that
a flipped bit does not ask for all memory, and so that its CRC has the last word.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
import zlib

from klann_ros.log.errors import DamagedError
from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped] # lz4 has no types
from mcap.opcode import Opcode
from mcap.records import Chunk
import zstandard

from .content import content_of
from .parsing import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import TypeAlias

    from .content import Content

    Bytes: TypeAlias = bytes | bytearray

MIN_LIMIT = 40 * 1024 * 1024
"""So much any chunk may unpack to [bytes]; usual are 1 MB."""

MAX_RATIO = 8
"""
A chunk may unpack to more than MIN_LIMIT if it is at least an eighth of that in the file.

So an image of 100 MB is read, and what a small file can ask for stays below 200 MB: writing a
message anew takes four times its size.
"""

_PIECE = 1024 * 1024


def chunk_content(content: bytes, offset: int) -> Content:
    """
    Return what is in a chunk record; the offset is for the error's message.

    Raises
    ------
    DamagedError
        The chunk cannot be unpacked or its CRC is another one.

    """
    chunk = parse(Chunk, content, offset)
    try:
        unpack = _UNPACK[chunk.compression]
    except KeyError:
        reason = f'the compression {chunk.compression!r} is not known'
        raise DamagedError(reason, offset, Opcode.CHUNK) from None
    try:
        data = unpack(chunk.data)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        reason = f'the chunk cannot be unpacked ({error})'
        raise DamagedError(reason, offset, Opcode.CHUNK) from None
    _check(chunk, data, offset)
    return content_of(data, verified=chunk.uncompressed_crc != 0)


def _check(chunk: Chunk, data: Bytes, offset: int) -> None:
    if chunk.uncompressed_crc:
        crc = zlib.crc32(data)
        if crc != chunk.uncompressed_crc:
            reason = f'the CRC of the chunk is {crc:08x}, {chunk.uncompressed_crc:08x} is recorded'
            raise DamagedError(reason, offset, Opcode.CHUNK)
    elif len(data) != chunk.uncompressed_size:
        reason = f'the chunk unpacks to {len(data)} bytes, {chunk.uncompressed_size} are recorded'
        raise DamagedError(reason, offset, Opcode.CHUNK)


def _joined(pieces: Iterator[bytes], packed: int) -> bytearray:
    """Return the pieces as one; it grows in place, which takes half of what joining takes."""
    limit = max(MIN_LIMIT, MAX_RATIO * packed)
    unpacked = bytearray()
    for piece in pieces:
        unpacked += piece
        if len(unpacked) > limit:
            raise MemoryError(
                f'its {packed} bytes unpack to more than {limit} bytes, which is the limit'
            )
    return unpacked


def _unpack_zstd(data: bytes) -> bytearray:
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        return _joined(iter(lambda: stream.read(_PIECE), b''), len(data))


def _unpack_lz4(data: bytes) -> bytearray:
    def pieces() -> Iterator[bytes]:
        frame = LZ4FrameDecompressor()
        given = data
        while not frame.eof:
            piece = frame.decompress(given, max_length=_PIECE)
            given = b''
            if not piece and frame.needs_input:
                raise RuntimeError('it is cut off')
            yield piece

    return _joined(pieces(), len(data))


_UNPACK: dict[str, Callable[[bytes], Bytes]] = {
    '': bytes,
    'zstd': _unpack_zstd,
    'lz4': _unpack_lz4,
}
