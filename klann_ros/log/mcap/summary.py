"""The summary at the end of a closed file: channels, statistics, and the index of its records."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from operator import le
from typing import BinaryIO, NamedTuple

from klann_ros.log.read.block import MessageBlock
from klann_ros.sanitize.text import counted, verb
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex, Statistics
import numpy as np

from . import records
from .channels import Channels

_USED_KINDS = (
    *records.DEFINITIONS,
    Opcode.CHUNK_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.STATISTICS,
)


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
        ends = [self.entries[start].end or 0 for start in self._starts]
        following = [*self._starts, self.start][1:]
        return indexed == len(self.entries) and all(map(le, ends, following))

    @cached_property
    def names_all(self) -> bool:
        """Return whether it indexes every chunk, attachment and metadata record."""
        statistics = self.statistics
        if statistics is None:
            return False
        counts = statistics.chunk_count, statistics.metadata_count, statistics.attachment_count
        found = len(self.chunks), len(self.metadata), len(self.attachments)
        return counts == found and self.is_sound

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
        channels.update(number for chunk in self.chunks for number in chunk.message_index_offsets)
        return all(self.channels.topic(number) is not None for number in channels)

    def _messages_in_chunks(self, statistics: Statistics) -> bool:
        """Compare the sizes of the message indexes, if any, with the number of messages."""
        size = sum(chunk.message_index_length for chunk in self.chunks)
        count = sum(len(chunk.message_index_offsets) for chunk in self.chunks)
        entries = size - (records.RECORD_HEAD.size + records.INDEX_HEAD) * count
        return size == 0 or entries == records.INDEX_ENTRY * statistics.message_count


def read_summary(file: BinaryIO, footer: records.Footer) -> Summary:
    """Return the summary of a file; an empty one if it has none."""
    summary = Summary(closed=True)
    if footer.summary_start == 0:
        return summary
    records.check_summary(file, footer)
    summary.start, summary.verified = footer.summary_start, footer.crc != 0
    entries = summary.entries
    for span in records.spans(file, footer.summary_start, footer.offset):
        if span.opcode not in _USED_KINDS:
            continue
        content, at = records.read(file, span), span.offset
        if span.opcode in records.DEFINITIONS:
            summary.channels.add(span.opcode, content, at, verified=summary.verified)
        elif span.opcode == Opcode.CHUNK_INDEX:
            chunk = records.parse(ChunkIndex, content, at)
            summary.chunks.append(chunk)
            start, end = chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length
            entries[start] = IndexEntry(Opcode.CHUNK, end, chunk.compressed_size)
        elif span.opcode == Opcode.METADATA_INDEX:
            found = records.parse(MetadataIndex, content, at)
            summary.metadata.append(found.offset)
            entries[found.offset] = IndexEntry(Opcode.METADATA, found.offset + found.length)
        elif span.opcode == Opcode.ATTACHMENT_INDEX:
            index = records.parse(AttachmentIndex, content, at)
            summary.attachments.append(index.offset)
            end = index.offset + index.length
            entries[index.offset] = IndexEntry(Opcode.ATTACHMENT, end, index.data_size)
        elif span.opcode == Opcode.STATISTICS:
            summary.statistics = records.parse(Statistics, content, at)
    return summary


class ContentCount:
    """Counts the messages of a file, to compare them with its summary."""

    def __init__(self) -> None:
        # By offset of a chunk: the number of its messages, their first and last log time [ns].
        self._chunks: dict[int, tuple[int, int, int]] = {}
        # By channel.
        self.messages: Counter[int] = Counter()

    def add(self, offset: int, block: MessageBlock) -> None:
        """Count the messages of the chunk or message at an offset."""
        counts = np.bincount(block.heads['channel'])
        channels = np.flatnonzero(counts)
        self.messages.update(dict(zip(channels.tolist(), counts[channels].tolist(), strict=True)))
        times = block.heads['log_time']
        found = (len(times), int(times.min()), int(times.max())) if len(times) else (0, 0, 0)
        self._chunks[offset] = found

    def disagreements(self, summary: Summary) -> Iterator[tuple[str, bool]]:
        """
        Yield each disagreement with a summary, and whether messages are missing.

        The parts that a summary leaves out are no disagreement.
        """
        statistics = summary.statistics
        if statistics is not None:
            total, declared = self.messages.total(), statistics.message_count
            by_channel = statistics.channel_message_counts
            if declared != total:
                count = counted(declared, 'message')
                are = verb(total, 'is', 'are')
                yield f'the statistics count {count}, there {are} {total}', declared > total
            elif by_channel and +Counter(by_channel) != +self.messages:
                yield 'the statistics count other messages for each channel than there are', False
        index = {
            chunk.chunk_start_offset: (chunk.message_start_time, chunk.message_end_time)
            for chunk in summary.chunks
        }
        wrong = sum(self._is_wrong(offset, times) for offset, times in index.items())
        missing = sum(self._chunks[offset][0] for offset in self._chunks.keys() - index.keys())
        if wrong:
            yield f'the index is wrong about {counted(wrong, "chunk")}', False
        if index and missing:
            yield f'the index leaves out {counted(missing, "message")}', False

    def _is_wrong(self, offset: int, times: tuple[int, int]) -> bool:
        found = self._chunks.get(offset)
        return found is None or (found[0] > 0 and found[1:] != times)
