"""
The 416 files of MCAP's own conformance suite, made from its description.

Six contents, each in every shape that the flags below make together and that is of sense for it.
A padded one has three bytes behind the fields of each record that may have some; the records
in a chunk, the chunk itself, messages and the two last records are not padded there.
"""

from dataclasses import dataclass, field
from itertools import combinations
import zlib

from mcap_bytes import records as mcap

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


@dataclass
class _Indexes:
    chunks: list = field(default_factory=list)
    attachments: list = field(default_factory=list)
    metadata: list = field(default_factory=list)


def conformance_file(content, flags, *, pad=PADDING, pad_inner=b''):
    """
    Return the bytes of one of the files.

    Parameters
    ----------
    content, flags
        What is in it, and in which shape.
    pad
        What stands behind the fields of a padded file's records.
    pad_inner
        The same for the chunk and the records in it, which the suite does not pad.

    """
    pad, pad_inner = (pad, pad_inner) if PAD in flags else (b'', b'')
    data = bytearray(mcap.MAGIC + mcap.header(pad=pad))
    indexes = _Indexes()
    if CHUNKS in flags:
        _add_others(data, content, indexes, pad)
        _add_chunk(data, content, flags, indexes, pad=pad, pad_inner=pad_inner)
    else:
        data += _definitions(content, pad)
        data += b''.join(mcap.message(*item) for item in content.messages)
        _add_others(data, content, indexes, pad)
    data += mcap.data_end(zlib.crc32(data))
    start = len(data)
    groups = _summary(content, flags, indexes, pad)
    summary, offsets = b'', b''
    for group in filter(None, groups):
        if OFFSETS in flags:
            offsets += mcap.summary_offset(group[0], start + len(summary), len(group), pad=pad)
        summary += group
    offset_start = start + len(summary) if OFFSETS in flags else 0
    summary += offsets
    footer = mcap.footer(summary, start if summary else 0, offset_start)
    return bytes(data) + summary + footer + mcap.MAGIC


def _definitions(content, pad):
    schemas = b''.join(mcap.schema(*item, pad=pad) for item in content.schemas)
    return schemas + b''.join(mcap.channel(*item, pad=pad) for item in content.channels)


def _add_others(data, content, indexes, pad):
    for name, media_type, attached, times in content.attachments:
        record = mcap.attachment(name, media_type, attached, times, pad=pad)
        place = len(data), len(record)
        indexes.attachments.append((place, times, len(attached), name, media_type))
        data += record
    for name, entries in content.metadata:
        record = mcap.metadata(name, entries, pad=pad)
        indexes.metadata.append(((len(data), len(record)), name))
        data += record


def _add_chunk(data, content, flags, indexes, *, pad, pad_inner):
    inner, entries = bytearray(_definitions(content, pad_inner)), []
    for item in content.messages:
        entries.append((item[2], len(inner)))
        inner += mcap.message(*item)
    times = _times(content)
    record = mcap.chunk(bytes(inner), times, pad=pad_inner)
    place = len(data), len(record)
    data += record
    offsets, index = {}, b''
    if MESSAGE_INDEX in flags:
        offsets[content.channels[0][0]] = len(data)
        index = mcap.message_index(content.channels[0][0], entries, pad=pad)
        data += index
    sizes = len(inner), len(inner)
    indexes.chunks.append((times, place, (offsets, len(index)), sizes))


def _times(content):
    times = [item[2] for item in content.messages]
    return min(times, default=0), max(times, default=0)


def _summary(content, flags, indexes, pad):
    """Yield the groups of the summary, as far as the flags ask for them."""
    if SCHEMAS in flags:
        yield b''.join(mcap.schema(*item, pad=pad) for item in content.schemas)
    if CHANNELS in flags:
        yield b''.join(mcap.channel(*item, pad=pad) for item in content.channels)
    if STATISTICS in flags:
        counts = *content.counts, int(CHUNKS in flags)
        per_channel = {item[0]: len(content.messages) for item in content.channels}
        yield mcap.statistics(counts, _times(content), per_channel, pad=pad)
    if METADATA_INDEX in flags:
        yield b''.join(mcap.metadata_index(*item, pad=pad) for item in indexes.metadata)
    if ATTACHMENT_INDEX in flags:
        yield b''.join(mcap.attachment_index(*item, pad=pad) for item in indexes.attachments)
    if CHUNK_INDEX in flags:
        yield b''.join(mcap.chunk_index(*item, pad=pad) for item in indexes.chunks)
