"""Compressed logs: a file that is zstd as a whole, and messages that are each a zstd frame."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
from typing import BinaryIO

from klann_ros.log.errors import NotALogError
from klann_ros.log.mcap import decompression
from klann_ros.log.records import Message, Topic
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .storage import block_of_messages, MessageBlock, Source, Storage, TemporaryFile, Topics

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
        """Yield the content; a NotALogError if it is no log, or too large."""
        size = 0
        for piece in filter(None, self._unpacked_pieces()):
            if not size and not self._is_log(piece):
                reason = 'it is a zstd file, but its content is neither MCAP nor SQLite'
                raise NotALogError(self._path, reason)
            size += len(piece)
            if size > self._limit:
                reason = f'it unpacks to more than {self._limit / 1e6:.0f} MB'
                raise NotALogError(
                    self._path, f'{reason}; if that is right, unpack it by `zstd -d` first'
                )
            yield piece
        if not size:
            reason = self.damage or 'there is nothing in it'
            raise NotALogError(self._path, f'it is a zstd file, but {reason}')

    def _unpacked_pieces(self) -> Iterator[bytes]:
        """Yield the content of all zstd frames, and note the damage at which it ends."""
        import zstandard  # noqa: PLC0415 - the Python of a browser lacks it

        unpacker = None
        piece = self._file.read(_PIECE_SIZE)
        while piece:
            unpacker = unpacker or zstandard.ZstdDecompressor().decompressobj()
            try:
                yield unpacker.decompress(piece)
            except (zstandard.ZstdError, MemoryError) as error:
                self.damage = f'it can be unpacked in part only: {printable(error)}'
                return
            next_frame = b''
            if unpacker.eof:
                next_frame = unpacker.unused_data
                unpacker = None
            piece = next_frame + self._file.read(_PIECE_SIZE - len(next_frame))
        if unpacker is not None:
            self.damage = 'it is cut off: its last zstd frame has no end'


def is_compressed(data: bytes) -> bool:
    """Return whether a message is compressed: reindexing loses the metadata that say so."""
    return data.startswith(ZSTD_MAGIC)


class CompressedMessages:
    """A storage whose messages are unpacked as they are read."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.path = storage.path
        self.name = storage.name
        self.size = storage.size
        self.closed = storage.closed
        self.problems = storage.problems
        self.gaps = storage.gaps
        self.remarks = storage.remarks
        self.overview = storage.overview
        self.first_data = storage.first_data
        self.metadata = storage.metadata
        self.attachments = storage.attachments
        self.close = storage.close

    def sources(self) -> Iterator[Source]:
        """Yield the parts that can be read separately."""
        for source in self._storage.sources():
            yield Source(source.start, source.end, partial(self._read, source))

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large blocks in the order of the file, with their offsets."""
        faults: Counter[tuple[str, bool]] = Counter()
        unpacker = _Unpacker(lambda text, is_refusal: faults.update(((text, is_refusal),)))
        for offset, block in self._storage.blocks():
            for unpacked in unpacker.blocks(block):
                yield offset, unpacked
        for (text, is_refusal), count in faults.items():
            self.problems.note_whole(f'{count} {text}', is_loss=True, is_refusal=is_refusal)

    def _read(self, source: Source, topics: Topics) -> Iterator[Message]:
        unpacker = _Unpacker(
            lambda text, is_refusal: self.problems.note_whole(text, is_refusal=is_refusal)
        )
        for message in source.read(topics):
            data = unpacker.data(message.data, message.topic)
            if data is not None:
                yield replace(message, data=data)


class _Unpacker:
    """Unpacks messages in one thread; reports each failure, and whether it is a refusal."""

    def __init__(self, report: Callable[[str, bool], object]) -> None:
        self._report = report
        self._budget = decompression.DecompressionBudget()

    def data(self, packed: bytes, topic: Topic | None) -> bytes | None:
        """Return the data of a message as it was published; None if it cannot be unpacked."""
        if topic is None or topic.message_encoding != _ENCODING or not is_compressed(packed):
            return packed
        try:
            return decompression.decompress_message(packed, self._budget)
        except decompression.DecompressionError as error:
            text = f'messages of {printable(topic.name)} cannot be unpacked: {error}'
            self._report(text, error.is_refusal)
            return None

    def blocks(self, block: MessageBlock) -> Iterator[MessageBlock]:
        """Yield a block with its messages unpacked, in several if they are large."""
        indices: list[int] = []
        messages: list[bytes] = []
        size = 0
        for index, channel in enumerate(block.heads['channel'].tolist()):
            data = self.data(block.message(index), block.topics.get(channel))
            if data is None:
                continue
            indices.append(index)
            messages.append(data)
            size += len(data)
            if size > _MESSAGE_BLOCK_SIZE:
                del data
                unpacked = block_of_messages(block.heads[indices], messages, block.topics)
                indices, messages, size = [], [], 0
                yield unpacked
        yield block_of_messages(block.heads[indices], messages, block.topics)
