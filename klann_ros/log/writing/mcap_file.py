"""One MCAP file being written: topics become schemas and channels, errors become final."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast, TYPE_CHECKING

from klann_ros.log.bag_metadata import FileSummary, HASH_KEY, QOS_KEY
from klann_ros.log.errors import UnwritableError
from klann_ros.log.qos import qos_for_writing
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, IndexType, Writer

from .durable_file import DurableFile

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from klann_ros.log.records import Attachment, Message, Topic

    from .disk_reserve import DiskReserve

COMPRESSIONS = {
    'zstd': CompressionType.ZSTD,
    'lz4': CompressionType.LZ4,
    'none': CompressionType.NONE,
}

_TIME_END = 2**64
_SEQUENCE_MASK = 2**32 - 1


@dataclass(slots=True)
class _Channel:
    number: int
    count: int = 0


class McapFile:
    """
    An MCAP file that has its header on the disk as soon as it is created.

    Parameters
    ----------
    path
        The file, which must not exist.
    compression
        A key of COMPRESSIONS.
    chunk_size
        A chunk is finished when its messages are larger [bytes].
    profile, library
        What the header says.
    reserve
        Space that the end of the file may take.

    Raises
    ------
    OSError
        The disk said no.

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
        self._kept: FileSummary | None = None
        self._start_time = self._end_time = 0
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[Topic, _Channel] = {}
        self._last_topic: Topic | None = None
        self._last_channel = _Channel(0)
        self._file = DurableFile(path, reserve)
        self._writer = Writer(
            # A file by what it can do; the library asks for write, tell and flush only.
            cast('Any', self._file),
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
            raise

    @property
    def failure(self) -> OSError | None:
        """Return the disk's first error, after which nothing can be written."""
        return self._file.failure

    def write(self, message: Message) -> None:
        """Add a message; see :meth:`klann_ros.log.writing.writer.RunWriter.write`."""
        self._file.check()
        log_time = message.log_time
        # The library would notice only after it had put half of the record into the chunk.
        if not (0 <= log_time < _TIME_END and 0 <= message.publish_time < _TIME_END):
            raise UnwritableError(
                f'{message.topic.name}: the times {log_time} ns and {message.publish_time} ns '
                'must be within 0 and 2^64 - 1 ns'
            )
        topic = message.topic
        if topic is not self._last_topic:
            # To find a topic costs as much as to write it; mostly it is the one before.
            self._last_channel = self._channels.get(topic) or self._add_channel(message)
            self._last_topic = topic
        channel = self._last_channel
        sequence = message.sequence & _SEQUENCE_MASK
        self._writer.add_message(
            channel.number, log_time, message.data, message.publish_time, sequence
        )
        channel.count += 1
        self._start_time = min(self._start_time, log_time)
        self._end_time = max(self._end_time, log_time)

    def attach(self, attachment: Attachment) -> None:
        """Add an attachment."""
        self._file.check()
        if not (0 <= attachment.log_time < _TIME_END and 0 <= attachment.create_time < _TIME_END):
            raise UnwritableError(
                f'{attachment.name}: the times {attachment.log_time} ns and '
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
        self._file.check()
        self._writer.add_metadata(name, dict(mapping))

    def flush(self) -> None:
        """Finish the chunk and bring everything to the disk."""
        self._file.check()
        self._writer.flush()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()
        self._kept = self.summary()

    def finish(self) -> None:
        """Write index, summary and footer, bring everything to the disk and close the file."""
        self._file.check()
        self._writer.finish()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()
        self._file.close()

    def abandon(self) -> None:
        """Close the file without finishing it."""
        self._file.close()

    @property
    def size(self) -> int:
        """Return its size, without what is in the chunk in progress [bytes]."""
        return self._file.tell()

    @property
    def duration(self) -> float:
        """Return the time between its earliest and its latest message [s]."""
        return (self._end_time - self._start_time) / 1e9

    def summary(self) -> FileSummary:
        """Return what the file holds so far; after a failure, what it is known to hold."""
        if self._file.failure is not None:
            return self._kept or FileSummary(self.path.name)
        # Another thread may ask, so in one go.
        channels = list(self._channels.items())
        counts = {topic: channel.count for topic, channel in channels}
        return FileSummary(self.path.name, counts, self._start_time, self._end_time)

    def _add_channel(self, message: Message) -> _Channel:
        """
        Register a topic with its first message, and repeat its schema and channel outside chunks.

        The library puts them into the chunk in progress only. Should that one rot in a file that
        was never closed, and thus has no summary, all later chunks would lose their meaning.
        """
        topic = message.topic
        metadata = dict(topic.extra)
        if topic.qos:
            metadata[QOS_KEY] = qos_for_writing(topic.qos)
        if topic.type_hash:
            metadata[HASH_KEY] = topic.type_hash
        schema = self._add_schema(topic)
        number = self._writer.register_channel(
            topic.name, topic.message_encoding, schema, metadata
        )
        self._repeat(Channel(number, topic.name, topic.message_encoding, metadata, schema))
        if not self._channels:
            self._start_time = self._end_time = message.log_time
        return self._channels.setdefault(topic, _Channel(number))

    def _add_schema(self, topic: Topic) -> int:
        """Return the id of the topic's schema, which topics of one type share; 0 for no type."""
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
