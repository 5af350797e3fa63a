"""
Recovery of a damaged or truncated file: one pass reads intact records and reports damage.

Any valid MCAP file is accepted: records that are longer than their fields, private kinds, kinds of
later versions. Behind damage whose end is unknown the pass resynchronises at the next sound record
(:mod:`klann_ros.log.mcap.record_check`). A summary that indexes all chunks, attachments and
metadata records settles ambiguous cases.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
import struct
from typing import BinaryIO

from klann_ros.log.bag_metadata import RECORD_NAME
from klann_ros.log.errors import DamagedError
from klann_ros.log.read.storage import LogProblem
from klann_ros.sanitize.text import counted
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Metadata

from . import records
from .content import chunk_content, Content, message_content, row_of_messages
from .decompression import DecompressionBudget
from .record_check import CHECKED_KINDS, Payload, RecordCheck, RecordVerdict, Successor, VERDICTS
from .records import RecordSpan
from .summary import Channels, Summary

# Notes and losses of one pass; further losses are merged.
_MAX_NOTES, _MAX_LOSSES = 100, 1000
# The zeros at the end of the fields of a record without content: a length, and a CRC [bytes].
_EMPTY_TAIL: dict[int, int] = {Opcode.CHUNK: 8, Opcode.ATTACHMENT: 8 + 4, Opcode.METADATA: 4}
# Minimum and maximum size of a block of messages outside of chunks [bytes].
_MIN_BLOCK, _MAX_BLOCK = 4096, 1024 * 1024
# Start of a chunk: opcode, length, first and last log time.
_CHUNK_HEAD = struct.Struct('<BQQQ')
_CUT_INDEX = struct.Struct('<QHI')
_CUT_HEAD_SIZE = 8 + 4 + len(RECORD_NAME)


@dataclass
class Loss:
    """Bytes of a file that cannot be used."""

    offset: int
    length: int
    # One line.
    reason: str
    # Number of messages in them; None if unknown.
    messages: int | None = None
    # Whether that is the exact number.
    exact: bool = True
    # Whether they are not damaged, but beyond a limit of this machine.
    is_refusal: bool = False

    def __str__(self) -> str:
        """Return it in one line, without the offset."""
        at_least = '' if self.exact else 'at least '
        content = f' with {at_least}{counted(self.messages, "message")}' if self.messages else ''
        return f'{counted(self.length, "byte")}{content}: {self.reason}'


@dataclass
class ScanReport:
    """What a pass over a file has found beside its messages so far."""

    # Offsets of such records [bytes].
    metadata: list[int] = field(default_factory=list)
    attachments: list[int] = field(default_factory=list)
    # Skipped bytes, faults that lose nothing, and records that only look like faults.
    losses: list[Loss] = field(default_factory=list)
    problems: list[LogProblem] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    # Number of records of unknown kinds outside of chunks and rows of messages.
    unknown: int = 0
    # Whether a CRC of all data matched; set at the end.
    verified: bool = False

    def add_loss(self, start: int, end: int, reason: str, *, exact: bool = True) -> Loss:
        """Add bytes that cannot be used, to the last loss if there are too many."""
        if len(self.losses) < _MAX_LOSSES:
            self.losses.append(Loss(start, end - start, reason, exact=exact))
        else:
            last = self.losses[-1]
            last.length += end - start
            last.reason = 'this and all other damage behind it'
            last.exact = False
            last.is_refusal = False
        return self.losses[-1]


class RecordScan:
    """
    A pass over the records of an open file.

    It ends at `size` [bytes], the file's size or the offset of its footer or summary. `channels`
    receives the schemas and channels. A valid summary locates records whose own length is damaged.
    """

    def __init__(
        self, file: BinaryIO, size: int, channels: Channels, *, summary: Summary | None = None
    ) -> None:
        self.report = ScanReport()
        self._file = file
        self._size = size
        self._channels = channels
        self._summary = summary or Summary()
        self._budget = DecompressionBudget()
        self._check = RecordCheck(file, size, self._budget)
        # Size of the next block of messages outside of chunks [bytes].
        self._block_size = _MIN_BLOCK
        # Whether there was a chunk so far.
        self._chunked = False
        self._data_end: RecordSpan | None = None
        # Offset of the next record [bytes].
        self._next = len(records.MAGIC)
        # The record lost last, whose message indexes may follow.
        self._lost: Loss | None = None

    def contents(self) -> Iterator[tuple[RecordSpan, Content]]:
        """Yield the content of each chunk and each row of loose messages, with its place."""
        while self._next < self._size:
            try:
                span = self._span_at(self._next)
                self._next = span.end
                content = self._process(span)
            except DamagedError as damage:
                self._resynchronise(damage)
                continue
            if content is not None:
                yield RecordSpan(span.opcode, span.offset, self._next - span.start), content
        report = self.report
        if self._data_end is not None and not report.losses and not report.problems:
            try:
                report.verified = records.check_data(self._file, self._data_end)
            except DamagedError as damage:
                text = f'{damage.reason}: something in it was changed'
                report.problems.append(LogProblem(self._data_end.offset, text))

    def _span_at(self, offset: int) -> RecordSpan:
        """Return the place of a record; raise if its end is not reliable."""
        span = records.span_at(self._file, offset, self._size)
        if self._ends_as_declared(span):
            return span
        # Its length is wrong; a CRC may prove a part of it.
        end = records.fields_end(self._file, span)
        if end in (None, span.end) or self._check.payload(span) is not Payload.PROVEN:
            reason = f'the {records.name_of(span.opcode)} or its length is damaged'
            raise DamagedError(reason, offset, span.opcode)
        if len(self.report.problems) < _MAX_NOTES:
            name = records.name_of(span.opcode)
            text = f'the length of the {name} is damaged, its content is intact'
            self.report.problems.append(LogProblem(offset, text))
        return RecordSpan(span.opcode, offset, (end or 0) - span.start)

    def _ends_as_declared(self, span: RecordSpan) -> bool:
        successor = self._check.successor(span.end)
        # The payload of a record with a sound successor is read later.
        is_followed = successor is Successor.SOUND
        payload = Payload.INVALID if is_followed else self._check.payload(span)
        verdict = VERDICTS[payload][0][successor]
        if verdict is RecordVerdict.ACCEPT:
            return not self._covers_records(span)
        if verdict is RecordVerdict.ALONE and self._is_alone(span, payload):
            return True
        return span.opcode == Opcode.MESSAGE and self._precedes_damage(span)

    def _is_alone(self, span: RecordSpan, payload: Payload) -> bool:
        """Return whether no other record seems to start inside of one."""
        covered_end = 0
        if payload >= Payload.EXACT:
            end = records.fields_end(self._file, span) or span.end
            if end < span.end and self._check.successor(end) is Successor.SOUND:
                return False
            # A record without a CRC may have the right lengths, and yet reach into a chunk.
            covered_end = end if span.opcode in CHECKED_KINDS else 0
        return self._check.find_chunk(span.start, span.end, beyond=covered_end) is None

    def _precedes_damage(self, span: RecordSpan) -> bool:
        """Return whether the record behind a message is damaged, not the message's length."""
        self._file.seek(span.end)
        opcode = self._file.read(1)
        if not opcode or not records.is_known(opcode[0]):
            return False
        next_sound = self._check.find_record(span.start, chunked=self._chunked)
        return next_sound is None or next_sound >= span.end

    def _covers_records(self, span: RecordSpan) -> bool:
        """
        Return whether other records, not unknown fields, stand behind the fields of one.

        Unknown fields may look like records. In a closed file without an index they count as
        fields, as the specification says, with a remark.
        """
        end = records.fields_end(self._file, span) if records.is_known(span.opcode) else None
        if end is None or end == span.end:
            return False
        if self._summary.names_all:
            next_indexed = self._summary.first_from(end)
            return next_indexed is not None and next_indexed < span.end
        are_records = self._check.are_records(end, span.end)
        if are_records and self._summary.closed and len(self.report.remarks) < _MAX_NOTES:
            name = records.name_of(span.opcode)
            self.report.remarks.append(
                f'at byte {end}: what stands behind the fields of a {name} looks like records; '
                f'it belongs to the {name}, whose length includes it'
            )
        return are_records and not self._summary.closed

    def _process(self, span: RecordSpan) -> Content | None:
        """Process a record; its damage, if any, ends at its end."""
        reason = self._content_fault(span)
        if reason:
            self._lose_record(span, reason)
        elif span.opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(span)
        elif span.opcode == Opcode.MESSAGE:
            return self._read_loose(span)
        elif not records.is_known(span.opcode):
            self.report.unknown += 1
        else:
            self._lost = None
            if span.opcode in (Opcode.CHUNK, *records.DEFINITIONS):
                return self._read(span)
            self._note_place(span)
        return None

    def _content_fault(self, span: RecordSpan) -> str:
        """Return the fault of a record's content in one line; '' for none."""
        name = records.name_of(span.opcode)
        indexed_kind = self._summary.entry(span.offset).opcode
        if indexed_kind not in (None, span.opcode):
            return f'the {name} is a {records.name_of(indexed_kind)} in the index'
        end = records.fields_end(self._file, span)
        if end is None:
            return records.contradiction(span)
        if end < span.end:
            if self._is_zeroed(span, end):
                return f'there are zeros where the content of the {name} began'
            if not self._summary.names_all:
                proven_kind = self._check.proven_kind(span)
                if proven_kind is not None:
                    return f'the {name} is a {records.name_of(proven_kind)} by its content'
        return ''

    def _is_zeroed(self, span: RecordSpan, end: int) -> bool:
        """Return whether zeros over a record's head make it look empty, with unknown fields."""
        size = _EMPTY_TAIL.get(span.opcode)
        if size is None or not records.has_no_content(self._file, span):
            return False
        self._file.seek(end - size)
        return not any(self._file.read(size + 1)) and self._summary.entry(span.offset).size != 0

    def _read_loose(self, span: RecordSpan) -> Content | None:
        """Return a message outside of chunks, and those behind it if there are enough."""
        until = min(self._summary.first_from(span.start) or self._size, self._size)
        self._file.seek(span.offset)
        data = self._file.read(max(0, min(self._block_size, until - span.offset)))
        row, row_size = row_of_messages(data)
        is_useful = 2 * row_size > len(data)
        self._block_size = min(4 * self._block_size, _MAX_BLOCK) if is_useful else _MIN_BLOCK
        content: Content | None = row
        if len(row):
            self._next = span.offset + row_size
        else:
            content = self._read(span)
        if content is not None:
            self._lost = None
        return content

    def _note_place(self, span: RecordSpan) -> None:
        """Note a record outside of chunks, or lose it if it does not belong there."""
        if span.opcode == Opcode.DATA_END:
            self._data_end = self._data_end or span
        elif span.opcode == Opcode.METADATA:
            try:
                records.parse(Metadata, records.read(self._file, span), span.offset)
            except DamagedError as damage:
                self._lose_record(span, damage.reason)
            else:
                self.report.metadata.append(span.offset)
        elif span.opcode == Opcode.ATTACHMENT:
            self.report.attachments.append(span.offset)
        elif span.opcode == Opcode.HEADER:
            if span.offset != len(records.MAGIC):
                self._lose_record(span, 'a header does not belong there')
        elif not (self._data_end or 0 < self._summary.start <= span.offset):
            self._lose_record(span, f'a {records.name_of(span.opcode)} does not belong there')

    def _read(self, span: RecordSpan) -> Content | None:
        """Return the content of a chunk or a message; note it as lost if it is damaged."""
        content = None
        try:
            if span.opcode == Opcode.CHUNK:
                self._chunked = True
                content = chunk_content(records.read(self._file, span), span.offset, self._budget)
                self._channels.add_all(content, span.offset)
            elif span.opcode == Opcode.MESSAGE:
                content = message_content(records.read(self._file, span), span.offset)
            else:
                self._channels.add(span.opcode, records.read(self._file, span), span.offset)
        except DamagedError as damage:
            if content is None:
                loss = self._lose_record(span, damage.reason)
                loss.is_refusal = damage.is_refusal and loss.reason == damage.reason
            else:
                self.report.add_loss(span.offset, span.end, damage.reason)
        if content is not None and content.broken:
            reason = f'the chunk could be read in part only: {content.broken}'
            self.report.add_loss(span.offset, span.end, reason)
        return content

    def _count_lost(self, span: RecordSpan) -> None:
        """Count the messages of a lost chunk by the index behind it."""
        if self._lost is not None:
            end = records.fields_end(self._file, span) or span.end
            entries_size = end - span.start - records.INDEX_HEAD.size
            count = entries_size // records.INDEX_ENTRY
            self._lost.messages = (self._lost.messages or 0) + count

    def _lose_record(self, span: RecordSpan, reason: str) -> Loss:
        """Note a record as lost up to a chunk in it, if missing bytes make it reach over one."""
        self._lost = self.report.add_loss(span.offset, span.end, reason)
        chunk_offset = self._check.find_chunk(span.start, span.end)
        if chunk_offset is not None:
            self._next = chunk_offset
            self._lost.length = chunk_offset - span.offset
        return self._lost

    def _resynchronise(self, damage: DamagedError) -> None:
        """Continue behind damage, and note the loss unless a recovery writes its content again."""
        start = damage.offset
        next_sound, exact = self._sound_behind(start)
        end = self._next = self._size if next_sound is None else next_sound
        if next_sound is None and (self._data_end or self._is_rewritten(damage)):
            return
        reason = damage.reason
        if damage.opcode == 0 and self._check.is_zero(start, end):
            reason = 'there are only zeros'
        is_last = next_sound is None
        reason += ' from here to the end' if is_last else f'; sound again at byte {end}'
        self._lost = self.report.add_loss(start, end, reason, exact=exact)

    def _sound_behind(self, start: int) -> tuple[int | None, bool]:
        """Return the next sound offset behind damage, and whether the record ends there."""
        kind, end, _ = self._summary.entry(start)
        if end is None or self._check.successor(end) is Successor.NONE:
            return self._check.find_record(start + 1, chunked=self._chunked), False
        beyond = end if kind == Opcode.ATTACHMENT else 0
        chunk_offset = self._check.find_chunk(start + 1, end, beyond=beyond)
        return (end, True) if chunk_offset is None else (chunk_offset, False)

    def _is_rewritten(self, damage: DamagedError) -> bool:
        """Return whether a truncated record holds only what every new file gets anyway."""
        left = self._size - damage.offset
        self._file.seek(damage.offset + 1)
        head = self._file.read(_CUT_HEAD_SIZE)
        if damage.opcode == Opcode.MESSAGE_INDEX:
            if len(head) < _CUT_INDEX.size:
                return True
            length, _, size = _CUT_INDEX.unpack_from(head)
            return bool(length >= size + records.INDEX_HEAD.size > left - records.RECORD_HEAD.size)
        if damage.opcode == Opcode.METADATA:
            return head[8:] == struct.pack('<I', len(RECORD_NAME)) + RECORD_NAME.encode()
        size = records.RECORD_HEAD.size + records.min_size(Opcode.DATA_END)
        return damage.opcode == Opcode.DATA_END and left < size


def gaps(
    file: BinaryIO, losses: Iterable[Loss], chunks: Iterable[ChunkIndex]
) -> Iterator[tuple[int, int]]:
    """Yield the first and last log times of lost chunks [ns], by the index or their own heads."""
    indexed = sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)
    offsets = [chunk.chunk_start_offset for chunk in indexed]
    for loss in losses:
        first = bisect_left(offsets, loss.offset)
        last = bisect_left(offsets, loss.offset + loss.length)
        for chunk in indexed[first:last]:
            yield chunk.message_start_time, chunk.message_end_time
        if first == last:
            # Without an index, whose CRC is its own, the damaged chunk is the only source.
            file.seek(loss.offset)
            head = file.read(_CHUNK_HEAD.size)
            if len(head) == _CHUNK_HEAD.size:
                opcode, _, begin, end = _CHUNK_HEAD.unpack(head)
                if opcode == Opcode.CHUNK and begin <= end:
                    yield begin, end
