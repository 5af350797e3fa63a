"""What must come back of a file, found by brute force: all places are tried, nothing is walked."""

from dataclasses import dataclass
import struct
import zlib

import lz4.frame
from mcap_bytes.records import CHUNK, MAGIC, MESSAGE, spans
import zstandard

_HEAD = struct.Struct('<BQQQQII')
_LIMIT = 2**24
_KNOWN = range(1, 16)
_ROW = 4


@dataclass(frozen=True)
class SoundChunk:
    """A chunk whose CRC holds: where it is, and what must not change in its messages."""

    start: int
    end: int
    messages: tuple


def sound_chunks(data):
    """
    Return the chunks in a file whose lengths agree and whose CRC holds, wherever they are.

    One that is longer than its fields is one if records follow it: else its length is damaged.
    """
    chunks = []
    offset = data.find(CHUNK)
    while offset >= 0:
        chunk = _chunk(data, offset)
        if chunk is not None:
            chunks.append(chunk)
        offset = data.find(CHUNK, chunk.end if chunk else offset + 1)
    return chunks


def _chunk(data, offset):
    if offset + _HEAD.size + 8 > len(data):
        return None
    _, length, _, _, _, crc, name_length = _HEAD.unpack_from(data, offset)
    end = offset + 9 + length
    place = offset + _HEAD.size + name_length
    if crc == 0 or name_length > 4 or end > len(data) or place + 8 > end:
        return None
    start = place - name_length
    name = bytes(data[start:place])
    (size,) = struct.unpack_from('<Q', data, place)
    place += 8
    more = end - place - size
    if more < 0 or name not in _UNPACK or (more and not _records_from(data, end)):
        return None
    try:
        unpacked = _UNPACK[name](bytes(data[slice(place, place + size)]))
    except (zstandard.ZstdError, RuntimeError, ValueError, MemoryError):
        return None
    if zlib.crc32(unpacked) != crc:
        return None
    return SoundChunk(offset, end, tuple(_messages(unpacked)))


def _records_from(data, offset):
    """Return whether some records that are known, or the end, follow an offset."""
    for _ in range(_ROW):
        if data[offset:] in (b'', MAGIC):
            return True
        if offset + 9 > len(data) or data[offset] not in _KNOWN:
            return False
        offset += 9 + struct.unpack_from('<Q', data, offset + 1)[0]
    return True


def _messages(data):
    for opcode, start, end in spans(data, 0, len(data) - 8):
        if opcode == MESSAGE:
            _, sequence, logged, published = struct.unpack_from('<HIQQ', data, start + 9)
            yield data[slice(start + 31, end)], logged, published, sequence


_UNPACK = {
    b'': bytes,
    b'zstd': lambda data: zstandard.ZstdDecompressor().decompress(data, max_output_size=_LIMIT),
    b'lz4': lz4.frame.decompress,
}
