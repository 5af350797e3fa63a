"""What describes a file: its schemas and channels, and the summary at the end of a closed one."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, BinaryIO, NamedTuple

from klann_ros.log.bag_metadata import HASH_KEY, QOS_KEY
from klann_ros.log.errors import DamagedError
from klann_ros.log.read.storage import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.sanitize.text import counted, verb
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema, Statistics
import numpy as np

from . import records
from .content import Content

_MAX_DEFINITIONS_SIZE = 32 * 1024 * 1024
# Memory of a definition beside its content [bytes].
_DEFINITION_OVERHEAD = 256


class Channels:
    """
    The schemas and channels of one file, collected from all places that repeat them.

    Where versions differ, because bits flipped, one under a matching CRC has priority, then the
    most frequent one.
    """

    def __init__(self) -> None:
        self._schemas = _Definitions('schema', records.parse_schema)
        self._channels = _Definitions('channel', partial(records.parse, Channel))
        # Caches: many channels may share one schema.
        self._topics: dict[int, Topic | None] = {}
        self._texts: dict[int, tuple[Schema, str]] = {}

    @property
    def contradictions(self) -> list[str]:
        """Return the schemas and channels with several versions, one line each."""
        return self._schemas.contradictions() + self._channels.contradictions()

    def add(self, opcode: int, content: bytes, offset: int = 0, *, verified: bool = False) -> None:
        """Add a schema or a channel record; ignore others, and schema 0, which means none."""
        if opcode == Opcode.SCHEMA and content[:2] != bytes(2):
            changed = self._schemas.add(content, offset, verified=verified)
            if changed is not None:
                self._texts.pop(changed, None)
                self._topics.clear()
        elif opcode == Opcode.CHANNEL:
            changed = self._channels.add(content, offset, verified=verified)
            if changed is not None:
                self._topics.pop(changed, None)

    def add_all(self, chunk: Content, offset: int) -> None:
        """Add the schemas and channels of a chunk at this offset."""
        for opcode, content in chunk.definitions():
            self.add(opcode, content, offset, verified=chunk.verified)

    def topic(self, channel: int) -> Topic | None:
        """Return the topic of a channel; None while its record or its schema is unknown."""
        if channel not in self._topics:
            self._topics[channel] = self._make_topic(channel)
        return self._topics[channel]

    def numbers(self) -> list[int]:
        """Return the known channels in the order of the file."""
        return list(self._channels.best)

    def topics(self) -> dict[int, Topic]:
        """Return the known topics by channel, in the order of the file."""
        topics = {}
        for number in self.numbers():
            topic = self.topic(number)
            if topic is not None:
                topics[number] = topic
        return topics

    def _make_topic(self, number: int) -> Topic | None:
        """Return the topic of a channel; None if its record or its schema is missing."""
        channel = self._channels.get(number)
        if channel is None:
            return None
        schema_text = self._schema_text(channel.schema_id)
        if schema_text is None:
            return None
        schema, definition = schema_text
        extra = dict(channel.metadata)
        return Topic(
            name=channel.topic,
            type=schema.name,
            definition=definition,
            qos=extra.pop(QOS_KEY, ''),
            type_hash=extra.pop(HASH_KEY, ''),
            message_encoding=channel.message_encoding,
            schema_encoding=schema.encoding,
            extra=tuple(extra.items()),
        )

    def _schema_text(self, number: int) -> tuple[Schema, str] | None:
        """Return a schema and its text; None while it is unknown."""
        if number not in self._texts:
            schema = self._schemas.get(number) if number else Schema(0, b'', '', '')
            if schema is None:
                return None
            self._texts[number] = schema, schema.data.decode('utf-8', 'replace')
        return self._texts[number]


class _Definitions:
    """All versions of the records of one kind, by number."""

    def __init__(self, name: str, parse_one: Callable[[bytes, int], Any]) -> None:
        self._name = name
        self._parse = parse_one
        # Versions by their content: whether a CRC matched, and their number of occurrences.
        self._versions: dict[int, dict[bytes, tuple[bool, int]]] = {}
        self.best: dict[int, bytes] = {}
        self._size = 0

    def add(self, content: bytes, offset: int, *, verified: bool) -> int | None:
        """Add a record; return its number if that has another best version now."""
        number = int.from_bytes(content[:2], 'little')
        versions = self._versions.setdefault(number, {})
        if content not in versions:
            self._parse(content, offset)
            self._size += len(content) + _DEFINITION_OVERHEAD
            if self._size > _MAX_DEFINITIONS_SIZE:
                limit = f'{_MAX_DEFINITIONS_SIZE} bytes of schemas or channels'
                raise DamagedError(f'there are more than {limit}', offset)
        was_verified, count = versions.get(content, (False, 0))
        versions[content] = (was_verified or verified, count + 1)
        best = self.best.get(number)
        if best == content or (best is not None and versions[best] >= versions[content]):
            return None
        self.best[number] = content
        return number

    def get(self, number: int) -> Any:
        content = self.best.get(number)
        return None if content is None else self._parse(content, 0)

    def contradictions(self) -> list[str]:
        lines = []
        for number, versions in self._versions.items():
            if len(versions) > 1:
                is_verified, _ = versions[self.best[number]]
                chosen = 'the one under a CRC' if is_verified else 'the most frequent'
                ways = f'{self._name} {number} is described in {len(versions)} ways'
                lines.append(f'{ways}, {chosen} was taken')
        return lines


class IndexEntry(NamedTuple):
    """Opcode and end of a record, and the size of its data [bytes]; None if unknown."""

    opcode: int | None = None
    end: int | None = None
    size: int | None = None


@dataclass
class Summary:
    """The content of a summary."""

    # Whether the file has a valid end, with a summary or without.
    closed: bool = False
    # Its offset [bytes]; 0 without any.
    start: int = 0
    # Whether its CRC matched.
    verified: bool = False
    channels: Channels = field(default_factory=Channels)
    chunks: list[ChunkIndex] = field(default_factory=list)
    statistics: Statistics | None = None
    # Offsets of these records [bytes].
    metadata: list[int] = field(default_factory=list)
    attachments: list[int] = field(default_factory=list)
    # All indexed records, by their offsets [bytes].
    entries: dict[int, IndexEntry] = field(default_factory=dict)

    @cached_property
    def is_sound(self) -> bool:
        """Return whether the indexed records follow each other without overlap before it."""
        indexed = len(self.chunks) + len(self.metadata) + len(self.attachments)
        return indexed == len(self.entries) and all(
            (self.entries[start].end or 0) <= next_start
            for start, next_start in pairwise([*self._starts, self.start])
        )

    @cached_property
    def names_all(self) -> bool:
        """Return whether it indexes every chunk, attachment and metadata record."""
        statistics = self.statistics
        return (
            statistics is not None
            and statistics.chunk_count == len(self.chunks)
            and statistics.metadata_count == len(self.metadata)
            and statistics.attachment_count == len(self.attachments)
            and self.is_sound
        )

    @cached_property
    def is_index(self) -> bool:
        """
        Return whether everything in the file can be found by it.

        Recorders may leave out any part, and may put messages outside of chunks.
        """
        statistics = self.statistics
        return (
            statistics is not None
            and len(self.chunks) > 0
            and statistics.channel_count == len(self.channels.numbers())
            and self.names_all
            and self._names_all_topics()
            and self._messages_in_chunks(statistics)
        )

    def discard_entries(self) -> None:
        """Make the index useless for locating records."""
        self.entries.clear()
        self._starts.clear()

    def entry(self, offset: int) -> IndexEntry:
        """Return the entry of the record at an offset, an empty one if it is not indexed."""
        return self.entries.get(offset, IndexEntry())

    def first_from(self, offset: int) -> int | None:
        """Return the offset of the first indexed record from an offset on."""
        number = bisect_left(self._starts, offset)
        return self._starts[number] if number < len(self._starts) else None

    @cached_property
    def _starts(self) -> list[int]:
        return sorted(self.entries)

    def _names_all_topics(self) -> bool:
        channels = set(self.channels.numbers())
        for chunk in self.chunks:
            channels.update(chunk.message_index_offsets)
        return all(self.channels.topic(number) is not None for number in channels)

    def _messages_in_chunks(self, statistics: Statistics) -> bool:
        """Compare the sizes of the message indexes, if any, with the number of messages."""
        size = sum(chunk.message_index_length for chunk in self.chunks)
        count = sum(len(chunk.message_index_offsets) for chunk in self.chunks)
        entries_size = size - (records.RECORD_HEAD.size + records.INDEX_HEAD.size) * count
        return size == 0 or entries_size == records.INDEX_ENTRY * statistics.message_count

    def add(self, opcode: int, content: bytes, offset: int) -> None:
        """Add a record of the summary at an offset [bytes]; ignore kinds without a use."""
        self.channels.add(opcode, content, offset, verified=self.verified)
        if opcode == Opcode.CHUNK_INDEX:
            chunk = records.parse(ChunkIndex, content, offset)
            self.chunks.append(chunk)
            start = chunk.chunk_start_offset
            end = start + chunk.chunk_length
            self.entries[start] = IndexEntry(Opcode.CHUNK, end, chunk.compressed_size)
        elif opcode == Opcode.METADATA_INDEX:
            metadata = records.parse(MetadataIndex, content, offset)
            self.metadata.append(metadata.offset)
            end = metadata.offset + metadata.length
            self.entries[metadata.offset] = IndexEntry(Opcode.METADATA, end)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            index = records.parse(AttachmentIndex, content, offset)
            self.attachments.append(index.offset)
            end = index.offset + index.length
            self.entries[index.offset] = IndexEntry(Opcode.ATTACHMENT, end, index.data_size)
        elif opcode == Opcode.STATISTICS:
            self.statistics = records.parse(Statistics, content, offset)


def read_summary(file: BinaryIO, footer: records.Footer) -> Summary:
    """Return the summary of a file; an empty one if it has none."""
    summary = Summary(closed=True)
    if footer.summary_start == 0:
        return summary
    records.check_summary(file, footer)
    summary.start = footer.summary_start
    summary.verified = footer.crc != 0
    used_kinds = (*records.SUMMARY_KINDS, Opcode.STATISTICS)
    for span in records.spans(file, footer.summary_start, footer.offset):
        if span.opcode in used_kinds:
            summary.add(span.opcode, records.read(file, span), span.offset)
    return summary


class ContentCount:
    """Counts the messages of a file, to compare them with its summary."""

    def __init__(self) -> None:
        # Number of messages, first and last log time [ns] of each chunk, by its offset.
        self._chunks: dict[int, tuple[int, int, int]] = {}
        # The number of messages of each channel.
        self.messages: Counter[int] = Counter()

    def add(self, offset: int, block: MessageBlock) -> None:
        """Count the messages of the chunk or message at an offset."""
        counts = np.bincount(block.heads['channel'])
        channels = np.flatnonzero(counts)
        self.messages.update(dict(zip(channels.tolist(), counts[channels].tolist(), strict=True)))
        self._chunks[offset] = (len(block), *(block.times or (0, 0)))

    def disagreements(self, summary: Summary) -> Iterator[tuple[str, bool]]:
        """
        Yield each disagreement with a summary, and whether messages are missing.

        The parts that a summary leaves out are no disagreement.
        """
        statistics = summary.statistics
        if statistics is not None:
            total = self.messages.total()
            declared = statistics.message_count
            by_channel = statistics.channel_message_counts
            if declared != total:
                count = counted(declared, 'message')
                are = verb(total, 'is', 'are')
                yield f'the statistics count {count}, there {are} {total}', declared > total
            elif by_channel and +Counter(by_channel) != +self.messages:
                yield 'the statistics count other messages for each channel than there are', False
        index = {chunk.chunk_start_offset: chunk for chunk in summary.chunks}
        wrong = sum(map(self._is_wrong, index.values()))
        if wrong:
            yield f'the index is wrong about {counted(wrong, "chunk")}', False
        unindexed = sum(self._chunks[offset][0] for offset in self._chunks.keys() - index.keys())
        if index and unindexed:
            yield f'the index leaves out {counted(unindexed, "message")}', False

    def _is_wrong(self, index: ChunkIndex) -> bool:
        count, *times = self._chunks.get(index.chunk_start_offset, (-1, 0, 0))
        declared = [index.message_start_time, index.message_end_time]
        return count < 0 or (count > 0 and times != declared)
