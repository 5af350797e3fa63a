"""One MCAP file of any recorder and in any state, as a storage."""

from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
import heapq
from itertools import accumulate
from pathlib import Path
from typing import BinaryIO, TypeVar

from klann_ros.log.errors import DamagedError, NotALogError
from klann_ros.log.read.block import block_of, MessageBlock
from klann_ros.log.read.storage import Overview, Problems, Source, Topics
from klann_ros.log.read.temporary import TemporaryFile
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import counted, printable, verb
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Header, Metadata
import numpy as np
from numpy.typing import NDArray

from .channels import Channels
from .content import chunk_content, Content
from .decompression import DecompressionBudget, MAX_RATIO, MIN_LIMIT
from .record_check import RecordCheck
from .records import (
    find_footer,
    MAGIC,
    parse,
    parse_attachment,
    read,
    span_at,
)
from .recovery import gaps, RecordScan
from .summary import ContentCount, read_summary, Summary

Parsed = TypeVar('Parsed')

# A log time later than any.
_NEVER = 2**64
_START = MAGIC + bytes([Opcode.HEADER])
# A chunk of this size may be merged with others whatever its index says [bytes].
_SMALL_CHUNK = 1024 * 1024
# Memory of a message that waits for earlier ones, beside its data [bytes].
_WAITING_COST = 200


@dataclass(frozen=True)
class _Survey:
    """What a pass over the whole file finds."""

    overview: Overview
    # By channel.
    topics: dict[int, Topic]
    # For each part of a pass the earliest log time in all later parts [ns].
    later_starts: NDArray[np.uint64]
    # Size of the largest part [bytes].
    largest: int


