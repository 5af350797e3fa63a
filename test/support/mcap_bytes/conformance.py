"""
Sound files in every shape that the specification allows.

The 416 files of MCAP's own conformance suite are made from its description: six contents, each in
every shape that the flags below make together and that is of sense for it. A padded one has three
bytes behind the fields of each record that may have some; the records in a chunk, the chunk
itself, messages and the two last records are not padded there.

Other files have unknown fields of any kind, and records of private and future kinds between the
others: in the data, in chunks, in the summary.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import combinations
import struct
import zlib

import lz4.frame
from mcap_bytes import records as mcap
import zstandard

CHUNKS, MESSAGE_INDEX, STATISTICS, SCHEMAS, CHANNELS = 'ch', 'mx', 'st', 'rsh', 'rch'
ATTACHMENT_INDEX, METADATA_INDEX, CHUNK_INDEX, OFFSETS, PAD = 'ax', 'mdx', 'chx', 'sum', 'pad'
FLAGS = (
    ATTACHMENT_INDEX,
    CHUNKS,
    CHUNK_INDEX,
    METADATA_INDEX,
    MESSAGE_INDEX,
    PAD,
    CHANNELS,
    SCHEMAS,
    STATISTICS,
    OFFSETS,
)
PADDING = b'\x01\xff\xff'
PACK = {'': bytes, 'lz4': lz4.frame.compress, 'zstd': zstandard.compress}
# Unknown fields: random bytes, bytes that look like records, or a record.
_SMALL = (
    lambda _: PADDING,
    lambda chance: bytes(chance.choice([1, 8, 9, 40])),
    lambda chance: b'\5' + struct.pack('<Q', chance.choice([0, 22, 30, 2**30, 2**63])) + bytes(30),
    lambda chance: mcap.message(1, 1, 1, 1, b'none')[: chance.randrange(1, 40)],
    lambda chance: chance.randbytes(chance.choice([0, 1, 3, 9, 40])),
)
_LARGE = (
    lambda _: mcap.chunk(mcap.message(1, 1, 1, 1, b'not a message')),
    lambda chance: bytes(chance.choice([400, 5000])),
    lambda chance: chance.randbytes(chance.choice([200, 3000])),
)
UNKNOWN = (*range(0x10, 0x80), *range(0x80, 0x100))


@dataclass(frozen=True)
class Input:
    """What is in a file; arguments of the functions that write the records."""

    name: str
    schemas: tuple = ()
    channels: tuple = ()
    messages: tuple = ()
    attachments: tuple = ()
    metadata: tuple = ()

    @property
    def counts(self):
        """Return how many messages, schemas, channels, attachments and metadata records it has."""
        kinds = self.messages, self.schemas, self.channels, self.attachments, self.metadata
        return tuple(map(len, kinds))


_EXAMPLE = {
    'schemas': ((1, 'Example', 'c', b'\4\5\6'),),
    'channels': ((1, 1, 'example', 'a', {'foo': 'bar'}),),
}
_TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
INPUTS = (
    Input('NoData'),
    Input(
        'OneSchemalessMessage',
        channels=((1, 0, 'example', 'text', {}),),
        messages=((1, 10, 2, 1, b'\1\2\3'),),
    ),
    Input('OneMessage', **_EXAMPLE, messages=((1, 10, 2, 1, b'\1\2\3'),)),
    Input(
        'OneAttachment',
        attachments=(('myFile', 'application/octet-stream', b'\1\2\3', (2, 1)),),
    ),
    Input('OneMetadata', metadata=(('myMetadata', {'foo': 'bar'}),)),
    Input(
        'TenMessages',
        **_EXAMPLE,
        messages=tuple((1, n, time, time, b'\1\2\3') for n, time in enumerate(_TIMES)),
    ),
)


def variants():
    """Yield the name, the content and the flags of each file."""
    for content in INPUTS:
        for number in range(len(FLAGS) + 1):
            for flags in combinations(FLAGS, number):
                if _makes_sense(content, set(flags)):
                    yield '-'.join([content.name, *flags]), content, frozenset(flags)


def _makes_sense(content, flags):
    needs = {
        ATTACHMENT_INDEX: content.attachments,
        METADATA_INDEX: content.metadata,
        SCHEMAS: content.schemas,
        CHANNELS: content.channels,
        CHUNKS: content.channels,
        CHUNK_INDEX: CHUNKS in flags,
        MESSAGE_INDEX: CHUNKS in flags,
        OFFSETS: flags
        & {CHUNK_INDEX, SCHEMAS, CHANNELS, METADATA_INDEX, ATTACHMENT_INDEX, STATISTICS},
    }
    return all(needs.get(flag, True) for flag in flags)


def conformance_file(content, flags, *, pad=PADDING, pad_inner=b'', **more):
    """
    Return the bytes of a file of a content in a shape.

    `pad` is what stands behind the fields of a padded file's records, `pad_inner` the same for the
    chunks and the records in them, which the suite does not pad, and `between` what stands before
    records: bytes, or a function of them. `compression` and number of `chunks` are more options.
    """
    pads = (pad, pad_inner) if PAD in flags else (b'', b'')
    return _File(content, flags, *pads, **more).data()


def content_of(messages):
    """Return messages, an attachment and a metadata record as the content of a file."""
    topics = list(dict.fromkeys(message.topic for message in messages))
    return Input(
        '',
        tuple((n, t.type, 'ros2msg', t.definition) for n, t in enumerate(topics, 1)),
        tuple((n, n, t.name, 'cdr', {}) for n, t in enumerate(topics, 1)),
        tuple(
            (topics.index(m.topic) + 1, m.sequence, m.log_time, m.publish_time, m.data)
            for m in messages
        ),
        (('geometry.yaml', 'application/yaml', b'l_ab: 0.12', (1, 1)),),
        (('solver', {'tolerance': '1e-12'}),),
    )


def legal_file(messages, chance, *, flags=None, large=True, compression=None):
    """
    Return a file of messages with unknown fields and records, as a random number generator says.

    Without flags it has any shape; `large` fields may contain a chunk.
    """
    content = content_of(messages)
    while flags is None or not _makes_sense(content, flags):
        flags = {flag for flag in FLAGS if chance.random() < 0.7}
    kinds = (*_SMALL, *_LARGE) if large else _SMALL

    def fill(share=0.2):
        return chance.choice(kinds)(chance) if chance.random() < share else b''

    def between():
        return mcap.record(chance.choice(UNKNOWN), fill(0.9)) if chance.random() < 0.1 else b''

    compression = chance.choice([*PACK]) if compression is None else compression
    more = {'between': between, 'compression': compression, 'chunks': chance.randrange(1, 12)}
    return conformance_file(content, flags | {PAD}, pad=fill, pad_inner=fill, **more)


class _File:
    """A file in the making."""

    def __init__(self, content, flags, *additions, between=b'', compression='', chunks=1):
        self._content = content
        self._flags = flags
        self._compression = compression
        self._pad, self._pad_inner, self._between = map(_as_function, (*additions, between))
        size = -(-len(content.messages) // chunks) or 1
        starts = range(0, len(content.messages) or 1, size)
        self._parts = [content.messages[slice(start, start + size)] for start in starts]
        # Arguments of the functions that write the records of the index.
        self._attachments, self._metadata, self._chunks = [], [], []
        self._data = bytearray(mcap.MAGIC + mcap.header(pad=self._pad()))

    def data(self):
        if CHUNKS in self._flags:
            self._add_others()
            for part in self._parts:
                self._add_chunk(part)
        else:
            self._add(*self._definitions(self._pad), *self._messages(self._content.messages))
            self._add_others()
        self._add(b'')
        self._data += mcap.data_end(zlib.crc32(self._data))
        start = len(self._data)
        summary, offsets = b'', b''
        for group in filter(None, map(b''.join, self._summary())):
            summary += self._between()
            if OFFSETS in self._flags:
                place = start + len(summary), len(group)
                offsets += mcap.summary_offset(group[0], *place, pad=self._pad())
            summary += group
        offset_start = start + len(summary) if OFFSETS in self._flags else 0
        summary += offsets
        footer = mcap.footer(summary, start if summary else 0, offset_start)
        return bytes(self._data) + summary + footer + mcap.MAGIC

    def _add(self, *records):
        for record in records:
            self._data += self._between() + record

    def _definitions(self, pad):
        yield from (mcap.schema(*item, pad=pad()) for item in self._content.schemas)
        yield from (mcap.channel(*item, pad=pad()) for item in self._content.channels)

    def _messages(self, messages):
        return (mcap.message(*item) for item in messages)

    def _add_others(self):
        for name, media_type, attached, times in self._content.attachments:
            record = mcap.attachment(name, media_type, attached, times, pad=self._pad())
            self._add(record)
            place = len(self._data) - len(record), len(record)
            self._attachments.append((place, times, len(attached), name, media_type))
        for name, entries in self._content.metadata:
            record = mcap.metadata(name, entries, pad=self._pad())
            self._add(record)
            self._metadata.append(((len(self._data) - len(record), len(record)), name))

    def _add_chunk(self, messages):
        inner, entries = bytearray(), {}
        for record in self._definitions(self._pad_inner):
            inner += self._between() + record
        for item, record in zip(messages, self._messages(messages), strict=True):
            inner += self._between()
            entries.setdefault(item[0], []).append((item[2], len(inner)))
            inner += record
        times, packed = _times(messages), PACK[self._compression](bytes(inner))
        options = {'compression': self._compression, 'packed': packed, 'pad': self._pad_inner()}
        record = mcap.chunk(bytes(inner), times, **options)
        self._add(record)
        place = len(self._data) - len(record), len(record)
        end, offsets = len(self._data), {}
        for number, rows in entries.items() if MESSAGE_INDEX in self._flags else ():
            offsets[number] = len(self._data)
            self._data += mcap.message_index(number, rows, pad=self._pad())
        index = offsets, len(self._data) - end
        self._chunks.append((times, place, index, (len(packed), len(inner))))

    def _summary(self):
        """Yield the groups of the summary, as far as the flags ask for them."""
        content, flags, pad = self._content, self._flags, self._pad
        if SCHEMAS in flags:
            yield (mcap.schema(*item, pad=pad()) for item in content.schemas)
        if CHANNELS in flags:
            yield (mcap.channel(*item, pad=pad()) for item in content.channels)
        if STATISTICS in flags:
            counts = *content.counts, len(self._chunks)
            per_channel = Counter(item[0] for item in content.messages)
            yield [mcap.statistics(counts, _times(content.messages), per_channel, pad=pad())]
        if METADATA_INDEX in flags:
            yield (mcap.metadata_index(*item, pad=pad()) for item in self._metadata)
        if ATTACHMENT_INDEX in flags:
            yield (mcap.attachment_index(*item, pad=pad()) for item in self._attachments)
        if CHUNK_INDEX in flags:
            options = {'compression': self._compression}
            yield (mcap.chunk_index(*item, **options, pad=pad()) for item in self._chunks)


def _as_function(addition):
    return addition if callable(addition) else lambda: addition


def _times(messages):
    times = [item[2] for item in messages]
    return min(times, default=0), max(times, default=0)
