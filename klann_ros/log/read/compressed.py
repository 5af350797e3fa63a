"""Compressed logs: a file that is zstd as a whole, and messages that are each a zstd frame."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
from typing import BinaryIO

from klann_ros.log.browser import zstandard
from klann_ros.log.errors import NotALogError
from klann_ros.log.mcap import decompression
from klann_ros.log.records import Message, Topic
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .block import block_of_messages, MessageBlock
from .storage import Overview, Source, Storage, Topics
from .temporary import TemporaryFile

COMPRESSED_SUFFIXES = ('.zstd', '.zst')
"""Suffixes of compressed files."""

MIN_FILE_LIMIT = 2**30
"""Unpacked size that any compressed file may have [bytes]."""

MAX_FILE_RATIO = 64
"""Compression ratio up to which a file may unpack to more than MIN_FILE_LIMIT."""

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
"""The first bytes of a zstd frame."""

# No piece of a file unpacks to more than 32 MiB: 4 bytes may repeat a byte 2^17 times [bytes].
_PIECE_SIZE = 1024

_ENCODING = 'cdr'
# Size of messages that finishes a block of unpacked ones [bytes].
_MESSAGE_BLOCK_SIZE = 4 * 1024 * 1024


def unpack(path: Path, is_log: Callable[[bytes], bool]) -> tuple[TemporaryFile, str]:
    """
    Unpack a file to a temporary one; return that, and the damage of the file, '' without any.

    `is_log` says whether a file with some first bytes is a log. A NotALogError means that the file
    cannot be read, that its content is no log, that the disk has no room, or that it unpacks to
    more than a file of its size may.
    """
    name = path.name
    for suffix in COMPRESSED_SUFFIXES:
        name = name.removesuffix(suffix)
    try:
        with open_regular(path) as file:
            unpacking = _Unpacking(path, file, is_log)
            unpacked = TemporaryFile(path, name or 'log')
            unpacked.write(unpacking.pieces())
            return unpacked, unpacking.damage
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None


class _Unpacking:
    """Unpacks a file up to its damage."""

    def __init__(self, path: Path, file: BinaryIO, is_log: Callable[[bytes], bool]) -> None:
        self.damage = ''
        self._path = path
        self._file = file
        self._limit = max(MIN_FILE_LIMIT, MAX_FILE_RATIO * os.fstat(file.fileno()).st_size)
        self._is_log = is_log

    def pieces(self) -> Iterator[bytes]:
        done = 0
        for piece in filter(None, self._unpacked()):
            if not done and not self._is_log(piece):
                reason = 'it is a zstd file, but its content is neither MCAP nor SQLite'
                raise NotALogError(self._path, reason)
            done += len(piece)
            if done > self._limit:
                reason = f'it unpacks to more than {self._limit / 1e6:.0f} MB'
                raise NotALogError(
                    self._path, f'{reason}; if that is right, unpack it by `zstd -d` first'
                )
            yield piece
        if not done:
            reason = self.damage or 'there is nothing in it'
            raise NotALogError(self._path, f'it is a zstd file, but {reason}')

    def _unpacked(self) -> Iterator[bytes]:
        unpacker = None
        piece = self._file.read(_PIECE_SIZE)
        while piece:
            unpacker = unpacker or zstandard.ZstdDecompressor().decompressobj()
            try:
                yield unpacker.decompress(piece)
            except (zstandard.ZstdError, MemoryError) as error:
                self.damage = f'it can be unpacked in part only: {printable(error)}'
                return
            rest = b''
            if unpacker.eof:
                rest, unpacker = unpacker.unused_data, None
            piece = rest + self._file.read(_PIECE_SIZE - len(rest))
        if unpacker is not None:
            self.damage = 'it is cut off: its last zstd frame has no end'


def is_compressed(data: bytes) -> bool:
    """Return whether a message is compressed: reindexing loses the metadata that say so."""
    return data.startswith(ZSTD_MAGIC)


class CompressedMessages:
    """A storage whose messages are unpacked as they are read."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.path, self.name, self.size = storage.path, storage.name, storage.size
        self.closed = storage.closed
        self.problems, self.gaps, self.remarks = storage.problems, storage.gaps, storage.remarks
        self.overview, self.first_data = storage.overview, storage.first_data
        self.metadata_at, self.attachment_at = storage.metadata_at, storage.attachment_at
        self.close = storage.close

    def sources(self, overview: Overview) -> Iterator[Source]:
        """Yield the parts that can be read separately."""
        for source in self._storage.sources(overview):
            yield Source(source.start, source.end, partial(self._read, source))

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large blocks in the order of the file, with their offsets."""
        damaged: Counter[str] = Counter()
        unpacker = _Unpacker(lambda text: damaged.update((text,)))
        for offset, block in self._storage.blocks():
            for unpacked in _unpacked_blocks(block, unpacker):
                yield offset, unpacked
        for text, count in damaged.items():
            self.problems.note_whole(f'{count} {text}', is_loss=True)

    def _read(self, source: Source, topics: Topics) -> Iterator[Message]:
        unpacker = _Unpacker(self.problems.note_whole)
        return filter(None, map(unpacker.message, source.read(topics)))


class _Unpacker:
    """Unpacks messages in one thread; reports each that it cannot unpack."""

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._budget = decompression.DecompressionBudget()

    def message(self, message: Message) -> Message | None:
        """Return a message as it was published; None if it cannot be unpacked."""
        if message.topic.message_encoding != _ENCODING:
            return message
        data = self.data(message.data, message.topic)
        return None if data is None else replace(message, data=data)

    def data(self, packed: bytes, topic: Topic) -> bytes | None:
        if not is_compressed(packed):
            return packed
        try:
            return decompression.decompress_message(packed, self._budget)
        except decompression.DecompressionError as error:
            reason = str(error)
        self._report(f'messages of {printable(topic.name)} cannot be unpacked: {reason}')
        return None


def _unpacked_blocks(block: MessageBlock, unpacker: '_Unpacker') -> Iterator[MessageBlock]:
    """Yield a block with its messages unpacked, in several if they are large."""
    topics = {n: topic for n, topic in block.topics.items() if topic.message_encoding == _ENCODING}
    rows: list[int] = []
    found: list[bytes] = []
    size = 0
    channels = block.heads['channel'].tolist()
    places = zip(channels, block.starts.tolist(), block.sizes.tolist(), strict=True)
    for row, (channel, start, length) in enumerate(places):
        end = start + length
        packed = block.data[start:end].tobytes()
        data = unpacker.data(packed, topics[channel]) if channel in topics else packed
        if data is None:
            continue
        rows.append(row)
        found.append(data)
        size += len(data)
        if size > _MESSAGE_BLOCK_SIZE:
            part = block_of_messages(block.heads[rows], found, block.topics)
            rows, found, size = [], [], 0
            del packed, data
            yield part
    yield block_of_messages(block.heads[rows], found, block.topics)