class McapStorage:
    """
    An MCAP file; see :class:`~klann_ros.log.read.storage.Storage`.

    Messages are read chunk by chunk where the index is valid, otherwise in one pass over the
    records. Raises a NotALogError if it is no MCAP file, or cannot be opened.
    """

    def __init__(self, path: Path, unpacked: TemporaryFile | None = None) -> None:
        self.path = path
        self.name = printable(path.name) + (' (unpacked)' if unpacked else '')
        self._unpacked = unpacked
        self.problems = Problems()
        self.gaps: set[tuple[int, int]] = set()
        self.remarks: list[str] = []
        self.summary = Summary()
        self.profile = ''
        self._budget = DecompressionBudget()
        # Offsets of chunks that are not unpacked again.
        self._damaged: set[int] = set()
        try:
            with self.open() as file:
                self._read_ends(file)
        except OSError as error:
            raise NotALogError(path, error.strerror or str(error)) from None
        except DamagedError as damage:
            self.note(damage.offset, f'the summary is damaged: {damage.reason}')
            self.summary = Summary()

    def _read_ends(self, file: BinaryIO) -> None:
        """Read the start, the footer and the summary."""
        self.size = file.seek(0, 2)
        file.seek(0)
        start = file.read(len(_START))
        if start != _START:
            self._check_start(start, file)
        self.profile = self._read_profile(file)
        footer = find_footer(file, self.size)
        self.closed = footer is not None
        self._end = self.size if footer is None else footer.offset
        if footer is None:
            self.note(self.size, 'it was not closed: there is no footer at its end')
            return
        self.summary = read_summary(file, footer)
        if not self.summary.is_sound:
            text = 'the index is wrong: what it names is not one behind the other'
            self.note(self.summary.start, text)
            self.summary.discard_entries()

    def _check_start(self, start: bytes, file: BinaryIO) -> None:
        """Refuse a file that is no log; one with a damaged start has sound chunks in it."""
        check = RecordCheck(file, self.size, self._budget)
        if check.find_chunk(0, self.size) is not None:
            self.note(0, 'its first bytes are not those of an MCAP file')
            return
        if not start:
            raise NotALogError(self.path, 'the file is empty')
        if not start.startswith(MAGIC):
            raise NotALogError(self.path, 'it does not start as an MCAP file does')
        raise NotALogError(self.path, 'there is no header at its start')

    def _read_profile(self, file: BinaryIO) -> str:
        try:
            span = span_at(file, len(MAGIC), self.size)
            return parse(Header, read(file, span)).profile if span.opcode == Opcode.HEADER else ''
        except DamagedError as damage:
            self.note(len(MAGIC), f'the header is damaged: {damage.reason}')
            return ''

    def open(self) -> BinaryIO:  # noqa: A003, RUF100 - as a path calls it; ruff lets it be
        """Open the file, or its unpacked copy."""
        return open_regular(self.plain_path)

    @property
    def plain_path(self) -> Path:
        """Return its path, or that of its unpacked copy."""
        return self._unpacked.path if self._unpacked else self.path

    def close(self) -> None:
        """Remove the unpacked copy."""
        if self._unpacked is not None:
            self._unpacked.close()

    def note(self, offset: int, text: str) -> None:
        """Note a problem at an offset [bytes]."""
        self.problems.note(offset, text)

    def scan(self, file: BinaryIO, channels: Channels | None = None) -> RecordScan:
        """Return a pass over the open file, which adds to the channels."""
        end = self.summary.start if self.summary.is_index else self._end
        return RecordScan(file, end, channels or Channels(), summary=self.summary)

    def _note_losses(self, scan: RecordScan) -> None:
        for loss in scan.losses:
            self.problems.note(loss.offset, str(loss), is_loss=True)
        for problem in scan.problems:
            self.note(problem.offset, problem.text)
        with self.open() as file:
            self.gaps.update(gaps(file, scan.losses, self.summary.chunks))

    def overview(self) -> Overview:
        """Return the content by the index, or by a pass over the whole file."""
        summary = self.summary
        if summary.is_index and summary.statistics is not None:
            statistics = summary.statistics
            times = (statistics.message_start_time, statistics.message_end_time)
            return Overview(
                list(summary.channels.topics().values()),
                times if statistics.message_count else None,
                summary.metadata,
                summary.attachments,
            )
        return self._survey.overview

    @cached_property
    def _survey(self) -> _Survey:
        """Make a pass over the whole file: a channel record may follow its messages."""
        channels = self.summary.channels
        last, largest = -1, 0
        starts = array('Q')
        with self.open() as file:
            scan = self.scan(file, channels)
            for _, content in scan.contents():
                largest = max(largest, len(content.data))
                times = block_of(content, {}).heads['log_time']
                starts.append(int(times.min()) if len(times) else _NEVER - 1)
                last = max(last, int(times.max()) if len(times) else last)
            self._note_losses(scan)
        for text in channels.contradictions:
            self.problems.note_whole(text)
        topics = channels.topics()
        overview = Overview(
            list(topics.values()),
            (min(starts), last) if last >= 0 else None,
            [span.offset for span in scan.metadata],
            [span.offset for span in scan.attachments],
        )
        ends = np.array([*starts, _NEVER - 1], dtype=np.uint64)
        return _Survey(overview, topics, np.minimum.accumulate(ends[::-1])[::-1][1:], largest)

    @cached_property
    def _topics(self) -> dict[int, Topic]:
        """Return the known topics of the whole file by channel."""
        # Chunks with a CRC may contradict a summary without one.
        is_trusted = self.summary.is_index and self.summary.verified
        return self.summary.channels.topics() if is_trusted else self._survey.topics

    def _parsed_at(
        self, offset: int, opcode: Opcode, parse_one: Callable[[bytes, int], Parsed]
    ) -> Parsed | None:
        """Return a record; None, and a problem, if it is not there or damaged."""
        try:
            with self.open() as file:
                end = self.summary.entry(offset).end or self._end
                span = span_at(file, offset, min(end, self._end))
                if span.opcode == opcode:
                    return parse_one(read(file, span), offset)
                reason = f'the index is wrong: no {opcode.name.lower()} stands there'
        except DamagedError as damage:
            reason = damage.reason
        # The index may be wrong about a chunk that a pass over the records finds.
        self.problems.note(offset, reason, is_loss=opcode != Opcode.CHUNK)
        return None

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """Return the name and content of a metadata record; None if it is damaged."""
        record = self._parsed_at(offset, Opcode.METADATA, partial(parse, Metadata))
        return None if record is None else (record.name, record.metadata)

    def attachment_at(self, offset: int) -> Attachment | None:
        """Return an attachment; None if it is damaged."""
        return self._parsed_at(offset, Opcode.ATTACHMENT, parse_attachment)

    def _chunk_at(self, offset: int) -> Content | None:
        """Return the content of an indexed chunk; None, and a problem, if it is damaged."""
        if offset in self._damaged:
            return None
        content = self._parsed_at(
            offset, Opcode.CHUNK, lambda record, at: chunk_content(record, at, self._budget)
        )
        if content is None:
            self._damaged.add(offset)
        return content

    def first_data(self) -> bytes:
        """Return the data of the first message in the file; b'' if there is none."""
        with self.open() as file:
            for _, content in self.scan(file).contents():
                if len(content):
                    return block_of(content, {}).message(0)
        return b''

    def sources(self, overview: Overview) -> Iterator[Source]:
        """Yield each chunk of the index, or all messages as one."""
        if self.summary.is_index and self._can_merge_chunks():
            for chunk in self.summary.chunks:
                read_messages = partial(self._chunk_messages, chunk)
                yield Source(chunk.message_start_time, chunk.message_end_time, read_messages)
        elif overview.times is not None:
            yield Source(*overview.times, self._all_messages)

    def _by_time(self, offset: int, block: MessageBlock, names: Topics) -> Iterator[Message]:
        """Yield the messages of a chunk; unknown channels are noted as a problem."""
        for number in sorted(block.channels - self._topics.keys()):
            self.note(offset, f'messages of channel {number}, which is not known')
        return block.messages(names, by_time=True)

    def _can_merge_chunks(self) -> bool:
        """
        Return whether the chunks that overlap in time may be unpacked at once.

        Those of a recorder follow each other, or it has as many bytes in the file. Two of the
        largest chunks always fit: each is held to the decompression limit by itself.
        """
        chunks = self.summary.chunks
        begins = [(chunk.message_start_time, chunk.uncompressed_size) for chunk in chunks]
        ends = [(chunk.message_end_time + 1, -chunk.uncompressed_size) for chunk in chunks]
        unpacked = accumulate(size for _, size in sorted(begins + ends))
        largest = max((chunk.uncompressed_size for chunk in chunks), default=0)
        return max(unpacked, default=0) <= max(2 * MIN_LIMIT, MAX_RATIO * self.size, 2 * largest)

    def _chunk_messages(self, chunk: ChunkIndex, topics: Topics) -> Iterator[Message]:
        """Yield a chunk's messages ordered by log time; none if it is damaged."""
        numbers, offset = chunk.message_index_offsets, chunk.chunk_start_offset
        if topics is not None and numbers:
            found = map(self._topics.get, numbers)
            if not any(topic is not None and topic.name in topics for topic in found):
                return
        content = self._chunk_at(offset)
        if content is None:
            return
        block = block_of(content, self._topics)
        if not self._may_merge(chunk, block):
            return
        if content.broken:
            self.note(offset, content.broken)
        yield from self._by_time(offset, block, topics)

    def _may_merge(self, chunk: ChunkIndex, block: MessageBlock) -> bool:
        """Return whether a chunk is as its index says, or is small."""
        expected = chunk.message_start_time, chunk.message_end_time
        size, times = len(block.data), block.heads['log_time']
        ends = (int(times.min()), int(times.max())) if len(times) else expected
        if (*ends, size) == (*expected, chunk.uncompressed_size):
            return True
        is_small = size <= max(_SMALL_CHUNK, MAX_RATIO * chunk.chunk_length)
        text = 'the index is wrong about this chunk'
        self.note(chunk.chunk_start_offset, text if is_small else f'{text}, which is left out')
        return is_small

    def _all_messages(self, topics: Topics) -> Iterator[Message]:
        """
        Yield all intact messages ordered by log time, found without an index.

        A message waits in a heap until no later part of the file starts before it. The heap is
        bounded: beyond that the earliest is yielded, though an earlier one follows.
        """
        bounds, number = self._survey.later_starts, 0
        waiting: list[tuple[int, int, Message]] = []
        # Two of the largest parts fit, as where they are merged by an index.
        size, limit = 0, max(MIN_LIMIT, MAX_RATIO * self.size, 2 * self._survey.largest)
        with self.open() as file:
            scan = self.scan(file)
            for position, (offset, content) in enumerate(scan.contents()):
                bound = int(bounds[position]) if position < len(bounds) else _NEVER
                block = block_of(content, self._topics)
                for message in self._by_time(offset, block, topics):
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
            self._note_losses(scan)
        while waiting:
            yield heapq.heappop(waiting)[2]

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages chunk by chunk in the order of the file, with their offsets."""
        known, count = self._topics, ContentCount()
        others = unverified = 0
        with self.open() as file:
            scan = self.scan(file)
            for offset, content in scan.contents():
                block = block_of(content, known)
                count.add(offset, block)
                others += content.unknown
                unverified += 0 if content.verified else len(content)
                yield offset, block
            self._note_losses(scan)
        unknown = sum(n for number, n in count.messages.items() if number not in known)
        if unknown:
            what = f'{counted(unknown, "message")} of topics whose description is lost'
            self.problems.note_whole(what, is_loss=True)
        # The messages of damaged chunks cannot be counted.
        if not scan.losses:
            for text, is_loss in count.disagreements(self.summary):
                self.problems.note_whole(text, is_loss=is_loss)
        self.remarks[:] = _remarks(scan, others + scan.unknown, 0 if scan.verified else unverified)


def _remarks(scan: RecordScan, others: int, unverified: int) -> Iterator[str]:
    """Yield remarks on a pass, given the records of unknown kinds and messages without a CRC."""
    yield from scan.remarks
    if others:
        yield (
            f'{counted(others, "record")} of kinds that are private, or of a later version of '
            f'MCAP, {verb(others, "is", "are")} left out'
        )
    if unverified:
        have = verb(unverified, 'message has', 'messages have')
        yield f'{unverified} {have} no CRC, so damage in them is unknown'
