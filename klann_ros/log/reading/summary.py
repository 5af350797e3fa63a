"""The summary at the end of a closed file: channels, statistics, and the index of its chunks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex, Statistics

from .channels import Channels
from .container import check_summary, Footer, read, spans
from .parsing import parse

if TYPE_CHECKING:
    from typing import BinaryIO

_INDEX_HEAD = 15
_INDEX_ENTRY = 16


@dataclass
class Summary:
    """What a summary says, where it starts, whether its CRC held; offsets in [bytes]."""

    start: int = 0
    verified: bool = False
    channels: Channels = field(default_factory=Channels)
    chunks: list[ChunkIndex] = field(default_factory=list)
    metadata: list[int] = field(default_factory=list)
    attachments: list[int] = field(default_factory=list)
    lengths: dict[int, int] = field(default_factory=dict)
    statistics: Statistics | None = None

    @property
    def is_index(self) -> bool:
        """
        Return whether everything in the file can be found by it.

        Recorders may leave out any part, and may put messages outside of chunks.
        """
        said = self.statistics
        if said is None or not self.chunks:
            return False
        counts = (said.chunk_count, said.channel_count, said.metadata_count, said.attachment_count)
        found = (
            len(self.chunks),
            len(self.channels.numbers()),
            len(self.metadata),
            len(self.attachments),
        )
        return counts == found and self._names_all_topics() and self._messages_in_chunks(said)

    def ends(self) -> dict[int, int]:
        """Return where the chunks end and other records that it names, under where they start."""
        ends = {chunk.chunk_start_offset: chunk.chunk_length for chunk in self.chunks}
        ends |= self.lengths
        return {start: start + length for start, length in ends.items()}

    def _names_all_topics(self) -> bool:
        channels = set(self.channels.numbers())
        channels.update(number for chunk in self.chunks for number in chunk.message_index_offsets)
        return all(self.channels.topic(number) is not None for number in channels)

    def _messages_in_chunks(self, said: Statistics) -> bool:
        """Compare the sizes of the message indexes, where there are any, with the statistics."""
        size = sum(chunk.message_index_length for chunk in self.chunks)
        heads = sum(len(chunk.message_index_offsets) for chunk in self.chunks)
        return size == 0 or size - _INDEX_HEAD * heads == _INDEX_ENTRY * said.message_count


def read_summary(file: BinaryIO, footer: Footer) -> Summary:
    """
    Return the summary of a file; an empty one if it has none.

    Raises
    ------
    DamagedError
        Its CRC does not hold, or what stands there is no summary.

    """
    summary = Summary()
    if footer.summary_start == 0:
        return summary
    check_summary(file, footer)
    summary.start, summary.verified = footer.summary_start, footer.crc != 0
    for span in spans(file, footer.summary_start, footer.offset):
        if span.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            summary.channels.add(
                span.opcode, read(file, span), span.offset, verified=summary.verified
            )
        elif span.opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(parse(ChunkIndex, read(file, span), span.offset))
        elif span.opcode == Opcode.METADATA_INDEX:
            place = parse(MetadataIndex, read(file, span), span.offset)
            summary.metadata.append(place.offset)
            summary.lengths[place.offset] = place.length
        elif span.opcode == Opcode.ATTACHMENT_INDEX:
            index = parse(AttachmentIndex, read(file, span), span.offset)
            summary.attachments.append(index.offset)
            summary.lengths[index.offset] = index.length
        elif span.opcode == Opcode.STATISTICS:
            summary.statistics = parse(Statistics, read(file, span), span.offset)
    return summary
