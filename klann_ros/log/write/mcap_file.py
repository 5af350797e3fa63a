"""One MCAP file being written: topics become schemas and channels, errors become final."""

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

from klann_ros.log.bag_metadata import FileSummary, HASH_KEY, QOS_KEY
from klann_ros.log.errors import UnwritableError
from klann_ros.log.qos import qos_for_writing
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.text import printable
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, IndexType, Writer

from .disk_space import DiskReserve
from .durable_file import DurableFile, NotedFile
from .file_watch import FileWatch
from .open_folder import OpenFolder

COMPRESSIONS = {
    'zstd': CompressionType.ZSTD,
    'lz4': CompressionType.LZ4,
    'none': CompressionType.NONE,
}

_TIME_END = 2**64
_SEQUENCE_MASK = 2**32 - 1


@dataclass(slots=True)
class _Channel:
    metadata: dict[str, str]
    number: int = 0  # none yet
    count: int = 0


class McapFile:
    """
    An MCAP file that has its header on the disk as soon as it is created.

    Parameters
    ----------
    folder, name
        Where it is, and how it is called, which nothing may be yet.
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
        folder: OpenFolder,
        name: str,
        *,
        compression: str,
        chunk_size: int,
        profile: str,
        library: str,
        reserve: DiskReserve | None = None,
    ) -> None:
        self.name = name
        self._start_time = self._end_time = 0
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[Topic, _Channel] = {}
        self._last_topic: Topic | None = None
        self._last_channel = _Channel({})
        self._file = DurableFile(folder, name, reserve)
        self._noted = NotedFile(self._file, self._taken)
        self._writer = Writer(
            # A file by what it can do; the library asks for write, tell and flush only.
            cast('Any', self._noted),
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
            self._file.flush()
            self.watch.begin()
            self._file.sync()
        except BaseException:
            self._file.close()
            # Half a header is no file.
            with suppress(OSError):
                folder.remove(name)
            raise

    @property
    def watch(self) -> FileWatch:
        """Return what looks at the file."""
        return self._file.watch

    @property
    def failure(self) -> OSError | None:
        """Return the disk's first error, after which nothing can be written."""
        return self._file.failure

    def write(self, message: Message) -> None:
        """Add a message; see :meth:`klann_ros.log.write.writer.RunWriter.write`."""
        self._file.check()
        log_time = message.log_time
        # The library would notice only after it had put half of the record into the chunk.
        if not (0 <= log_time < _TIME_END and 0 <= message.publish_time < _TIME_END):
            raise UnwritableError(
                f'{printable(message.topic.name)}: the times {log_time} ns and '
                f'{message.publish_time} ns must be within 0 and 2^64 - 1 ns'
            )
        topic = message.topic
        if topic is not self._last_topic:
            # To find a topic costs as much as to write it; mostly it is the one before.
            self._last_channel = self._channels.get(topic) or self._add_channel(message)
            self._last_topic = topic
        channel = self._last_channel
        # From here on it is this file's, whatever the disk says.
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
        self._file.check()
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
        self._file.check()
        self._writer.add_metadata(name, dict(mapping))

    def flush(self) -> None:
        """Finish the chunk and bring everything to the disk."""
        self._file.check()
        self._writer.flush()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()

    def finish(self) -> None:
        """Write index, summary and footer, and bring everything to the disk."""
        self._file.check()
        self._writer.finish()  # type: ignore[no-untyped-call] # theirs
        self._file.sync()

    def close(self) -> None:
        """Close the file, finished or not. Never raises."""
        self._file.close()

    @property
    def size(self) -> int:
        """Return its size, without what is in the chunk in progress [bytes]."""
        return self._file.tell()

    @property
    def message_count(self) -> int:
        """Return how many messages it was given."""
        return self._taken().message_count

    @property
    def duration(self) -> float:
        """Return the time between its earliest and its latest message [s]."""
        return (self._end_time - self._start_time) / 1e9

    def summary(self) -> FileSummary:
        """Return what the file holds so far; after a failure, what it is known to hold."""
        return self.fate()[0]

    def fate(self) -> tuple[FileSummary, Counter[Topic]]:
        """Return what the file holds so far, and which messages it was given beside that."""
        taken = self._taken()
        if self._file.failure is None:
            return taken, Counter()
        kept = self._noted.kept()
        return kept, Counter(taken.counts) - Counter(kept.counts)

    def _taken(self) -> FileSummary:
        # Another thread may ask, so in one go.
        channels = list(self._channels.items())
        counts = {topic: channel.count for topic, channel in channels}
        return FileSummary(self.name, counts, self._start_time, self._end_time)

    def _add_channel(self, message: Message) -> _Channel:
        """Return an unwritten channel for a new topic; a MalformedQosError if its QoS is one."""
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

        The library puts them into the chunk in progress only. Should that one rot in a file that
        was never closed, and thus has no summary, all later chunks would lose their meaning.
        """
        schema, encoding = self._add_schema(topic), topic.message_encoding
        channel.number = self._writer.register_channel(
            topic.name, encoding, schema, channel.metadata
        )
        self._repeat(Channel(channel.number, topic.name, encoding, channel.metadata, schema))

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
