"""One MCAP file of any recorder and in any state, as a storage."""

from array import array
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
import heapq
from itertools import accumulate, chain
from operator import attrgetter
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from klann_ros.log.errors import DamagedError, NotALogError
from klann_ros.log.read.storage import (
    MessageBlock,
    Overview,
    Problems,
    Source,
    spanned_time,
    storage_name,
    TemporaryFile,
    Topics,
)
from klann_ros.log.records import Attachment, Message, Topic
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import counted, verb
from mcap.opcode import Opcode
from mcap.records import Metadata

from . import records
from .content import chunk_content, Content, content_of
from .decompression import DecompressionBudget, MAX_RATIO, MIN_LIMIT
from .record_check import RecordCheck
from .recovery import gaps, RecordScan, ScanReport
from .summary import Channels, ContentCount, read_summary, Summary

Parsed = TypeVar('Parsed')

_START = records.MAGIC + bytes([Opcode.HEADER])
# A chunk of this size may be merged with others whatever its index says; smaller ones without an
# index are read together [bytes].
_SMALL_CHUNK = 1024 * 1024


class _Batch(NamedTuple):
    """Messages that are read together: a chunk of the index, or what a pass found in a row."""

    # Unpacked [bytes].
    size: int
    # The first and the last log time [ns].
    start: int
    end: int
    # Opcode, offset and length of each place in turn.
    spans: 'array[int]'
    # The channels of the messages; none if unknown.
    channels: Collection[int] = ()

    def extended(self, addition: '_Batch') -> '_Batch':
        """Return the batch with the messages behind it."""
        start = min(self.start, addition.start)
        end = max(self.end, addition.end)
        self.spans.extend(addition.spans)
        return _Batch(self.size + addition.size, start, end, self.spans)


@dataclass(frozen=True)
class _Survey:
    """What a pass over the whole file finds."""

    # The topic of each channel.
    topics: dict[int, Topic]
    batches: list[_Batch]
    report: ScanReport


