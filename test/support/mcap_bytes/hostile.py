"""
Files that ask for more work than they are worth, of any size.

Each is a pattern that is repeated until a number of bytes is reached, behind a header, or unpacked
from a chunk.
"""

import struct

from mcap_bytes import records as mcap
import zstandard

HEADER = mcap.MAGIC + mcap.header('ros2')
CHANNEL = mcap.channel(1, 0, '/a', '', {})
EMPTY = mcap.message(1, 1, 1, 1, b'')


def packed_chunk(records, *, crc=None):
    """Return a chunk that is compressed as well as can be."""
    packed = zstandard.compress(records)
    return mcap.chunk(records, compression='zstd', packed=packed, crc=crc)


def _repeated(pattern):
    return lambda size: pattern * (size // len(pattern))


def _numbered(make):
    def numbered(size):
        return b''.join(make(n) for n in range(size // len(make(0))))

    return numbered


def _nested(opcode, content, end=b''):
    """Return heads each of which claims all that is behind it."""

    def nested(size):
        record_size = 9 + len(content)
        records = bytearray()
        for depth in range(size // record_size, 0, -1):
            records += struct.pack('<BQ', opcode, record_size * depth - 9 + len(end)) + content
        return bytes(records + end)

    return nested


GARBAGE = b'\xff' * 50
_NO_CHUNK = struct.pack('<QQQIIQ', 0, 0, 0, 0, 0, 0)
OUTSIDE = {
    'zeros': bytes,
    'empty messages': lambda size: CHANNEL + _repeated(EMPTY)(size),
    'a bad byte behind each message': lambda size: CHANNEL + _repeated(EMPTY + b'\xff')(size),
    'a bad byte behind each metadata record': _repeated(mcap.metadata('', {}) + b'\xff'),
    'a bad byte behind each end of the data': _repeated(mcap.data_end() + b'\xff'),
    'many channels': _numbered(lambda n: mcap.channel(n % 65536, 0, '', '', {})),
    'many schemas': _numbered(lambda n: mcap.schema(1 + n % 65535, '', '', b'')),
    'messages of unknown channels': _numbered(lambda n: mcap.message(n % 65536, 1, 1, 1, b'')),
    'chunks with a wrong CRC': _repeated(packed_chunk(EMPTY, crc=1)),
    'heads of chunks': lambda size: b'\xff' + _repeated(b'\x06' + bytes(8))(size),
    'heads of indexes': lambda size: b'\xff' + _repeated(b'\x07\x10' + bytes(7))(size),
    'metadata in metadata': _nested(mcap.METADATA, bytes(8)),
    'metadata in metadata before a bad end': _nested(mcap.METADATA, bytes(8), GARBAGE),
    'schemas in schemas': _nested(mcap.SCHEMA, bytes(14)),
    'attachments in attachments': _nested(mcap.ATTACHMENT, bytes(36)),
    'chunks in chunks': _nested(mcap.CHUNK, _NO_CHUNK),
    'chunks in chunks before a bad end': _nested(mcap.CHUNK, _NO_CHUNK, GARBAGE),
    'messages in messages before a bad end': _nested(mcap.MESSAGE, bytes(22), GARBAGE),
    'private records in private records before a bad end': _nested(0x90, b'', GARBAGE),
}
INSIDE = {
    'zeros': bytes,
    'private records': _repeated(mcap.record(0x80, b'')),
    'the same channel': _repeated(CHANNEL),
    'empty message indexes': _repeated(mcap.message_index(1, [])),
}


def file_of(shape, size):
    """Return a file of one of the shapes of OUTSIDE, of about a size [bytes]."""
    return HEADER + OUTSIDE[shape](size)


def file_of_chunks(shape, size, count):
    """Return a file of chunks that each unpack to a shape of INSIDE of about a size."""
    return HEADER + packed_chunk(INSIDE[shape](size)) * count


def closed(data, summary):
    """Return a file that has a summary."""
    data += mcap.data_end()
    footer = mcap.footer(summary, len(data), 0)
    return data + summary + footer + mcap.MAGIC


def overlapping(count, size, *, honest=True):
    """Return a file of large chunks that all begin before any of them ends, or say otherwise."""
    data, index, late = HEADER, b'', 10**9
    for n in range(count):
        inner = CHANNEL if n == 0 else b''
        inner += mcap.message(1, n, n, n, b'') if honest else b''
        inner += mcap.message(1, n, late + n, n, bytes(size))
        times = (n, late + n) if honest else (n, n)
        packed = zstandard.compress(inner)
        chunk = mcap.chunk(inner, times, compression='zstd', packed=packed)
        sizes = len(packed), len(inner) if honest else len(packed)
        place = len(data), len(chunk)
        index += mcap.chunk_index(times, place, ({}, 0), sizes, compression='zstd')
        data += chunk
    messages = count * (2 if honest else 1)
    counts = mcap.statistics((messages, 0, 1, 0, 0, count), (0, late + count), {})
    return closed(data, CHANNEL + index + counts)


def named_often(count):
    """Return a file whose index names one record again and again, and another in it."""
    attached = mcap.attachment('a', '', bytes(100_000), (0, 0))
    chunk = packed_chunk(CHANNEL + EMPTY * 1000)
    start = len(HEADER)
    data = HEADER + attached + chunk
    attachment_span = start, len(attached)
    chunk_span = start + len(attached), len(chunk)
    sizes = len(chunk), 1000 * len(EMPTY)
    summary = CHANNEL
    summary += mcap.chunk_index((1, 1), chunk_span, ({}, 0), sizes, compression='zstd') * count
    summary += mcap.attachment_index(attachment_span, (0, 0), 100_000, 'a', '') * count
    summary += mcap.statistics((1000 * count, 0, 1, count, 0, count), (1, 1), {})
    return closed(data, summary)
