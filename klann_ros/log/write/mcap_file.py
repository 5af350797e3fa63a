"""
One MCAP file being written: schemas, channels, chunks with checksums (CRC), and its index.

The `mcap` library encodes all records (specification: mcap.dev/spec) except messages and message
indexes: its writer packs each field by a call of its own, which takes four times as long.
"""

from array import array
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
import struct
import sys
import zlib

from klann_ros.log.bag_metadata import FileSummary, HASH_KEY, QOS_KEY
from klann_ros.log.errors import UnwritableError
from klann_ros.log.mcap.records import (
    encoded,
    encoded_chunk,
    encoded_end,
    MAGIC,
    RECORD_HEAD,
    Records,
    SUMMARY_KINDS,
)
from klann_ros.log.qos import qos_for_writing
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable
import lz4.frame  # type: ignore[import-untyped] # lz4 has no types
from mcap.opcode import Opcode
from mcap.records import (
    Attachment as AttachmentRecord,
    AttachmentIndex,
    Channel,
    DataEnd,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
)
import zstandard

from .durable_file import DiskReserve, DurableFile

# Name and function of each compression.
COMPRESSIONS: dict[str, tuple[str, Callable[[bytearray], bytes]]] = {
    'zstd': ('zstd', zstandard.compress),
    'lz4': ('lz4', lz4.frame.compress),
    'none': ('', bytes),
}

_TIME_END = 2**64
_SEQUENCE_MASK = 2**32 - 1
# Opcode, length, channel, sequence number, log time and publish time, before a message's data.
_MESSAGE = struct.Struct('<BQHIQQ')
_MESSAGE_FIELDS = _MESSAGE.size - RECORD_HEAD.size
# Compressed together: index records of chunks [bytes].
_INDEX_BLOCK_SIZE = 64 * 1024


@dataclass(slots=True)
class _Channel:
    """A topic in the file."""

    metadata: dict[str, str]
    # 0: not registered yet.
    number: int = 0
    # Messages passed to the file.
    count: int = 0
    # Alternately the log time [ns] and the offset in the open chunk [bytes] of each message.
    index: 'array[int]' = field(default_factory=lambda: array('Q'))

    def take_entries(self) -> bytes:
        """Return the index of the open chunk as it stands in a file, and begin another one."""
        entries = self.index
        self.index = array('Q')
        if sys.byteorder == 'big':
            entries.byteswap()
        return entries.tobytes()


