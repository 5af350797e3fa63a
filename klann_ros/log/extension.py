"""
Copy a log and append messages to the copy, at little more than the cost of copying its bytes.

A closed MCAP file is a header, data and a summary. Chunks are appended to the data, and a new
summary replaces the old one: no old message is read. A log of several files, of another format or
without such a summary is first copied message by message.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import os
from pathlib import Path
import shutil
from typing import BinaryIO

from klann_ros.cli import new_folder
from klann_ros.sanitize.text import printable
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Metadata, MetadataIndex, Schema
import numpy as np
from numpy.typing import NDArray
import zstandard

from .bag_metadata import FILE_NAME, FileSummary, metadata_record, metadata_yaml, RECORD_NAME
from .definitions import definition
from .errors import AnyPath, DamagedError, MalformedQosError, RunExistsError, UnwritableError
from .mcap.mcap_storage import McapStorage
from .mcap.records import (
    encoded,
    encoded_chunk,
    encoded_end,
    find_footer,
    parse,
    RECORD_HEAD,
    span_at,
    spans,
    SUMMARY_KINDS,
)
from .mcap.summary import read_summary, Summary
from .read.opening import open_files
from .read.storage import HEAD, spanned_time, Storage
from .records import Topic
from .recovery import check_output, recover

# Size of a chunk's messages [bytes].
_CHUNK_SIZE = 1024 * 1024
# A message is like the one before, which a hash table of 256 entries finds; searching at every
# fourth byte only takes half the time of zstd's fast level, for twice the size.
_COMPRESSION = zstandard.ZstdCompressionParameters(
    strategy=zstandard.STRATEGY_FAST, window_log=20, hash_log=8, min_match=7, target_length=8
)
# Private opcode of a record that no longer holds; every reader skips it.
_VOID = bytes([0xFF])
_MAX_NUMBER = 2**16 - 1


@dataclass(frozen=True, eq=False)
class TopicMessages:
    """Messages of one layout on a topic; several of them may have the same topic."""

    topic: Topic
    # Log times [ns], shape (n,).
    times: NDArray[np.int64]
    # A serialized message, and the numbers in it that change: by offset [bytes], shape (n, k), in
    # the type and byte order of the message.
    template: bytes
    changes: Mapping[int, NDArray[np.generic]] = field(default_factory=dict)

    @property
    def record_type(self) -> np.dtype[np.void]:
        """Return the layout of a message's record; a change is named by its offset."""
        size = len(self.template)
        fields: dict[str, tuple[object, int]] = {
            'head': (HEAD, 0),
            'message': (('u1', size), HEAD.itemsize),
        }
        for offset, numbers in self.changes.items():
            kind = numbers.dtype, numbers.shape[1:]
            fields[str(offset)] = kind, HEAD.itemsize + offset
        formats, offsets = zip(*fields.values(), strict=True)
        return np.dtype(
            {
                'names': list(fields),
                'formats': formats,
                'offsets': offsets,
                'itemsize': HEAD.itemsize + size,
            }
        )


def extend(log: AnyPath, output: AnyPath, messages: Sequence[TopicMessages]) -> None:
    """
    Write a copy of a log with further messages, as a run's folder with one MCAP file.

    The folder appears when the copy is complete, never before; the log, in any state, is not
    changed. The messages are on topics that it does not have, or it is an UnwritableError, as is
    an output inside it. A NotALogError means that nothing in it can be read, a RunExistsError that
    the output exists, an OSError that the disk refused.
    """
    run = Path(output).absolute()
    check_output(log, run)
    if os.path.lexists(run):
        raise RunExistsError(output)
    files, log_files = open_files(log)
    try:
        run.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(run) as folder:
            target = folder / f'{folder.name}_0.mcap'
            is_whole = len(files) == 1 and not log_files.missing
            if not (is_whole and _extend_copy(files[0], target, messages)):
                recover(log, folder)
                _extend_run(target, messages)
    finally:
        for file in files:
            file.close()