class McapStorage:
    """
    An MCAP file; see :class:`~klann_ros.log.read.storage.Storage`.

    Messages are read chunk by chunk where the index is valid, otherwise in one pass over the
    records. Raises a NotALogError if it is no MCAP file, or cannot be opened.
    """

    def __init__(self, path: Path, unpacked: TemporaryFile | None = None) -> None:
        self.path = path
        self.name = storage_name(path, unpacked)
        self._unpacked = unpacked
        self.problems = Problems()
        self.gaps: set[tuple[int, int]] = set()
        self.remarks: list[str] = []
        self.summary = Summary()
        self._budget = DecompressionBudget()
        try:
            with self.open() as file:
                self._read_ends(file)
        except OSError as error:
            raise NotALogError(path, error.strerror or str(error)) from None
        except DamagedError as damage:
            self.problems.note(damage.offset, f'the summary is damaged: {damage.reason}')
            self.summary = Summary()

    def _read_ends(self, file: BinaryIO) -> None:
        """Read the start, the footer and the summary."""
        self.size = file.seek(0, 2)
        file.seek(0)
        start = file.read(len(_START))
        if start != _START:
            self._check_start(start, file)
        footer = records.find_footer(file, self.size)
        self.closed = footer is not None
        self._end = self.size if footer is None else footer.offset
        if footer is None:
            self.problems.note(self.size, 'it was not closed: there is no footer at its end')
            return
        self.summary = read_summary(file, footer)
        if not self.summary.is_sound:
            text = 'the index is wrong: what it names is not one behind the other'
            self.problems.note(self.summary.start, text)
            self.summary.discard_entries()

    def _check_start(self, start: bytes, file: BinaryIO) -> None:
        """Refuse a file that is no log; one with a damaged start has sound chunks in it."""
        check = RecordCheck(file, self.size, self._budget)
        if check.find_chunk(0, self.size) is not None:
            self.problems.note(0, 'its first bytes are not those of an MCAP file')
            return
        if not start:
            raise NotALogError(self.path, 'the file is empty')
        if not start.startswith(records.MAGIC):
            raise NotALogError(self.path, 'it does not start as an MCAP file does')
        raise NotALogError(self.path, 'there is no header at its start')

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

    def scan(self, file: BinaryIO, channels: Channels | None = None) -> RecordScan:
        """Return a pass over the open file, which adds to the channels."""
        end = self.summary.start if self.summary.is_index else self._end
        return RecordScan(file, end, channels or Channels(), summary=self.summary)

    def _note_losses(self, scan: RecordScan) -> None:
        for loss in scan.report.losses:
            self.problems.note(loss.offset, str(loss), is_loss=True, is_refusal=loss.is_refusal)
        for problem in scan.report.problems:
            self.problems.note(problem.offset, problem.text)
        with self.open() as file:
            self.gaps.update(gaps(file, scan.report.losses, self.summary.chunks))

    def overview(self) -> Overview:
        """Return the content by the index, or by a pass over the whole file."""
        statistics = self.summary.statistics
        if not self.summary.is_index or statistics is None:
            topics = self._survey.topics
            times = spanned_time((batch.start, batch.end) for batch in self._survey.batches)
        else:
            topics = self.summary.channels.topics()
            ends = statistics.message_start_time, statistics.message_end_time
            times = ends if statistics.message_count else None
        return Overview(list(topics.values()), times)

    @cached_property
    def _survey(self) -> _Survey:
        """Make a pass over the whole file: a channel record may follow its messages."""
        channels = self.summary.channels
        batches: list[_Batch] = []
        with self.open() as file:
            scan = self.scan(file, channels)
            for span, content in scan.contents():
                times = content.block({}).times
                if times is None:
                    continue
                place = array('Q', (span.opcode, span.offset, span.length))
                batch = _Batch(len(content.data), *times, place)
                if batches and batches[-1].size <= _SMALL_CHUNK:
                    batches[-1] = batches[-1].extended(batch)
                else:
                    batches.append(batch)
            self._note_losses(scan)
        for text in channels.contradictions:
            self.problems.note_whole(text)
        return _Survey(channels.topics(), batches, scan.report)

    @cached_property
    def _topics(self) -> dict[int, Topic]:
        """Return the known topics of the whole file by channel."""
        # Chunks with a CRC may contradict a summary without one.
        is_trusted = self.summary.is_index and self.summary.verified
        return self.summary.channels.topics() if is_trusted else self._survey.topics

    def _parsed(
        self, offsets: list[int], opcode: Opcode, parse_one: Callable[[bytes, int], Parsed]
    ) -> Iterator[Parsed]:
        """Yield the records at offsets; one that is not there or damaged is a problem."""
        for offset in offsets:
            try:
                with self.open() as file:
                    end = self.summary.entry(offset).end or self._end
                    span = records.span_at(file, offset, min(end, self._end))
                    _check_kind(file, span, opcode)
                    record = parse_one(records.read(file, span), offset)
            except DamagedError as damage:  # noqa: PERF203, RUF100 - of each record
                self.problems.note(offset, damage.reason, is_loss=True)
            else:
                yield record

    @property
    def _index(self) -> Summary | ScanReport:
        """Return what has the offsets of records outside of chunks."""
        return self.summary if self.summary.is_index else self._survey.report

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the name and content of each metadata record."""
        offsets = self._index.metadata
        for record in self._parsed(offsets, Opcode.METADATA, partial(records.parse, Metadata)):
            yield record.name, record.metadata

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments."""
        offsets = self._index.attachments
        return self._parsed(offsets, Opcode.ATTACHMENT, records.parse_attachment)

    def first_data(self) -> bytes:
        """Return the data of the first message in the file; b'' if there is none."""
        with self.open() as file:
            for _, content in self.scan(file).contents():
                if len(content):
                    return content.block({}).message(0)
        return b''

    def _batches(self) -> list[_Batch]:
        """Return the chunks of the index, or what the survey found without one."""
        if not self.summary.is_index:
            return self._survey.batches
        head_size = records.RECORD_HEAD.size
        batches = []
        for chunk in self.summary.chunks:
            length = chunk.chunk_length - head_size
            batches.append(
                _Batch(
                    chunk.uncompressed_size,
                    chunk.message_start_time,
                    chunk.message_end_time,
                    array('Q', (Opcode.CHUNK, chunk.chunk_start_offset, length)),
                    chunk.message_index_offsets,
                )
            )
        return batches

    def sources(self) -> Iterator[Source]:
        """Yield the batches; all of them as one if too many overlap in time."""
        batches = self._batches()
        sources = [Source(batch.start, batch.end, partial(self._read, batch)) for batch in batches]
        times = spanned_time([(batch.start, batch.end) for batch in batches])
        if times is None or _can_merge(batches, self.size):
            yield from sources
        else:
            yield Source(*times, lambda t: chain.from_iterable(s.read(t) for s in sources))

    def _by_time(self, offset: int, block: MessageBlock, names: Topics) -> Iterator[Message]:
        """Yield the messages of a chunk; unknown channels are noted as a problem."""
        for number in sorted(block.channels - self._topics.keys()):
            self.problems.note(offset, f'messages of channel {number}, which is not known')
        return block.messages(names, by_time=True)

    def _read(self, batch: _Batch, names: Topics) -> Iterator[Message]:
        """Return the messages of a batch ordered by log time, without its damaged places."""
        if names is not None and batch.channels:
            topics = map(self._topics.get, batch.channels)
            if not any(topic is not None and topic.name in names for topic in topics):
                return iter(())
        numbers = iter(batch.spans)
        blocks: list[tuple[int, MessageBlock]] = []
        with self.open() as file:
            for opcode, offset, length in zip(numbers, numbers, numbers, strict=True):
                content = self._content_of(file, records.RecordSpan(opcode, offset, length))
                if content:
                    blocks.append((offset, content.block(self._topics)))
        if not self._may_merge(batch, [block for _, block in blocks]):
            return iter(())
        sorted_messages = [self._by_time(offset, block, names) for offset, block in blocks]
        if len(sorted_messages) == 1:
            return sorted_messages[0]
        return heapq.merge(*sorted_messages, key=attrgetter('log_time'))

    def _content_of(self, file: BinaryIO, span: records.RecordSpan) -> Content | None:
        """Return the content of a chunk or a row of messages; None, and a problem, if damaged."""
        try:
            _check_kind(file, span, span.opcode)
            if span.opcode == Opcode.CHUNK:
                content = chunk_content(records.read(file, span), span.offset, self._budget)
            else:
                file.seek(span.offset)
                content = content_of(file.read(span.end - span.offset), verified=False)
        except DamagedError as damage:
            self.problems.note(span.offset, damage.reason, is_refusal=damage.is_refusal)
            return None
        if content.broken:
            self.problems.note(span.offset, content.broken)
        return content

    def _may_merge(self, batch: _Batch, blocks: list[MessageBlock]) -> bool:
        """Return whether a batch is as the index says, or is small."""
        times = spanned_time([block.times for block in blocks])
        size = sum(len(block.data) for block in blocks)
        if times is None or (size, *times) == batch[:3]:
            return True
        _, offset, length = batch.spans[:3]
        is_small = size <= max(_SMALL_CHUNK, MAX_RATIO * length)
        text = 'the index is wrong about this chunk'
        self.problems.note(offset, text if is_small else f'{text}, which is left out')
        return is_small

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages chunk by chunk in the order of the file, with their offsets."""
        topics = self._topics
        count = ContentCount()
        private_count = unverified_count = 0
        with self.open() as file:
            scan = self.scan(file)
            for span, content in scan.contents():
                block = content.block(topics)
                count.add(span.offset, block)
                private_count += content.unknown
                unverified_count += 0 if content.verified else len(content)
                yield span.offset, block
            self._note_losses(scan)
        unknown = sum(n for number, n in count.messages.items() if number not in topics)
        if unknown:
            loss = f'{counted(unknown, "message")} of topics whose description is lost'
            self.problems.note_whole(loss, is_loss=True)
        # The messages of damaged chunks cannot be counted.
        if not scan.report.losses:
            for text, is_loss in count.disagreements(self.summary):
                self.problems.note_whole(text, is_loss=is_loss)
        self.remarks[:] = _remarks(scan, private_count, unverified_count)


def _check_kind(file: BinaryIO, span: records.RecordSpan, opcode: int) -> None:
    """Raise a DamagedError if no record of a kind stands at a place."""
    file.seek(span.offset)
    if file.read(1) != bytes([opcode]):
        raise DamagedError(
            f'the index is wrong: no {records.name_of(opcode)} stands there', span.offset
        )


def _can_merge(batches: list[_Batch], file_size: int) -> bool:
    """
    Return whether the batches that overlap in time may be unpacked at once.

    Those of a recorder follow each other, or it has as many bytes in the file. Two of the largest
    always fit: each is held to the decompression limit by itself.
    """
    begins = [(batch.start, batch.size) for batch in batches]
    ends = [(batch.end + 1, -batch.size) for batch in batches]
    unpacked = accumulate(size for _, size in sorted(begins + ends))
    largest = max((batch.size for batch in batches), default=0)
    return max(unpacked, default=0) <= max(2 * MIN_LIMIT, MAX_RATIO * file_size, 2 * largest)


def _remarks(scan: RecordScan, private_count: int, unverified_count: int) -> Iterator[str]:
    """Yield remarks on a pass whose content has private records and messages without a CRC."""
    report = scan.report
    yield from report.remarks
    private_count += report.unknown
    if private_count:
        yield (
            f'{counted(private_count, "record")} of kinds that are private, or of a later version '
            f'of MCAP, {verb(private_count, "is", "are")} left out'
        )
    if unverified_count and not report.verified:
        have = verb(unverified_count, 'message has', 'messages have')
        yield f'{unverified_count} {have} no CRC, so damage in them is unknown'
