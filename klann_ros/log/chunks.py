"""
Chunks: decompress them, check them, find the messages in them.

The size that a chunk claims is not believed: it is unpacked piece by piece up to a limit, so that
a flipped bit does not ask for all memory, and so that its CRC has the last word.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import TYPE_CHECKING
import zlib

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped] # lz4 has no types
from mcap.opcode import Opcode
from mcap.records import Chunk
import zstandard

from .errors import DamagedError
from .parsing import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import TypeAlias

    Row: TypeAlias = tuple[int, int, int, int, int, int]

MAX_UNPACKED = 256 * 1024 * 1024
"""A chunk that unpacks to more is taken for damaged [bytes]; usual are 1 MB."""

_PIECE = 1024 * 1024
_RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<HIQQ')


@dataclass(frozen=True, slots=True)
class Content:
    """
    What a chunk, or a message outside of chunks, holds.

    Parameters
    ----------
    data
        The unpacked bytes.
    rows
        A message each: channel, sequence, log time [ns], publish time [ns], and where in ``data``
        its bytes start and end.
    definitions
        Schemas and channels: opcode and content.
    verified
        Whether there was a CRC that held.
    broken
        Why not all of the chunk could be read; '' if all could.

    """

    data: bytes
    rows: tuple[Row, ...]
    definitions: tuple[tuple[int, bytes], ...]
    verified: bool
    broken: str = ''


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
    return _content(data, verified=chunk.uncompressed_crc != 0)


def message_content(content: bytes, offset: int) -> Content:
    """
    Return a message record outside of chunks as what a chunk would hold.

    Raises
    ------
    DamagedError
        It is too short.

    """
    if len(content) < _MESSAGE.size:
        raise DamagedError('the message is too short', offset, Opcode.MESSAGE)
    row = (*_MESSAGE.unpack_from(content), _MESSAGE.size, len(content))
    return Content(content, (row,), (), verified=False)


def _check(chunk: Chunk, data: bytes, offset: int) -> None:
    if chunk.uncompressed_crc:
        crc = zlib.crc32(data)
        if crc != chunk.uncompressed_crc:
            reason = f'the CRC of the chunk is {crc:08x}, {chunk.uncompressed_crc:08x} is recorded'
            raise DamagedError(reason, offset, Opcode.CHUNK)
    elif len(data) != chunk.uncompressed_size:
        reason = f'the chunk unpacks to {len(data)} bytes, {chunk.uncompressed_size} are recorded'
        raise DamagedError(reason, offset, Opcode.CHUNK)


def _content(data: bytes, *, verified: bool) -> Content:
    """Find the records in a chunk's data, up to the first that cannot be."""
    rows: list[Row] = []
    definitions: list[tuple[int, bytes]] = []
    position, size, broken = 0, len(data), ''
    while position < size:
        start = position + _RECORD.size
        if start > size:
            broken = 'its last record is cut off'
            break
        opcode, length = _RECORD.unpack_from(data, position)
        position = start + length
        if position > size:
            broken = 'a record in it is longer than the chunk'
            break
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                broken = 'a message in it is too short'
                break
            rows.append((*_MESSAGE.unpack_from(data, start), start + _MESSAGE.size, position))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append((opcode, data[start:position]))
    return Content(data, tuple(rows), tuple(definitions), verified, broken)


def _joined(pieces: Iterator[bytes]) -> bytes:
    unpacked: list[bytes] = []
    size = 0
    for piece in pieces:
        unpacked.append(piece)
        size += len(piece)
        if size > MAX_UNPACKED:
            raise MemoryError(f'more than {MAX_UNPACKED} bytes')
    return b''.join(unpacked)


def _unpack_zstd(data: bytes) -> bytes:
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        return _joined(iter(lambda: stream.read(_PIECE), b''))


def _unpack_lz4(data: bytes) -> bytes:
    def pieces() -> Iterator[bytes]:
        frame = LZ4FrameDecompressor()
        given = data
        while not frame.eof:
            piece = frame.decompress(given, max_length=_PIECE)
            given = b''
            if not piece and frame.needs_input:
                raise RuntimeError('it is cut off')
            yield piece

    return _joined(pieces())


_UNPACK: dict[str, Callable[[bytes], bytes]] = {
    '': bytes,
    'zstd': _unpack_zstd,
    'lz4': _unpack_lz4,
}