def _extend_copy(file: Storage, target: Path, messages: Sequence[TopicMessages]) -> bool:
    """Copy a file and extend the copy; return whether that was possible."""
    if file.problems or not (isinstance(file, McapStorage) and _can_extend(file.summary)):
        return False
    target.parent.mkdir()
    shutil.copyfile(file.plain_path, target)
    try:
        _extend_run(target, messages)
    except (DamagedError, MalformedQosError):
        # A recovery leaves out malformed records, and makes the folder.
        shutil.rmtree(target.parent)
        return False
    return True


def _can_extend(summary: Summary) -> bool:
    """Return whether a summary names everything in its file, with the number of messages."""
    statistics = summary.statistics
    return (
        statistics is not None
        and summary.is_index
        and sum(statistics.channel_message_counts.values()) == statistics.message_count
    )


def _extend_run(path: Path, messages: Sequence[TopicMessages]) -> None:
    with path.open('r+b') as file:
        content = _Extension(file, path.name).run(messages)
    path.with_name(FILE_NAME).write_text(metadata_yaml([content]), encoding='utf-8')


class _Extension:
    """Append messages to an open file that is closed and has a summary."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file = file
        self._name = name
        footer = find_footer(file, file.seek(0, 2))
        self._summary = Summary() if footer is None else read_summary(file, footer)
        if footer is None or self._summary.statistics is None:
            raise DamagedError('there is no summary', 0)
        self._data_end = self._summary.start - len(encoded(DataEnd(0)))
        if span_at(file, self._data_end, self._summary.start).opcode != Opcode.DATA_END:
            raise DamagedError('the summary does not follow the data', self._data_end)
        self._statistics = self._summary.statistics
        # The records of the summary by their kind.
        self._groups: dict[int, list[bytes]] = {opcode: [] for opcode in SUMMARY_KINDS}
        for span in spans(file, footer.summary_start, footer.offset):
            file.seek(span.offset)
            if span.opcode in self._groups:
                self._groups[span.opcode].append(file.read(span.end - span.offset))
        # Numbers of the new channels.
        self._channels: dict[Topic, int] = {}
        self._compressor = zstandard.ZstdCompressor(compression_params=_COMPRESSION)

    def run(self, messages: Sequence[TopicMessages]) -> FileSummary:
        """Append the messages; return the content of the file."""
        definitions = self._register(messages)
        content = self._count(messages)
        # An error of the metadata leaves the file as it was.
        metadata = encoded(Metadata(RECORD_NAME, metadata_record([content])))
        self._void_metadata()
        self._file.seek(self._data_end)
        self._file.truncate()
        self._file.write(definitions)
        for topic_messages in messages:
            self._append(topic_messages)
        index = MetadataIndex(self._file.tell(), len(metadata), RECORD_NAME)
        self._groups[Opcode.METADATA_INDEX].append(encoded(index))
        self._file.write(metadata + encoded(DataEnd(0)))
        counts = self._statistics.channel_message_counts
        times = content.start_time, content.end_time
        self._file.write(encoded_end(self._file.tell(), self._groups, counts, times))
        return content

    def _register(self, messages: Sequence[TopicMessages]) -> bytes:
        """Assign numbers behind the file's own; return the schemas and channels."""
        old_topics = self._summary.channels.topics().values()
        names = {topic.name for topic in old_topics}
        # A type has one definition in the log: its own where it has the type already.
        definitions = {t.type: t.definition for t in old_topics if t.message_encoding == 'cdr'}
        number_bytes = slice(RECORD_HEAD.size, RECORD_HEAD.size + 2)
        records = self._groups[Opcode.SCHEMA]
        schema_numbers = [int.from_bytes(record[number_bytes], 'little') for record in records]
        number = max((*self._summary.channels.numbers(), *schema_numbers), default=0)
        schemas = b''
        channels = b''
        for topic in dict.fromkeys(topic_messages.topic for topic_messages in messages):
            if topic.name in names:
                raise UnwritableError(f'{printable(topic.name)} is in the log already')
            number += 1
            if number > _MAX_NUMBER:
                raise UnwritableError('the log has too many topics')
            self._channels[topic] = number
            text = definitions.get(topic.type)
            text = definition(topic.type) if text is None else text
            schema = encoded(Schema(number, text.encode(), topic.schema_encoding, topic.type))
            extra = dict(topic.extra)
            channel = encoded(
                Channel(number, topic.name, topic.message_encoding, extra, schema_id=number)
            )
            self._groups[Opcode.SCHEMA].append(schema)
            self._groups[Opcode.CHANNEL].append(channel)
            schemas += schema
            channels += channel
        return schemas + channels

    def _count(self, messages: Sequence[TopicMessages]) -> FileSummary:
        """Add the messages to the statistics; return the content of the file with them."""
        statistics = self._statistics
        channel_counts = statistics.channel_message_counts
        times: list[tuple[int, int] | None] = []
        if statistics.message_count:
            times.append((statistics.message_start_time, statistics.message_end_time))
        topics = self._summary.channels.topics()
        for topic_messages in messages:
            number = self._channels[topic_messages.topic]
            topics[number] = topic_messages.topic
            added_times = topic_messages.times
            channel_counts[number] = channel_counts.get(number, 0) + len(added_times)
            if len(added_times):
                times.append((int(added_times.min()), int(added_times.max())))
        counts: dict[Topic, int] = {}
        for number, count in channel_counts.items():
            topic = topics.get(number)
            if topic is not None:
                counts[topic] = counts.get(topic, 0) + count
        return FileSummary(self._name, counts, *(spanned_time(times) or (0, 0)))

    def _void_metadata(self) -> None:
        """Make rosbag2's old record a private one, which readers skip, and forget its index."""
        other_records = []
        for record in self._groups[Opcode.METADATA_INDEX]:
            index = parse(MetadataIndex, record[slice(RECORD_HEAD.size, None)])
            if index.name == RECORD_NAME:
                self._file.seek(index.offset)
                self._file.write(_VOID)
            else:
                other_records.append(record)
        self._groups[Opcode.METADATA_INDEX] = other_records

    def _append(self, messages: TopicMessages) -> None:
        """Append messages in chunks; their records are made in one array, used again."""
        channel = self._channels[messages.topic]
        count = len(messages.times)
        record_type = messages.record_type
        size = max(1, min(count, _CHUNK_SIZE // record_type.itemsize))
        records = np.empty(size, record_type)
        records['head']['opcode'] = Opcode.MESSAGE
        records['head']['channel'] = channel
        records['head']['length'] = record_type.itemsize - RECORD_HEAD.size
        records['message'] = np.frombuffer(messages.template, np.uint8)
        # Log time and offset of each message of a chunk.
        index = np.empty((size, 2), '<u8')
        index[:, 1] = record_type.itemsize * np.arange(size)
        for begin in range(0, count, size):
            end = min(begin + size, count)
            times = messages.times[begin:end]
            chunk = records[: end - begin]
            chunk_index = index[: end - begin]
            chunk_index[:, 0] = times
            chunk['head']['log_time'] = times
            chunk['head']['publish_time'] = times
            chunk['head']['sequence'] = np.arange(begin, end) + 1
            for offset, numbers in messages.changes.items():
                chunk[str(offset)] = numbers[begin:end]
            data = chunk.view(np.uint8).data
            compression = 'zstd', self._compressor.compress(data)
            spanned = int(times.min()), int(times.max())
            entries = {channel: chunk_index.tobytes()}
            start = self._file.tell()
            packed, indexes, entry = encoded_chunk(start, data, compression, spanned, entries)
            self._file.writelines((packed, indexes))
            self._groups[Opcode.CHUNK_INDEX].append(encoded(entry))
