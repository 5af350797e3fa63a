"""The summary at the end of a closed file: channels, statistics, and the index of its chunks."""

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property
from operator import le
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex, Statistics

from .channels import Channels
from .container import check_summary, Footer, read, spans
from .parsing import parse

_INDEX_HEAD = 15
_INDEX_ENTRY = 16


class RecordPlace(NamedTuple):
    """Of a record its opcode, its end, and how much it holds [bytes], if that is said."""

    opcode: int
    end: int
    size: int | None = None


@dataclass
class Summary:
    """What a summary says."""

    # Whether the file has an end that holds, with a summary or without.
    closed: bool = False
    # Where it starts [bytes]; 0 without any.
    start: int = 0
    # Whether it has a CRC that held.
    verified: bool = False
    # What it says of these.
    channels: Channels = field(default_factory=Channels)
    chunks: list[ChunkIndex] = field(default_factory=list)
    statistics: Statistics | None = None
    # Where such records start [bytes].
    metadata: list[int] = field(default_factory=list)
    attachments: list[int] = field(default_factory=list)
    # Which records it says where, under where they start [bytes].
    places: dict[int, RecordPlace] = field(default_factory=dict)

    @cached_property
    def is_sound(self) -> bool:
        """
        Return whether the records that it names lie one behind the other, before it.

        One that is named often, or that lies in another, could be asked for often.
        """
        named = len(self.chunks) + len(self.metadata) + len(self.attachments)
        ends = [self.places[start].end for start in self._starts]
        following = [*self._starts, self.start][1:]
        return named == len(self.places) and all(map(le, ends, following))

    @cached_property
    def names_all(self) -> bool:
        """Return whether it says where each chunk, attachment and metadata record is."""
        said = self.statistics
        if said is None:
            return False
        counts = said.chunk_count, said.metadata_count, said.attachment_count
        found = len(self.chunks), len(self.metadata), len(self.attachments)
        return counts == found and self.is_sound

    @cached_property
    def is_index(self) -> bool:
        """
        Return whether everything in the file can be found by it.

        Recorders may leave out any part, and may put messages outside of chunks.
        """
        said = self.statistics
        return (
            said is not None
            and len(self.chunks) > 0
            and said.channel_count == len(self.channels.numbers())
            and self.names_all
            and self._names_all_topics()
            and self._messages_in_chunks(said)
        )

    def note(self, start: int, place: RecordPlace) -> None:
        """Take up where a record is."""
        self.places[start] = place

    def forget_places(self) -> None:
        """Let nobody ask where records are."""
        self.places.clear()
        self._starts.clear()

    def kind_at(self, offset: int) -> int | None:
        """Return of which kind it says the record at an offset is; None if it says nothing."""
        place = self.places.get(offset)
        return None if place is None else place.opcode

    def end_of(self, offset: int) -> int | None:
        """Return where it says that the record at an offset ends; None if it says nothing."""
        place = self.places.get(offset)
        return None if place is None else place.end

    def size_at(self, offset: int) -> int | None:
        """Return how much it says that a record holds [bytes]; None if it says nothing."""
        place = self.places.get(offset)
        return None if place is None else place.size

    def first_from(self, offset: int) -> int | None:
        """Return where the first of the records that it names starts, from an offset on."""
        number = bisect_left(self._starts, offset)
        return self._starts[number] if number < len(self._starts) else None

    @cached_property
    def _starts(self) -> list[int]:
        return sorted(self.places)

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
    """Return the summary of a file; an empty one if it has none."""
    summary = Summary(closed=True)
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
            chunk = parse(ChunkIndex, read(file, span), span.offset)
            summary.chunks.append(chunk)
            start, length = chunk.chunk_start_offset, chunk.chunk_length
            summary.note(start, RecordPlace(Opcode.CHUNK, start + length, chunk.compressed_size))
        elif span.opcode == Opcode.METADATA_INDEX:
            found = parse(MetadataIndex, read(file, span), span.offset)
            summary.metadata.append(found.offset)
            summary.note(found.offset, RecordPlace(Opcode.METADATA, found.offset + found.length))
        elif span.opcode == Opcode.ATTACHMENT_INDEX:
            index = parse(AttachmentIndex, read(file, span), span.offset)
            summary.attachments.append(index.offset)
            end = index.offset + index.length
            summary.note(index.offset, RecordPlace(Opcode.ATTACHMENT, end, index.data_size))
        elif span.opcode == Opcode.STATISTICS:
            summary.statistics = parse(Statistics, read(file, span), span.offset)
    return summary
