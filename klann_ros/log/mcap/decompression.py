"""
Decompression limits: the memory that unpacked chunks and messages may take.

A kilobyte can unpack to gigabytes. The size that a chunk claims is not believed:

- up to ``MIN_LIMIT``, or ``MAX_RATIO`` times its packed size, it is unpacked in pieces;
- above that, a streaming pass that keeps nothing has to confirm its declared size or CRC;
- above :func:`memory_limit` it is refused.

:class:`DecompressionBudget` bounds the time spent on bytes that turn out to be useless.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
import os
from pathlib import Path
import sys
from typing import TypeAlias
import zlib

from klann_ros.sanitize.text import printable

# The Python of a browser (Pyodide) lacks these, that of Windows `resource`: without it no limit
# is known, and without `lz4` or `zstandard` only uncompressed chunks are read.
try:
    import resource
except ImportError:
    resource = None  # type: ignore[assignment]
try:
    from lz4 import frame as lz4_frame  # type: ignore[import-untyped] # lz4 has no types
except ImportError:
    lz4_frame = None
try:
    import zstandard
except ImportError:
    zstandard = None  # type: ignore[assignment]

Bytes: TypeAlias = bytes | bytearray
_Decompressor: TypeAlias = Callable[[Bytes, int], Iterator[bytes]]

MIN_LIMIT = 40 * 1024 * 1024
"""Unpacked size that any chunk or message may have without a proof [bytes]; 1 MB is usual."""

MAX_RATIO = 8
"""Compression ratio up to which a larger chunk needs no proof, such as a large image."""

MEMORY_SHARE = 8
"""Part of the available memory that one chunk may fill; `recover` takes three times its size."""

FREE_RATIO = 64
"""Useless bytes that may be unpacked per packed byte without a charge."""

_FREE_PER_CHUNK = 16 * 1024
_BUDGET = 256 * 1024 * 1024
_PIECE_SIZE = 1024 * 1024


class DecompressionBudget:
    """
    The useless bytes that one pass over a file may still unpack.

    A sound file never uses it up. After that the file is still read, but each chunk may hold only
    a fixed multiple of useless bytes for each of its packed bytes.
    """

    def __init__(self) -> None:
        # Negative after the chunk that used it up [bytes].
        self.left = _BUDGET

    def allowed(self, packed: int) -> int:
        """Return the useless bytes that a chunk of a packed size [bytes] may hold."""
        return max(self.left, 0) + FREE_RATIO * packed + _FREE_PER_CHUNK

    def charge(self, wasted: int, packed: int) -> None:
        """Subtract the useless bytes of a chunk."""
        self.left -= max(0, wasted - FREE_RATIO * packed)


class DecompressionError(ValueError):
    """Compressed bytes that are damaged or refused; `unpacked` is the size reached [bytes]."""

    def __init__(self, reason: str, unpacked: int = 0, *, is_refusal: bool = False) -> None:
        super().__init__(f'refused: {reason}' if is_refusal else reason)
        self.unpacked = unpacked
        self.is_refusal = is_refusal


def decompress(
    data: Bytes, compression: str, size: int, crc: int, budget: DecompressionBudget
) -> Bytes:
    """
    Unpack the content of a chunk and check its declared size [bytes] and CRC-32 (0 for none).

    A DecompressionError means that the compression is unknown, that the bytes are damaged, or that
    they exceed a limit; the budget is charged for them.
    """
    try:
        pieces = _DECOMPRESSORS[compression]
    except KeyError:
        raise DecompressionError(
            f"the compression '{printable(compression)}' is not known"
        ) from None
    try:
        if pieces is None:
            _check(len(data), zlib.crc32(data) if crc else 0, size, crc)
            return data
        return _unpack(pieces, data, size, crc, budget)
    except DecompressionError as error:
        budget.charge(error.unpacked or len(data), len(data))
        raise


def _unpack(
    pieces: _Decompressor, data: Bytes, size: int, crc: int, budget: DecompressionBudget
) -> Bytes:
    """Return the unpacked data, within the limits of its size and of the budget."""
    packed = len(data)
    limit = min(max(MIN_LIMIT, MAX_RATIO * packed), budget.allowed(packed))
    memory = memory_limit() if size > MIN_LIMIT else MIN_LIMIT
    if max(limit, MIN_LIMIT) < size <= memory and budget.left > 0:
        for _ in _checked(pieces, data, size, crc, size):
            pass
        limit = size
    unpacked = bytearray()
    try:
        for piece in _checked(pieces, data, size, crc, min(limit, max(memory, MIN_LIMIT))):
            # It grows in place, which takes half the memory of a join.
            unpacked += piece
    except MemoryError as error:
        reason = 'there is no memory for it'
        raise DecompressionError(reason, len(unpacked), is_refusal=True) from error
    return unpacked


def _checked(
    pieces: _Decompressor, data: Bytes, size: int, crc: int, limit: int
) -> Iterator[bytes]:
    """Yield the unpacked pieces; raise where they disagree with the declared size and CRC."""
    unpacked_size = 0
    computed_crc = 0
    try:
        for piece in pieces(data, min(limit + 1, _PIECE_SIZE)):
            unpacked_size += len(piece)
            if unpacked_size > limit:
                _check_memory(size)
                useless = limit < max(MIN_LIMIT, MAX_RATIO * len(data))
                reason = f'its {len(data)} bytes unpack to more than {limit} bytes, the limit '
                reason += 'behind too many useless bytes' if useless else 'without a proof'
                raise DecompressionError(f'the chunk cannot be unpacked ({reason})', unpacked_size)
            if crc:
                computed_crc = zlib.crc32(piece, computed_crc)
            yield piece
    except (zstandard.ZstdError, RuntimeError) as error:
        text = f'the chunk cannot be unpacked ({error})'
        raise DecompressionError(text, unpacked_size) from None
    _check(unpacked_size, computed_crc, size, crc)


def _check(size: int, crc: int, declared_size: int, declared_crc: int) -> None:
    if crc != declared_crc:
        raise DecompressionError('the CRC of the chunk does not match its content', size)
    if not crc and size != declared_size:
        reason = f'the chunk unpacks to {size} bytes, {declared_size} are recorded'
        raise DecompressionError(reason, size)


def decompress_message(data: bytes, budget: DecompressionBudget) -> bytes:
    """Unpack a message that is a zstd frame; a DecompressionError as in `decompress`."""
    limit = max(MIN_LIMIT, MAX_RATIO * len(data))
    try:
        size = zstandard.frame_content_size(data)
        if size > MIN_LIMIT:
            _check_memory(size)
            return bytes(decompress(data, 'zstd', size, 0, budget))
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=limit)
    except zstandard.ZstdError as error:
        raise DecompressionError(str(error)) from None


def _check_memory(size: int) -> None:
    """Refuse an unpacked size [bytes] above the memory limit."""
    limit = memory_limit()
    if size > limit:
        reason = f'{size / 1e6:.0f} MB unpacked, above the limit of {limit / 1e6:.0f} MB'
        raise DecompressionError(reason, is_refusal=True)


def memory_limit() -> int:
    """Return the largest unpacked size that the available memory allows [bytes]."""
    return max(MIN_LIMIT, available_memory() // MEMORY_SHARE)


def available_memory() -> int:
    """
    Return the memory that this process may still take [bytes].

    The least of MemAvailable in /proc/meminfo, the limits of its control groups (versions 1 and
    2), and RLIMIT_AS.
    """
    limits = [2**40, *_group_memory()]
    with suppress(OSError, ValueError, IndexError):
        limits.append(int(_read_text('/proc/meminfo').split('MemAvailable:')[1].split()[0]) * 1024)
    soft = -1
    if sys.platform != 'win32' and resource:
        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
        with suppress(OSError, ValueError):  # macOS has no /proc
            limits.append(os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE'))
    # RLIM_INFINITY is -1.
    if sys.platform != 'win32' and soft >= 0:
        with suppress(OSError, ValueError):
            pages = int(_read_text('/proc/self/statm').split()[0])
            limits.append(soft - pages * os.sysconf('SC_PAGE_SIZE'))
    return max(0, min(limits))


def _group_memory() -> Iterator[int]:
    """Yield the memory that each control group of this process may still take [bytes]."""
    with suppress(OSError, ValueError):
        for line in _read_text('/proc/self/cgroup').splitlines():
            number, controllers, name = line.split(':', 2)
            if number == '0':
                root = '/sys/fs/cgroup'
                limit = 'memory.max'
                usage = 'memory.current'
            elif 'memory' in controllers.split(','):
                root = '/sys/fs/cgroup/memory'
                limit = 'memory.limit_in_bytes'
                usage = 'memory.usage_in_bytes'
            else:
                continue
            # A container may mount its own group as the root.
            place = Path(root) / name.lstrip('/')
            for folder in [place, *place.parents][: len(Path(name).parts) + 1]:
                with suppress(OSError, ValueError):
                    used = int(_read_text(folder / usage)) - _file_cache(folder)
                    yield int(_read_text(folder / limit)) - used


def _file_cache(folder: Path) -> int:
    """Return the file cache of a control group, which makes room for programs [bytes]."""
    with suppress(OSError, ValueError):
        for line in _read_text(folder / 'memory.stat').splitlines():
            key, size = line.split()
            if key == 'inactive_file':
                return int(size)
    return 0


def _read_text(path: str | Path) -> str:
    return Path(path).read_text(encoding='utf-8')


def _decompress_zstd(data: Bytes, size: int) -> Iterator[bytes]:
    """Yield pieces of at most a size."""
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        yield from iter(lambda: stream.read(size), b'')


def _decompress_lz4(data: Bytes, size: int) -> Iterator[bytes]:
    """Yield pieces of at most a size; input in pieces too, as the library copies the rest."""
    frame = lz4_frame.LZ4FrameDecompressor()
    position = 0
    while not frame.eof:
        packed: Bytes = b''
        if frame.needs_input:
            if position >= len(data):
                raise RuntimeError('it is cut off')
            end = position + _PIECE_SIZE
            packed = data[position:end]
            position = end
        yield frame.decompress(packed, max_length=size)


_DECOMPRESSORS: dict[str, _Decompressor | None] = {'': None}
if zstandard:
    _DECOMPRESSORS['zstd'] = _decompress_zstd
if lz4_frame:
    _DECOMPRESSORS['lz4'] = _decompress_lz4

COMPRESSIONS = tuple(name.encode() for name in _DECOMPRESSORS)
"""The names of the known compressions, as bytes."""
