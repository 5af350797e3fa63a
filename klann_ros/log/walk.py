"""
One pass over the data of a file in the order in which they stand there, whatever their state.

This is how a file without an index is read, and how a damaged one is recovered: damage that has an
end is stepped over, and all that is left out is listed.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from .bag_metadata import RECORD_NAME
from .chunks import chunk_content, message_content
from .container import MAGIC, name_of, read, spans
from .errors import DamagedError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

    from .channels import Channels
    from .chunks import Content
    from .container import Span

_INDEX_HEAD = struct.Struct('<HI')
_INDEX_ENTRY = 16
_CUT_INDEX = struct.Struct('<QHI')
_CUT_HEAD = 8 + 4 + len(RECORD_NAME)
_DATA_END_LENGTH = 4
_PIECE = 1024 * 1024


@dataclass
class Loss:
    """
    Something in a file that cannot be used.

    Parameters
    ----------
    offset, length
        Where it is [bytes].
    reason
        What is wrong with it, in one line.
    messages
        How many messages it held; None if nothing says so.

    """

    offset: int
    length: int
    reason: str
    messages: int | None = None


class Walk:
    """
    A pass over the data of an open file, up to its end or to where it cannot be followed.

    Attributes
    ----------
    metadata, attachments
        Where such records stand, as far as the walk has come.
    losses
        What was stepped over so far.
    ended
        Whether the record was met that ends the data of a file that was closed.

    """

    def __init__(self, file: BinaryIO, size: int, channels: Channels) -> None:
        self.metadata: list[Span] = []
        self.attachments: list[Span] = []
        self.losses: list[Loss] = []
        self.ended = False
        self._file = file
        self._size = size
        self._channels = channels
        self._lost_chunk: Loss | None = None

    def contents(self) -> Iterator[tuple[int, Content]]:
        """Yield what each chunk and each single message holds, with its offset [bytes]."""
        try:
            for span in spans(self._file, len(MAGIC), self._size):
                content = self._step(span)
                if content is not None:
                    yield span.offset, content
                if self.ended:
                    return
        except DamagedError as damage:
            self._give_up(damage)

    def _step(self, span: Span) -> Content | None:
        """Deal with one record; only damage whose end is not known is raised."""
        if span.opcode == Opcode.MESSAGE_INDEX:
            self._index(span)
            return None
        self._lost_chunk = None
        if span.opcode == Opcode.DATA_END:
            if span.length != _DATA_END_LENGTH:
                raise DamagedError('the end of the data is damaged', span.offset, span.opcode)
            self.ended = True
        elif span.opcode == Opcode.METADATA:
            self.metadata.append(span)
        elif span.opcode == Opcode.ATTACHMENT:
            self.attachments.append(span)
        elif span.opcode in (Opcode.CHUNK, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            return self._read(span)
        elif span.opcode != Opcode.HEADER:
            self._lose(span, f'a {name_of(span.opcode)} does not belong there')
        return None

    def _read(self, span: Span) -> Content | None:
        """Return what a chunk or a message holds; note it as lost if it is damaged."""
        content = None
        try:
            if span.opcode == Opcode.CHUNK:
                content = chunk_content(read(self._file, span), span.offset)
                self._channels.add_all(content.definitions, span.offset)
            elif span.opcode == Opcode.MESSAGE:
                content = message_content(read(self._file, span), span.offset)
            else:
                self._channels.add(span.opcode, read(self._file, span), span.offset)
        except DamagedError as damage:
            loss = self._lose(span, damage.reason)
            if content is None and span.opcode == Opcode.CHUNK:
                self._lost_chunk = loss
        if content is not None and content.broken:
            self._lose(span, f'the chunk could be read in part only: {content.broken}')
        return content

    def _index(self, span: Span) -> None:
        """Count the messages that a lost chunk held: its index stands behind it."""
        self._file.seek(span.start)
        head = self._file.read(_INDEX_HEAD.size)
        if min(span.length, len(head)) < _INDEX_HEAD.size:
            raise DamagedError('the message index is too short', span.offset, span.opcode)
        _, size = _INDEX_HEAD.unpack(head)
        if size + _INDEX_HEAD.size != span.length:
            # Its length is wrong, so the next record does not start where it ends.
            raise DamagedError('the lengths in the message index differ', span.offset)
        if self._lost_chunk is not None:
            count = size // _INDEX_ENTRY
            self._lost_chunk.messages = (self._lost_chunk.messages or 0) + count

    def _lose(self, span: Span, reason: str) -> Loss:
        self.losses.append(Loss(span.offset, span.end - span.offset, reason))
        return self.losses[-1]

    def _give_up(self, damage: DamagedError) -> None:
        """Note the rest of the file as lost, unless it was but an index that is cut off."""
        left = self._size - damage.offset
        if self._is_cut_index(damage.offset, damage.opcode, left):
            return
        reason = damage.reason
        if damage.opcode == 0 and self._only_zeros(damage.offset):
            reason = 'there are only zeros from here to the end'
        self.losses.append(Loss(damage.offset, left, reason))

    def _is_cut_index(self, offset: int, opcode: int, left: int) -> bool:
        """Tell whether the file ends within what is made anew, as after a kill or a full disk."""
        self._file.seek(offset + 1)
        head = self._file.read(_CUT_HEAD)
        if opcode == Opcode.MESSAGE_INDEX:
            if len(head) < _CUT_INDEX.size:
                return True
            length, _, size = _CUT_INDEX.unpack_from(head)
            return bool(length == size + _INDEX_HEAD.size and left < length + 9)
        if opcode == Opcode.METADATA:
            return head[8:] == struct.pack('<I', len(RECORD_NAME)) + RECORD_NAME.encode()
        return opcode == Opcode.DATA_END and left < len(MAGIC) + 1 + _DATA_END_LENGTH

    def _only_zeros(self, offset: int) -> bool:
        self._file.seek(offset)
        return not any(any(piece) for piece in iter(lambda: self._file.read(_PIECE), b''))
