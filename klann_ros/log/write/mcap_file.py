"""One MCAP file being written: schemas, channels, chunks with checksums (CRC), and its index."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from klann_ros.log.bag_metadata import FileSummary, HASH_KEY, QOS_KEY
from klann_ros.log.errors import UnwritableError
from klann_ros.log.qos import qos_for_writing
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, IndexType, Writer

from .durable_file import DiskReserve, DurableFile, FileFault

COMPRESSIONS = {
    'zstd': CompressionType.ZSTD,
    'lz4': CompressionType.LZ4,
    'none': CompressionType.NONE,
}

_TIME_END = 2**64
_SEQUENCE_MASK = 2**32 - 1
_CHUNK = bytes([Opcode.CHUNK])


@dataclass(slots=True)
class _Channel:
    metadata: dict[str, str]
    number: int = 0  # not registered yet
    count: int = 0


class ChunkTrackingFile:
    """
    Output of the MCAP library that stores the file's content at the end of each chunk.

    The summary of messages passed to the library is exact then: all of them are in chunks.
    """

    def __init__(self, file: DurableFile, summary: Callable[[], FileSummary]) -> None:
        self.tell, self.flush = file.tell, file.flush
        self._file, self._summary = file, summary
        # End of each chunk [bytes], and the content of the file up to there.
        self._chunks = deque([(0, summary())])

    def write(self, data: bytes) -> int:
        """Write data of the library, which writes each chunk's record by itself."""
        if data[:1] == _CHUNK:
            # Before writing, which may flush.
            while len(self._chunks) > 1 and self._chunks[1][0] <= self._file.synced_size:
                self._chunks.popleft()
            self._chunks.append((self.tell() + len(data), self._summary()))
        return self._file.write(data)

    def last_durable_summary(self) -> FileSummary:
        """Return the content that is known to be in the file after a failure."""
        return [summary for end, summary in self._chunks if end <= self._file.written_size][-1]


class McapFile:
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
        profile: str,
        library: str,
        reserve: DiskReserve | None = None,
    ) -> None:
        self.path = path
        self._start_time = self._end_time = 0
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[Topic, _Channel] = {}
        self._last_topic: Topic | None = None
        self._last_channel = _Channel({})
        self._file = DurableFile(path, reserve)
        self.find_fault: Callable[[], FileFault | None] = self._file.find_fault
        self._chunks = ChunkTrackingFile(self._file, self._received)
        self._writer = Writer(
            # The library calls write, tell and flush only.
            cast('Any', self._chunks),
            chunk_size=chunk_size,
            compression=COMPRESSIONS[compression],
            index_types=IndexType.ALL,
            use_chunking=True,
            use_statistics=True,
            use_summary_offsets=True,
            enable_crcs=True,
        )
        try:
            self._writer.start(profile, library)
            self._file.sync()
        except BaseException:
            self._file.close()
            # Half a header is no file.
            with suppress(OSError):
                path.unlink()
            raise

    @property
    def failure(self) -> OSError | None:
        """Return the disk's first error; nothing can be written after it."""
        return self._file.failure

    def write(self, message: Message) -> None:
        """Add a message; see :meth:`klann_ros.log.write.writer.RunWriter.write`."""
        self._file.raise_failure()
        log_time = message.log_time
        # The library would fail with half of the record in the chunk.
        if not (0 <= log_time < _TIME_END and 0 <= message.publish_time < _TIME_END):
            raise UnwritableError(
                f'{printable(message.topic.name)}: the times {log_time} ns and '
                f'{message.publish_time} ns must be within 0 and 2^64 - 1 ns'
            )
        topic = message.topic
        if topic is not self._last_topic:
            # Cache: the lookup costs as much as writing, and the topic rarely changes.
            self._last_channel = self._channels.get(topic) or self._add_channel(message)
            self._last_topic = topic
        channel = self._last_channel
        # From here on the message counts as one of this file, also if the disk fails.
        channel.count += 1
        self._start_time = min(self._start_time, log_time)
        self._end_time = max(self._end_time, log_time)
        if not channel.number:
            self._register(topic, channel)
        sequence = message.sequence & _SEQUENCE_MASK
        self._writer.add_message(
            channel.number, log_time, message.data, message.publish_time, sequence
        )

    def attach(self, attachment: Attachment) -> None:
        """Add an attachment."""
        self._file.raise_failure()
        if not (0 <= attachment.log_time < _TIME_END and 0 <= attachment.create_time < _TIME_END):
            raise UnwritableError(
                f'{printable(attachment.name)}: the times {attachment.log_time} ns and '
                f'{attachment.create_time} ns must be within 0 and 2^64 - 1 ns'
            )
        self._writer.add_attachment(
            attachment.create_time,
            attachment.log_time,
            attachment.name,
            attachment.media_type,
            attachment.data,
        )

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._file.raise_failure()
        self._writer.add_metadata(name, dict(mapping))

    def flush(self) -> None:
        """Finish the chunk and fsync."""
        self._file.raise_failure()
        self._writer.flush()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()

    def finish(self) -> None:
        """Write index, summary and footer, and fsync."""
        self._file.raise_failure()
        self._writer.finish()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()

    def close(self) -> None:
        """Close the file, finished or not. Never raises."""
        self._file.close()

    @property
    def size(self) -> int:
        """Return its size without the open chunk [bytes]."""
        return self._file.tell()

    @property
    def message_count(self) -> int:
        """Return the number of messages passed to it."""
        return self._received().message_count

    @property
    def duration(self) -> float:
        """Return the time between its earliest and its latest message [s]."""
        return (self._end_time - self._start_time) / 1e9

    def summary(self) -> FileSummary:
        """Return the file's content; after a failure, the part that is known to be in it."""
        return self.durable_summary()[0]

    def durable_summary(self) -> tuple[FileSummary, Counter[Topic]]:
        """Return the file's content, and the messages passed to it that are not in it."""
        received = self._received()
        if self._file.failure is None:
            return received, Counter()
        durable = self._chunks.last_durable_summary()
        return durable, Counter(received.counts) - Counter(durable.counts)

    def _received(self) -> FileSummary:
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
        Register a topic with its first message, and repeat its schema and channel outside chunks.

        The library writes them into the open chunk only. If that chunk is damaged in a file
        without a summary, all later chunks would be undecodable.
        """
        schema, encoding = self._add_schema(topic), topic.message_encoding
        channel.number = self._writer.register_channel(
            topic.name, encoding, schema, channel.metadata
        )
        self._repeat(Channel(channel.number, topic.name, encoding, channel.metadata, schema))

    def _add_schema(self, topic: Topic) -> int:
        """Return the id of the schema, shared by the topics of a type; 0 without a type."""
        key = (topic.type, topic.schema_encoding, topic.definition)
        if not any((topic.type, topic.definition)):
            return 0
        if key not in self._schemas:
            data = topic.definition.encode()
            number = self._writer.register_schema(topic.type, topic.schema_encoding, data)
            self._repeat(Schema(number, data, topic.schema_encoding, topic.type))
            self._schemas[key] = number
        return self._schemas[key]

    def _repeat(self, record: Schema | Channel) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call] # theirs
