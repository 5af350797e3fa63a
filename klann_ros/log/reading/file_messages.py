"""The messages of one file: chunk by chunk where its index holds, or else as they stand in it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Message
from mcap.opcode import Opcode

from .chunks import chunk_content
from .sources import Source

if TYPE_CHECKING:
    from collections.abc import Iterator

    from klann_ros.log.records import Topic
    from mcap.records import ChunkIndex

    from .content import Content
    from .log_file import LogFile
    from .overview import Overview
    from .sources import Topics


def sources_of(file: LogFile, overview: Overview) -> Iterator[Source]:
    """Yield what can be read by itself: each chunk in the index, or all messages as one."""
    if file.summary.is_index:
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
    with file.path.open('rb') as stream:
        walk = file.walk(stream)
        for offset, content in walk.contents():
            yield from messages_in(file, offset, content, topics)
        file.note_losses(walk)


def _of_chunk(file: LogFile, chunk: ChunkIndex, topics: Topics) -> Iterator[Message]:
    """Yield a chunk's messages ordered by log time; none if it is damaged."""
    if not _may_hold(file, chunk, topics):
        return
    offset = chunk.chunk_start_offset
    record = file.content_at(offset, Opcode.CHUNK)
    if record is None:
        return
    try:
        content = chunk_content(record, offset)
    except DamagedError as damage:
        file.note(offset, damage.reason)
        return
    if content.broken:
        file.note(offset, content.broken)
    yield from messages_in(file, offset, content, topics, by_time=True)


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
