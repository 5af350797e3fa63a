"""A file whose messages were compressed one by one: each is a zstd frame."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from klann_ros.log.mcap.decompression import (
    decompress_message,
    DecompressionBudget,
    DecompressionError,
)
from klann_ros.log.records import Message, Topic
from klann_ros.sanitize.text import printable

from .block import block_of_messages, MessageBlock
from .sources import Source, Topics
from .storage import Overview, Problems, Salvage, Storage
from .zstd_file import ZSTD_MAGIC

_ENCODING = 'cdr'
# A block is finished when its messages are larger [bytes].
_BLOCK = 4 * 1024 * 1024


def is_packed(data: bytes) -> bool:
    """
    Return whether a message is compressed.

    No CDR begins like this, and metadata do not always tell: reindexing forgets it.
    """
    return data.startswith(ZSTD_MAGIC)


class PackedMessages:
    """
    A storage whose messages are unpacked as they are read.

    Parameters
    ----------
    packed
        The storage as it is.

    """

    def __init__(self, packed: Storage) -> None:
        self._packed = packed
        # All but its messages is as it is.
        self.path, self.name, self.size = packed.path, packed.name, packed.size
        self.profile, self.closed = packed.profile, packed.closed
        self.problems, self.holes = packed.problems, packed.holes
        self.overview, self.first_data = packed.overview, packed.first_data
        self.metadata_at, self.attachment_at = packed.metadata_at, packed.attachment_at
        self.close = packed.close

    def sources(self, overview: Overview) -> Iterator[Source]:
        """Yield what can be read by itself."""
        for source in self._packed.sources(overview):
            yield Source(source.start, source.end, partial(self._read, source))

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large pieces as they stand in it, and where each is [bytes]."""
        for offset, block in self._packed.blocks():
            for piece in _blocks(block, self.problems):
                yield offset, piece

    def salvage(self) -> Salvage:
        """Return a pass over all that is intact in it."""
        return _PackedSalvage(self._packed.salvage(), self.name)

    def _read(self, source: Source, topics: Topics) -> Iterator[Message]:
        unpacker = Unpacker(self.problems.note_whole)
        return filter(None, map(unpacker.message, source.read(topics)))


class Unpacker:
    """
    Unpacks messages one after the other; to be used from one thread only.

    Parameters
    ----------
    tell
        Is told of each message that cannot be unpacked, in one line.

    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._budget = DecompressionBudget()

    def message(self, message: Message) -> Message | None:
        """Return a message as it was published; None if it cannot be unpacked."""
        if not _is_cdr(message.topic):
            return message
        data = self.data(message.data, message.topic)
        return None if data is None else replace(message, data=data)

    def data(self, packed: bytes, topic: Topic) -> bytes | None:
        """Return the bytes of a message as they were published; None as :meth:`message`."""
        if not packed.startswith(ZSTD_MAGIC):
            return packed
        try:
            return decompress_message(packed, self._budget)
        except DecompressionError as error:
            reason = str(error)
        self._tell(f'messages of {printable(topic.name)} cannot be unpacked: {reason}')
        return None


class _PackedSalvage:
    """All that is intact in such a file; see :class:`~klann_ros.log.read.storage.Salvage`."""

    def __init__(self, packed: Salvage, name: str) -> None:
        self.lost = packed.lost
        self.remarks = packed.remarks
        self.attachments, self.metadata = packed.attachments, packed.metadata
        self._packed = packed
        self._name = name

    def messages(self) -> Iterator[Message]:
        """Yield all intact messages in the order in which they stand in it."""
        damaged: Counter[str] = Counter()
        unpacker = Unpacker(lambda text: damaged.update((text,)))
        yield from filter(None, map(unpacker.message, self._packed.messages()))
        for text, count in damaged.items():
            self.lost.append(f'{self._name}: {count} {text}')


def _blocks(block: MessageBlock, problems: Problems) -> Iterator[MessageBlock]:
    """Yield a block with its messages unpacked, in several if they are large."""
    unpacker = Unpacker(problems.note_whole)
    packed = {number: topic for number, topic in block.topics.items() if _is_cdr(topic)}
    rows: list[int] = []
    found: list[bytes] = []
    size = 0
    places = zip(
        block.heads['channel'].tolist(), block.starts.tolist(), block.sizes.tolist(), strict=True
    )
    for row, (channel, start, length) in enumerate(places):
        end = start + length
        whole = block.data[start:end].tobytes()
        data = unpacker.data(whole, packed[channel]) if channel in packed else whole
        if data is None:
            continue
        rows.append(row)
        found.append(data)
        size += len(data)
        if size > _BLOCK:
            yield block_of_messages(block.heads[rows], found, block.topics)
            rows, found, size = [], [], 0
    yield block_of_messages(block.heads[rows], found, block.topics)


def _is_cdr(topic: Topic) -> bool:
    return topic.message_encoding == _ENCODING
