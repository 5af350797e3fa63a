"""
One pass over the data of a file in the order in which they stand there, whatever their state.

This is how a file without an index is read, and how a damaged one is recovered: damage is stepped
over, up to the next record that is sound, and all that is left out is listed.

A record's length is followed only when the lengths inside of the record agree with it, or when
another record may start where it ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from klann_ros.log.errors import DamagedError
from mcap.opcode import Opcode
from mcap.records import Metadata

from .chunks import chunk_content
from .container import is_kind, MAGIC, may_start, name_of, read, span_at, starts
from .content import message_content
from .cut_off import is_made_anew
from .damage import Loss, Losses
from .layout import lengths_agree
from .parsing import parse
from .resync import Search
from .summary import Summary

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

    from .channels import Channels
    from .container import Span
    from .content import Content

_INDEX_ENTRY = 16
_PIECE = 1024 * 1024
_CHECKED = (Opcode.CHUNK, Opcode.ATTACHMENT)
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
        The file, and where to stop [bytes]: its size, or where a summary starts that holds.
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

    """

    def __init__(
        self,
        file: BinaryIO,
        size: int,
        channels: Channels,
        *,
        summary: Summary | None = None,
    ) -> None:
        self.metadata: list[Span] = []
        self.attachments: list[Span] = []
        self.losses = Losses()
        self._file = file
        self._size = size
        self._channels = channels
        self._summary = summary or Summary()
        self._ends = self._summary.ends()
        self._search = Search(file, size)
        self._ended = self._chunked = False
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

    def _span_at(self, offset: int) -> Span:
        """Return the record at an offset; raise if its end cannot be relied on."""
        span = span_at(self._file, offset, self._size)
        if starts(self._file, span.end, self._size):
            return span
        holds = lengths_agree(self._file, span) and self._search.is_whole(span)
        if holds or may_start(self._file, span.end, self._size):
            # What has no CRC may be whole by its lengths, and yet reach into a chunk behind a gap.
            over = span.end if holds and span.opcode in _CHECKED else 0
            if self._search.chunk(span.start, span.end, over=over) is None:
                return span
        if span.opcode == Opcode.MESSAGE and self._is_before_damage(span):
            return span
        reason = f'the {name_of(span.opcode)} or its length is damaged'
        raise DamagedError(reason, offset, span.opcode)

    def _is_before_damage(self, span: Span) -> bool:
        """Return whether it is the next record that is damaged, not the length of this message."""
        if not is_kind(self._file, span.end):
            return False
        found = self._search.record(span.start, chunked=self._chunked)
        return found is None or found >= span.end

    def _step(self, span: Span) -> Content | None:
        """Deal with one record, whose damage if any ends where it ends."""
        if span.opcode != Opcode.MESSAGE and not lengths_agree(self._file, span):
            name = name_of(span.opcode)
            self._lose_record(span, f'the lengths in the {name} contradict each other')
            return None
        if span.opcode == Opcode.MESSAGE_INDEX:
            self._index(span)
            return None
        self._lost = None
        if span.opcode in (Opcode.CHUNK, Opcode.MESSAGE, *_DEFINITIONS):
            return self._read(span)
        if span.opcode == Opcode.DATA_END:
            self._ended = True
        elif span.opcode == Opcode.METADATA:
            self._take_metadata(span)
        elif span.opcode == Opcode.ATTACHMENT:
            self.attachments.append(span)
        elif not self._belongs(span):
            self._lose_record(span, f'a {name_of(span.opcode)} does not belong there')
        return None

    def _take_metadata(self, span: Span) -> None:
        try:
            parse(Metadata, read(self._file, span), span.offset)
        except DamagedError as damage:
            self._lose_record(span, damage.reason)
        else:
            self.metadata.append(span)

    def _belongs(self, span: Span) -> bool:
        if span.opcode == Opcode.HEADER:
            return span.offset == len(MAGIC)
        return self._ended and span.opcode in _SUMMARY

    def _read(self, span: Span) -> Content | None:
        """Return what a chunk or a message holds; note it as lost if it is damaged."""
        content = None
        try:
            if span.opcode == Opcode.CHUNK:
                self._chunked = True
                content = chunk_content(read(self._file, span), span.offset)
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

    def _index(self, span: Span) -> None:
        """Count the messages that a lost chunk held: its index stands behind it."""
        if self._lost is not None:
            self._lost.messages = (self._lost.messages or 0) + span.length // _INDEX_ENTRY

    def _lose_record(self, span: Span, reason: str) -> None:
        """Note a record as lost, but for a chunk in it: if bytes are missing it reaches over."""
        self._lost = self._lose(span, reason)
        found = self._search.chunk(span.start, span.end)
        if found is not None:
            self._next = found
            self._lost.length = found - span.offset

    def _lose(self, span: Span, reason: str) -> Loss:
        return self.losses.add(span.offset, span.end - span.offset, reason)

    def _resume(self, damage: DamagedError) -> None:
        """Go on behind damage, and note what is left out unless it is made anew anyway."""
        start = damage.offset
        found, exact = self._sound_behind(start)
        end = self._next = self._size if found is None else found
        remade = self._ended or is_made_anew(self._file, start, damage.opcode, self._size - start)
        if found is None and remade:
            return
        reason = damage.reason
        if damage.opcode == 0 and self._only_zeros(start, end):
            reason = 'there are only zeros'
        reason += ' from here to the end' if found is None else f'; sound again at byte {end}'
        self._lost = self.losses.add(start, end - start, reason, exact=exact)

    def _sound_behind(self, start: int) -> tuple[int | None, bool]:
        """Return where to go on behind a damaged record, and whether that is where it ends."""
        end = self._ends.get(start)
        if end is None or not may_start(self._file, end, self._size):
            return self._search.record(start + 1, chunked=self._chunked), False
        over = end if start in self._summary.attachments else 0
        moved = self._search.chunk(start + 1, end, over=over)
        return (end, True) if moved is None else (moved, False)

    def _only_zeros(self, start: int, end: int) -> bool:
        self._file.seek(start)
        return not any(
            any(self._file.read(min(_PIECE, end - offset))) for offset in range(start, end, _PIECE)
        )
