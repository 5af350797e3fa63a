"""
One pass over the data of a file in the order in which they stand there, whatever their state.

This is how a file without an index is read, and how a damaged one is recovered: damage is stepped
over, up to the next record that is sound, and all that is left out is listed. Which records are
believed is decided in :mod:`klann_ros.log.mcap.belief`, and where it goes on behind damage
in :mod:`klann_ros.log.mcap.resync`.
"""

from collections.abc import Iterator
from typing import BinaryIO

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode
from mcap.records import Metadata

from .belief import Belief
from .channels import Channels
from .container import MAGIC, name_of, read, span_at
from .content import chunk_content, Content, message_content, Stretches
from .damage import is_made_anew, Loss, Losses
from .decompression import DecompressionBudget
from .evidence import Evidence
from .layout import fields_end, is_known, RecordSpan
from .parsing import parse
from .resync import Search
from .summary import Summary

_INDEX_HEAD, _INDEX_ENTRY = 6, 16
_DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
# What may follow the end of the data.
_SUMMARY = (
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.STATISTICS,
    Opcode.SUMMARY_OFFSET,
    Opcode.FOOTER,
)


class Walk:
    """
    A pass over the data of an open file, up to its end.

    Parameters
    ----------
    file, size
        The file, and where to stop [bytes]: its size, or where its footer or summary starts.
    channels
        Takes the schemas and channels that are met.
    summary
        A summary that holds; it says where records end whose own length is damaged.

    Attributes
    ----------
    metadata, attachments
        Where such records stand, as far as the walk has come.
    losses
        What was stepped over so far.
    wrong, remarks
        What else is wrong, though nothing is lost by it, and what only looks as if it were.
    verified
        Whether there was a CRC of all data that held, at the end of the walk.
    unknown
        How many records there were, outside of what contents() yields, that are private or of a
        later version.

    """

    def __init__(
        self, file: BinaryIO, size: int, channels: Channels, *, summary: Summary | None = None
    ) -> None:
        self.metadata: list[RecordSpan] = []
        self.attachments: list[RecordSpan] = []
        self.losses = Losses()
        self.unknown = 0
        self.verified = False
        self._file = file
        self._size = size
        self._channels = channels
        self._summary = summary or Summary()
        self._budget = DecompressionBudget()
        self._evidence = Evidence(file, size, self._budget)
        self._search = Search(self._evidence)
        self._belief = Belief(self._evidence, self._search, self._summary)
        self.wrong, self.remarks = self._belief.wrong, self._belief.remarks
        self._stretches = Stretches(file)
        self._chunked = False
        self._data_end: RecordSpan | None = None
        self._next = len(MAGIC)
        self._lost: Loss | None = None

    def contents(self) -> Iterator[tuple[int, Content]]:
        """Yield what each chunk and each single message holds, with its offset [bytes]."""
        while self._next < self._size:
            try:
                span = self._span_at(self._next)
                self._next = span.end
                content = self._step(span)
            except DamagedError as damage:
                self._resume(damage)
                continue
            if content is not None:
                yield span.offset, content
        if self._data_end is not None and not len(self.losses) and not self.wrong:
            self.verified = self._belief.in_data(self._data_end)

    def _span_at(self, offset: int) -> RecordSpan:
        """Return the record at an offset; raise if its end cannot be relied on."""
        span = span_at(self._file, offset, self._size)
        if self._belief.in_end(span, chunked=self._chunked):
            return span
        proven = self._belief.without_end(span)
        if proven is not None:
            return proven
        reason = f'the {name_of(span.opcode)} or its length is damaged'
        raise DamagedError(reason, offset, span.opcode)

    def _step(self, span: RecordSpan) -> Content | None:
        """Deal with one record, whose damage if any ends where it ends."""
        reason = self._belief.against_content(span)
        if reason:
            self._lose_record(span, reason)
        elif span.opcode == Opcode.MESSAGE_INDEX:
            self._index(span)
        elif span.opcode == Opcode.MESSAGE or not is_known(span.opcode):
            return self._take_loose(span)
        else:
            self._lost = None
            return self._take(span)
        return None

    def _take_loose(self, span: RecordSpan) -> Content | None:
        """Return a message outside of chunks, and those behind it; pass over unknown kinds."""
        content: Content | None
        until = self._summary.first_from(span.start) or self._size
        stretch = self._stretches.at(span.offset, min(until, self._size))
        if stretch is not None:
            content, self._next = stretch
        elif span.opcode == Opcode.MESSAGE:
            content = self._read(span)
        else:
            self.unknown += 1
            return None
        if content is not None and len(content):
            self._lost = None
        return content

    def _take(self, span: RecordSpan) -> Content | None:
        if span.opcode in (Opcode.CHUNK, *_DEFINITIONS):
            return self._read(span)
        if span.opcode == Opcode.DATA_END:
            self._data_end = self._data_end or span
        elif span.opcode == Opcode.METADATA:
            self._take_metadata(span)
        elif span.opcode == Opcode.ATTACHMENT:
            self.attachments.append(span)
        elif not self._belongs(span):
            self._lose_record(span, f'a {name_of(span.opcode)} does not belong there')
        return None

    def _take_metadata(self, span: RecordSpan) -> None:
        try:
            parse(Metadata, read(self._file, span), span.offset)
        except DamagedError as damage:
            self._lose_record(span, damage.reason)
        else:
            self.metadata.append(span)

    def _belongs(self, span: RecordSpan) -> bool:
        if span.opcode == Opcode.HEADER:
            return span.offset == len(MAGIC)
        ended = self._data_end or 0 < self._summary.start <= span.offset
        return ended and span.opcode in _SUMMARY

    def _read(self, span: RecordSpan) -> Content | None:
        """Return what a chunk or a message holds; note it as lost if it is damaged."""
        content = None
        try:
            if span.opcode == Opcode.CHUNK:
                self._chunked = True
                content = chunk_content(read(self._file, span), span.offset, self._budget)
                self._channels.add_all(
                    content.definitions(), span.offset, verified=content.verified
                )
            elif span.opcode == Opcode.MESSAGE:
                content = message_content(read(self._file, span), span.offset)
            else:
                self._channels.add(span.opcode, read(self._file, span), span.offset)
        except DamagedError as damage:
            if content is None:
                self._lose_record(span, damage.reason)
            else:
                self._lose(span, damage.reason)
        if content is not None and content.broken:
            self._lose(span, f'the chunk could be read in part only: {content.broken}')
        return content

    def _index(self, span: RecordSpan) -> None:
        """Count the messages that a lost chunk held: its index stands behind it."""
        if self._lost is not None:
            size = (fields_end(self._file, span) or span.end) - span.start - _INDEX_HEAD
            self._lost.messages = (self._lost.messages or 0) + size // _INDEX_ENTRY

    def _lose_record(self, span: RecordSpan, reason: str) -> None:
        """Note a record as lost, but for a chunk in it: if bytes are missing it reaches over."""
        self._lost = self._lose(span, reason)
        found = self._search.chunk(span.start, span.end)
        if found is not None:
            self._next = found
            self._lost.length = found - span.offset

    def _lose(self, span: RecordSpan, reason: str) -> Loss:
        return self.losses.add(span.offset, span.end - span.offset, reason)

    def _resume(self, damage: DamagedError) -> None:
        """Go on behind damage, and note what is left out unless it is made anew anyway."""
        start = damage.offset
        found, exact = self._belief.sound_behind(start, chunked=self._chunked)
        end = self._next = self._size if found is None else found
        remade = self._data_end or is_made_anew(
            self._file, start, damage.opcode, self._size - start
        )
        if found is None and remade:
            return
        reason = damage.reason
        if damage.opcode == 0 and self._evidence.only_zeros(start, end):
            reason = 'there are only zeros'
        reason += ' from here to the end' if found is None else f'; sound again at byte {end}'
        self._lost = self.losses.add(start, end - start, reason, exact=exact)