class _ChunkIndexes:
    """The index records of chunks, which pile up until the end: compressed, in blocks."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._open_block = bytearray()
        self._count = 0

    def append(self, record: bytes) -> None:
        """Add a record."""
        self._count += 1
        self._open_block += record
        if len(self._open_block) > _INDEX_BLOCK_SIZE:
            self._blocks.append(zlib.compress(self._open_block))
            self._open_block = bytearray()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[bytes]:
        """Yield all records, several at once."""
        yield from map(zlib.decompress, self._blocks)
        yield bytes(self._open_block)


def _check_times(name: str, *times: int) -> None:
    """Raise an UnwritableError for times [ns] that do not fit into a record."""
    if min(times) < 0 or max(times) >= _TIME_END:
        text = ' and '.join(f'{time} ns' for time in times)
        raise UnwritableError(
            f'{printable(name)}: the times {text} must be within 0 and 2^64 - 1 ns'
        )


class McapFile(DurableFile):
    """
    An MCAP file that has its header on the disk as soon as it is created.

    See RunWriter for the parameters. An OSError means that the disk refused.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: str,
        chunk_size: int,
        library: str,
        reserve: DiskReserve | None = None,
    ) -> None:
        super().__init__(path, reserve)
        self._compression, self._compress = COMPRESSIONS[compression]
        self._chunk_size = chunk_size
        self._start_time = self._end_time = 0
        self._channels: dict[Topic, _Channel] = {}
        self._last_topic: Topic | None = None
        self._last_channel = _Channel({})
        self._schemas: dict[tuple[str, str, str], int] = {}
        # The open chunk, and the records of the summary.
        self._chunk = bytearray()
        self._summary: dict[int, list[bytes]] = {kind: [] for kind in SUMMARY_KINDS}
        self._chunk_indexes = _ChunkIndexes()
        # End of each chunk that may not be on the disk [bytes], and the content up to there.
        self._ends = deque([(0, self.received())])
        try:
            self.append(MAGIC + encoded(Header('ros2', library)))
            self.sync()
        except BaseException:
            self.close()
            # Half a header is no file.
            with suppress(OSError):
                path.unlink()
            raise

    def write(self, message: Message) -> None:
        """Add a message; see :meth:`klann_ros.log.write.writer.RunWriter.write`."""
        if self.failure is not None:
            raise self.failure
        topic = message.topic
        log_time = message.log_time
        data = message.data
        if not (0 <= log_time < _TIME_END and 0 <= message.publish_time < _TIME_END):
            _check_times(topic.name, log_time, message.publish_time)
        if topic is not self._last_topic:
            # Cache: the lookup costs as much as writing, and the topic rarely changes.
            self._last_channel = self._channels.get(topic) or self._add_channel(message)
            self._last_topic = topic
        channel = self._last_channel
        if log_time > self._end_time:
            self._end_time = log_time
        elif log_time < self._start_time:
            self._start_time = log_time
        # From here on the message counts as one of this file, also if the disk fails.
        channel.count += 1
        if not channel.number:
            self._register(topic, channel)
        chunk = self._chunk
        channel.index.extend((log_time, len(chunk)))
        chunk += _MESSAGE.pack(
            Opcode.MESSAGE,
            _MESSAGE_FIELDS + len(data),
            channel.number,
            message.sequence & _SEQUENCE_MASK,
            log_time,
            message.publish_time,
        )
        chunk += data
        if len(chunk) > self._chunk_size:
            self._finish_chunk()

    def attach(self, file: Attachment) -> None:
        """Add an attachment."""
        self.raise_failure()
        _check_times(file.name, file.log_time, file.create_time)
        offset = self.size
        record = AttachmentRecord(
            file.create_time, file.log_time, file.name, file.media_type, file.data
        )
        length = self.append(encoded(record))
        index = AttachmentIndex(
            offset,
            length,
            file.log_time,
            file.create_time,
            len(file.data),
            file.name,
            file.media_type,
        )
        self._summary[Opcode.ATTACHMENT_INDEX].append(encoded(index))

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self.raise_failure()
        offset = self.size
        length = self.append(encoded(Metadata(name, dict(mapping))))
        self._summary[Opcode.METADATA_INDEX].append(encoded(MetadataIndex(offset, length, name)))

    def flush(self) -> None:
        """Finish the chunk and fsync."""
        self.raise_failure()
        self._finish_chunk()
        self.sync()

    def finish(self) -> None:
        """Write index, summary and footer, and fsync."""
        self.raise_failure()
        self._finish_chunk()
        self.append(encoded(DataEnd(0)))
        registered = (channel for channel in self._channels.values() if channel.number)
        counts = {channel.number: channel.count for channel in registered}
        times = self._start_time, self._end_time
        groups: dict[int, Records] = {**self._summary, Opcode.CHUNK_INDEX: self._chunk_indexes}
        self.append(encoded_end(self.size, groups, counts, times))
        self.sync()

    @property
    def duration(self) -> float:
        """Return the time between its earliest and its latest message [s]."""
        return (self._end_time - self._start_time) / 1e9

    def summary(self) -> FileSummary:
        """Return the file's content; after a failure, the part that is known to be in it."""
        return self.durable_summary()[0]

    def durable_summary(self) -> tuple[FileSummary, Counter[Topic]]:
        """Return the file's content, and the messages passed to it that are not in it."""
        received = self.received()
        if self.failure is None:
            return received, Counter()
        durable = [content for end, content in self._ends if end <= self.written_size][-1]
        return durable, Counter(received.counts) - Counter(durable.counts)

    def received(self) -> FileSummary:
        """Return the content of all messages that were passed to it."""
        # One copy: other threads call this.
        channels = list(self._channels.items())
        counts = {topic: channel.count for topic, channel in channels}
        return FileSummary(self.path.name, counts, self._start_time, self._end_time)

    def _add_channel(self, message: Message) -> _Channel:
        """Return an unregistered channel for a topic; raise a MalformedQosError for its QoS."""
        topic = message.topic
        metadata = dict(topic.extra)
        if topic.qos:
            metadata[QOS_KEY] = qos_for_writing(topic.qos)
        if topic.type_hash:
            metadata[HASH_KEY] = topic.type_hash
        if not self._channels:
            self._start_time = self._end_time = message.log_time
        return self._channels.setdefault(topic, _Channel(metadata))

    def _register(self, topic: Topic, channel: _Channel) -> None:
        """
        Add a topic's schema and channel to the open chunk, and repeat them outside of chunks.

        If the first chunk is damaged in a file without a summary, all later chunks would be
        undecodable without the repetition.
        """
        key = (topic.type, topic.schema_encoding, topic.definition)
        definitions = b''
        if any((topic.type, topic.definition)) and key not in self._schemas:
            self._schemas[key] = len(self._schemas) + 1
            text = topic.definition.encode()
            schema = Schema(self._schemas[key], text, topic.schema_encoding, topic.type)
            definitions = encoded(schema)
            self._summary[Opcode.SCHEMA].append(definitions)
        channels = self._summary[Opcode.CHANNEL]
        record = Channel(
            id=len(channels) + 1,
            topic=topic.name,
            message_encoding=topic.message_encoding,
            metadata=channel.metadata,
            schema_id=self._schemas.get(key, 0),
        )
        channels.append(encoded(record))
        definitions += channels[-1]
        self._chunk += definitions
        self.append(definitions)
        channel.number = record.id

    def _finish_chunk(self) -> None:
        """Write the open chunk and its message indexes, unless it has no message."""
        indexed = [channel for channel in self._channels.values() if channel.index]
        if not indexed:
            return
        compression = self._compression, self._compress(self._chunk)
        first = min(min(channel.index[::2]) for channel in indexed)
        last = max(max(channel.index[::2]) for channel in indexed)
        entries = {channel.number: channel.take_entries() for channel in indexed}
        start = self.size
        chunk, indexes, index = encoded_chunk(
            start, self._chunk, compression, (first, last), entries
        )
        self._chunk = bytearray()
        # The ends are updated before the writing, which may flush.
        while len(self._ends) > 1 and self._ends[1][0] <= self.synced_size:
            self._ends.popleft()
        self._ends.append((start + len(chunk), self.received()))
        self.append(chunk)
        self.append(indexes)
        self._chunk_indexes.append(encoded(index))
