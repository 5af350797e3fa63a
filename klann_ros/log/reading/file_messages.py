"""The messages of one file: chunk by chunk where its index holds, or else as they stand in it."""

from __future__ import annotations

from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING

from klann_ros.log.records import Message

from .chunks import MAX_RATIO, MIN_LIMIT
from .sources import Source

if TYPE_CHECKING:
    from collections.abc import Iterator

    from klann_ros.log.records import Topic
    from mcap.records import ChunkIndex

    from .content import Content
    from .log_file import LogFile
    from .overview import Overview
    from .sources import Topics


# So much may be unpacked at once to put messages in the order of time [bytes].
_MOST_AT_ONCE = 2 * MIN_LIMIT
_SMALL = 1024 * 1024


def sources_of(file: LogFile, overview: Overview) -> Iterator[Source]:
    """Yield what can be read by itself: each chunk in the index, or all messages as one."""
    if file.summary.is_index and _can_be_merged(file):
        for chunk in file.summary.chunks:
            read = partial(_of_chunk, file, chunk)
            yield Source(chunk.message_start_time, chunk.message_end_time, read)
    elif overview.times is not None:
        yield Source(*overview.times, partial(_of_all, file))


def messages_in(
    file: LogFile, offset: int, content: Content, topics: Topics, *, by_time: bool = False
) -> Iterator[Message]:
    """Yield the messages of a chunk; those of unknown channels are noted as a problem."""
    known: dict[int, Topic | None] = {}
    for channel, sequence, log_time, publish_time, data in content.rows(by_time=by_time):
        if channel not in known:
            known[channel] = _wanted_topic(file, channel, offset, topics)
        topic = known[channel]
        if topic is not None:
            yield Message(topic, data, log_time, publish_time, sequence)


def _of_all(file: LogFile, topics: Topics) -> Iterator[Message]:
    """Yield all intact messages in the order in which they stand in the file."""
    with file.open() as stream:
        walk = file.walk(stream)
        for offset, content in walk.contents():
            yield from messages_in(file, offset, content, topics)
        file.note_losses(walk)


def _of_chunk(file: LogFile, chunk: ChunkIndex, topics: Topics) -> Iterator[Message]:
    """Yield a chunk's messages ordered by log time; none if it is damaged."""
    if not _may_hold(file, chunk, topics):
        return
    offset = chunk.chunk_start_offset
    content = file.chunk_at(offset)
    if content is None or not _is_as_said(file, chunk, content):
        return
    if content.broken:
        file.note(offset, content.broken)
    yield from messages_in(file, offset, content, topics, by_time=True)


def _can_be_merged(file: LogFile) -> bool:
    """
    Return whether the chunks that overlap in time are no more than can be unpacked at once.

    Those of a recorder follow each other, or it has as many bytes in the file.
    """
    begins = [(chunk.message_start_time, chunk.uncompressed_size) for chunk in file.summary.chunks]
    ends = [
        (chunk.message_end_time + 1, -chunk.uncompressed_size) for chunk in file.summary.chunks
    ]
    unpacked = accumulate(size for _, size in sorted(begins + ends))
    return max(unpacked, default=0) <= max(_MOST_AT_ONCE, MAX_RATIO * file.size)


def _is_as_said(file: LogFile, chunk: ChunkIndex, content: Content) -> bool:
    """Return whether a chunk may be merged with others: it is as its index says, or is small."""
    said = chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size
    size, times = len(content.data), content.times
    if (min(times, default=said[0]), max(times, default=said[1]), size) == said:
        return True
    is_small = size <= max(_SMALL, MAX_RATIO * chunk.chunk_length)
    text = 'the index is wrong about this chunk'
    file.note(chunk.chunk_start_offset, text if is_small else f'{text}, which is left out')
    return is_small


def _may_hold(file: LogFile, chunk: ChunkIndex, topics: Topics) -> bool:
    numbers = chunk.message_index_offsets
    if topics is None or not numbers:
        return True
    found = map(file.summary.channels.topic, numbers)
    return any(topic is not None and topic.name in topics for topic in found)


def _wanted_topic(file: LogFile, channel: int, offset: int, topics: Topics) -> Topic | None:
    topic = file.channels().topic(channel)
    if topic is None:
        file.note(offset, f'messages of channel {channel}, which is not known')
    elif topics is not None and topic.name not in topics:
        return None
    return topic
