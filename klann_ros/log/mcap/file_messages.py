"""The messages of one file: chunk by chunk where its index holds, or else in a single pass."""

from collections import Counter
from collections.abc import Iterator
from functools import partial
import heapq
from itertools import accumulate
from typing import TypeAlias

from klann_ros.log.read.block import block_of, MessageBlock
from klann_ros.log.read.sources import Source, Topics
from klann_ros.log.read.storage import Overview
from klann_ros.log.records import Message, Topic
from klann_ros.sanitize.text import counted, verb
from mcap.records import ChunkIndex
import numpy as np

from .content import Content
from .decompression import MAX_RATIO, MIN_LIMIT
from .log_file import LogFile
from .summary import Summary

# How many messages a chunk holds, and their first and last log time [ns].
Held: TypeAlias = tuple[int, int, int]

# So much may be unpacked at once to put messages in the order of time [bytes].
_MOST_AT_ONCE = 2 * MIN_LIMIT
_SMALL = 1024 * 1024
# What a message takes that waits for earlier ones, beside its data [bytes].
_WAITING_COST = 200
_END_OF_TIME = 2**64


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
    """
    Yield all intact messages ordered by log time, found without an index.

    A message waits in a heap until no later part of the file starts before it. What waits is
    bounded: beyond that the earliest is yielded, though an earlier one follows.
    """
    bounds, number = file.later_starts(), 0
    waiting: list[tuple[int, int, Message]] = []
    # Two of the largest parts fit, as where they are merged by an index.
    size, limit = 0, max(MIN_LIMIT, MAX_RATIO * file.size, 2 * file.largest_content())
    with file.open() as stream:
        walk = file.walk(stream)
        for position, (offset, content) in enumerate(walk.contents()):
            bound = bounds[position] if position < len(bounds) else _END_OF_TIME
            for message in messages_in(file, offset, content, topics, by_time=True):
                if not waiting and message.log_time <= bound:
                    yield message
                    continue
                number += 1
                size += len(message.data) + _WAITING_COST
                heapq.heappush(waiting, (message.log_time, number, message))
            while waiting and (waiting[0][0] <= bound or size > limit):
                *_, message = heapq.heappop(waiting)
                size -= len(message.data) + _WAITING_COST
                yield message
        file.note_losses(walk)
    while waiting:
        *_, message = heapq.heappop(waiting)
        yield message


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

    Those of a recorder follow each other, or it has as many bytes in the file. Two of the largest
    chunks always fit: each is held to the decompression limit by itself.
    """
    begins = [(chunk.message_start_time, chunk.uncompressed_size) for chunk in file.summary.chunks]
    ends = [
        (chunk.message_end_time + 1, -chunk.uncompressed_size) for chunk in file.summary.chunks
    ]
    unpacked = accumulate(size for _, size in sorted(begins + ends))
    largest = max((chunk.uncompressed_size for chunk in file.summary.chunks), default=0)
    allowed = max(_MOST_AT_ONCE, MAX_RATIO * file.size, 2 * largest)
    return max(unpacked, default=0) <= allowed


def _is_as_said(file: LogFile, chunk: ChunkIndex, content: Content) -> bool:
    """Return whether a chunk may be merged with others: it is as its index says, or is small."""
    said = chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size
    size, times = len(content.data), content.times()
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


def blocks_of(file: LogFile) -> Iterator[tuple[int, MessageBlock]]:
    """Yield all messages chunk by chunk as they stand in the file, and how far that is."""
    channels, count = file.channels(), _Count()
    topics = {number: channels.topic(number) for number in channels.numbers()}
    known = {number: topic for number, topic in topics.items() if topic is not None}
    with file.open() as stream:
        walk = file.walk(stream)
        for offset, content in walk.contents():
            block = block_of(content, known)
            for number in sorted(count.add(offset, block) - known.keys()):
                file.note(offset, f'messages of channel {number}, which is not known')
            yield offset, block
        file.note_losses(walk)
    wrong = '; '.join(count.disagreements(file.summary))
    # What is damaged is not there, and nobody can count it.
    if wrong and not len(walk.losses):
        file.note(file.size, wrong)


class _Count:
    """Counts what is in a file, to be held against its summary."""

    def __init__(self) -> None:
        self._chunks: dict[int, Held] = {}
        self._messages: Counter[int] = Counter()

    def add(self, offset: int, block: MessageBlock) -> set[int]:
        """Count the messages of the chunk or message at an offset; return their channels."""
        counts = np.bincount(block.heads['channel'])
        channels = np.flatnonzero(counts)
        self._messages.update(dict(zip(channels.tolist(), counts[channels].tolist(), strict=True)))
        times = block.heads['log_time']
        held = (len(times), int(times.min()), int(times.max())) if len(times) else (0, 0, 0)
        self._chunks[offset] = held
        return set(channels.tolist())

    def disagreements(self, summary: Summary) -> Iterator[str]:
        """Yield what a summary says otherwise, one line each; nothing for what it leaves out."""
        said = summary.statistics
        if said is not None:
            total = self._messages.total()
            if said.message_count != total:
                count = counted(said.message_count, 'message')
                yield f'the statistics count {count}, there {verb(total, "is", "are")} {total}'
            elif said.channel_message_counts and +Counter(said.channel_message_counts) != +(
                self._messages
            ):
                yield 'the statistics count other messages for each channel than there are'
        index = {
            chunk.chunk_start_offset: (chunk.message_start_time, chunk.message_end_time)
            for chunk in summary.chunks
        }
        wrong = sum(self._is_wrong(offset, times) for offset, times in index.items())
        missing = sum(self._chunks[offset][0] for offset in self._chunks.keys() - index.keys())
        if wrong:
            yield f'the index is wrong about {counted(wrong, "chunk")}'
        if index and missing:
            yield f'the index leaves out {counted(missing, "message")}'

    def _is_wrong(self, offset: int, times: tuple[int, int]) -> bool:
        held = self._chunks.get(offset)
        return held is None or (held[0] > 0 and held[1:] != times)
