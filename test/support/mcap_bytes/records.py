"""
The bytes of each kind of MCAP record, written from the specification and by nothing else.

Each function returns a whole record: opcode, length and content, with ``pad`` behind its fields
where the specification lets it be extended.
"""

import struct
import zlib

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET = range(9, 15)
DATA_END = 15
FOOTER_SIZE = 29
# Of these the fields are all that there ever will be.
FINAL = (MESSAGE, DATA_END, FOOTER)


def record(opcode, content):
    return struct.pack('<BQ', opcode, len(content)) + content


def text(data):
    data = data.encode() if isinstance(data, str) else data
    return struct.pack('<I', len(data)) + data


def texts(pairs):
    """Return a map of texts to texts."""
    return text(b''.join(text(key) + text(value) for key, value in pairs.items()))


def header(profile='', library='', *, pad=b''):
    return record(HEADER, text(profile) + text(library) + pad)


def schema(number, name, encoding, data, *, pad=b''):
    return record(
        SCHEMA, struct.pack('<H', number) + text(name) + text(encoding) + text(data) + pad
    )


def channel(number, schema_number, topic, encoding, metadata, *, pad=b''):
    content = text(topic) + text(encoding) + texts(metadata)
    return record(CHANNEL, struct.pack('<HH', number, schema_number) + content + pad)


def message(number, sequence, log_time, publish_time, data):
    return record(MESSAGE, struct.pack('<HIQQ', number, sequence, log_time, publish_time) + data)


def chunk(records, times=(0, 0), *, compression='', packed=None, crc=None, pad=b''):
    """Return a chunk of records, which are packed already where that is given."""
    crc = zlib.crc32(records) if crc is None else crc
    packed = records if packed is None else packed
    head = struct.pack('<QQQI', *times, len(records), crc) + text(compression)
    return record(CHUNK, head + struct.pack('<Q', len(packed)) + packed + pad)


def message_index(number, entries, *, pad=b''):
    rows = b''.join(struct.pack('<QQ', *entry) for entry in entries)
    return record(MESSAGE_INDEX, struct.pack('<H', number) + text(rows) + pad)


def chunk_index(times, place, indexes, sizes, *, compression='', pad=b''):
    """Return where a chunk is, its message indexes (offsets, length) and its two sizes."""
    offsets, length = indexes
    rows = b''.join(struct.pack('<HQ', *entry) for entry in offsets.items())
    head = struct.pack('<QQQQ', *times, *place) + text(rows) + struct.pack('<Q', length)
    return record(CHUNK_INDEX, head + text(compression) + struct.pack('<QQ', *sizes) + pad)


def attachment(name, media_type, data, times, *, pad=b''):
    content = struct.pack('<QQ', *times) + text(name) + text(media_type)
    content += struct.pack('<Q', len(data)) + data
    return record(ATTACHMENT, content + struct.pack('<I', zlib.crc32(content)) + pad)


def attachment_index(place, times, size, name, media_type, *, pad=b''):
    head = struct.pack('<QQQQQ', *place, *times, size)
    return record(ATTACHMENT_INDEX, head + text(name) + text(media_type) + pad)


def statistics(counts, times, per_channel, *, pad=b''):
    """Return the counts of messages, schemas, channels, attachments, metadata and chunks."""
    rows = b''.join(struct.pack('<HQ', *entry) for entry in per_channel.items())
    return record(STATISTICS, struct.pack('<QHIIIIQQ', *counts, *times) + text(rows) + pad)


def metadata(name, content, *, pad=b''):
    return record(METADATA, text(name) + texts(content) + pad)


def metadata_index(place, name, *, pad=b''):
    return record(METADATA_INDEX, struct.pack('<QQ', *place) + text(name) + pad)


def summary_offset(opcode, start, length, *, pad=b''):
    return record(SUMMARY_OFFSET, struct.pack('<BQQ', opcode, start, length) + pad)


def data_end(crc=0):
    return record(DATA_END, struct.pack('<I', crc))


def footer(summary, start, offset_start, *, with_crc=True):
    """Return the footer behind a summary, which starts at an offset if there is one."""
    head = struct.pack('<BQQQ', FOOTER, 20, start, offset_start)
    return head + struct.pack('<I', zlib.crc32(summary + head) if with_crc else 0)


def spans(data, start, end):
    """Yield of each record between two offsets: opcode, where it starts and ends."""
    while start < end:
        opcode, length = struct.unpack_from('<BQ', data, start)
        yield opcode, start, start + 9 + length
        start += 9 + length
