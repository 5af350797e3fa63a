"""Crash-safe files: fsync, a space reserve for a full disk, and detection of outside changes."""

from collections.abc import Callable
from contextlib import suppress
from enum import Enum
import errno
import os
from pathlib import Path
import shutil
import sys
import tempfile
from typing import BinaryIO

from klann_ros.log.errors import LowSpaceError
from klann_ros.sanitize.text import printable

if sys.platform != 'win32':
    import fcntl

RESERVE_SIZE = 512 * 1024
"""A chunk with its index, the open chunk, the summary and metadata.yaml fit into it [bytes]."""

NOT_FOUND = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ESTALE)
"""Errors of a path that names nothing, and of a file that another host removed."""

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
# macOS and Windows have no fdatasync; fsync does the same and more.
_sync = getattr(os, 'fdatasync', os.fsync)
# A full disk must find room for the rest of the buffer in the reserve [bytes].
_BUFFER_SIZE = 64 * 1024
# One line with a folder and two files in it [characters].
_MAX_FAULT_LENGTH = 2000


class DiskReserve:
    """
    Unnamed file that takes up disk space until the end of a run needs it.

    Without a name it cannot be removed by accident, and the end of the process, also by kill -9,
    frees the space. A system that cannot allocate space has no reserve. Raises an OSError if the
    folder's disk has too little space.
    """

    def __init__(self, folder: Path) -> None:
        # The error of the disk that made the reserve release its space.
        self.spent: OSError | None = None
        self._size = 0
        self._descriptor = -1
        if sys.platform == 'linux':
            with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
                self._descriptor = os.dup(file.fileno())
            self.grow(RESERVE_SIZE)
            if self.spent is not None:
                raise OSError(self.spent.errno, self.spent.strerror, str(folder))

    def grow(self, size: int) -> None:
        """Grow to a size [bytes]; release everything where the disk has too little space."""
        if sys.platform != 'linux' or self._descriptor < 0 or size <= self._size:
            return
        try:
            os.posix_fallocate(self._descriptor, self._size, size - self._size)
        except OSError as error:
            self.release_if_full(error)
        else:
            self._size = size

    def release_if_full(self, error: OSError) -> bool:
        """Release the space if the error means a full disk; return whether that was done."""
        if self._descriptor < 0 or error.errno not in _DISK_FULL:
            return False
        self.spent = error
        self.release()
        return True

    def release(self) -> None:
        """Release the space. Never raises."""
        if self._descriptor < 0:
            return
        descriptor = self._descriptor
        self._descriptor = -1
        with suppress(OSError):
            os.close(descriptor)

    def __del__(self) -> None:
        self.release()


def free_space(folder: Path) -> int:
    """Return the space free for this user on a folder's disk [bytes]; the folder may not exist."""
    existing = folder.absolute()
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    return shutil.disk_usage(existing).free


def check_free_space(folder: Path, min_free: int) -> None:
    """Raise a LowSpaceError if a folder's disk has less free space [bytes]; 0 is no limit."""
    if min_free > 0 and (free := free_space(folder)) < min_free:
        raise LowSpaceError(folder, free, min_free)


class FileFault(Enum):
    """Outside change of a file that is being written."""

    GONE = 'was removed, moved or replaced'
    CHANGED = 'was cut off, overwritten or appended to'


class RunFaults:
    """
    Outside changes of a run that is being written, which the disk does not report as errors.

    The thread that writes the run adds them; any thread may read `active`. `on_fault` receives one
    line for each new fault.
    """

    def __init__(self, on_fault: Callable[[str], object] = lambda _: None) -> None:
        self._on_fault = on_fault
        self._active: dict[str, str] = {}

    @property
    def active(self) -> tuple[str, ...]:
        """Return the present faults, one line each: the last one of each subject."""
        return tuple(self._active.values())

    def add(self, subject: str, text: str, reaction: str = '') -> None:
        """Add a fault of a subject; report it, with the reaction, unless it is active already."""
        line = printable(text, _MAX_FAULT_LENGTH)
        if self._active.get(subject) != line:
            self._active[subject] = line
            self._on_fault(f'{line}; {reaction}' if reaction else line)

    def clear(self, subject: str) -> None:
        """Remove the fault of a subject."""
        self._active.pop(subject, None)

    def __contains__(self, subject: str) -> bool:
        return subject in self._active


class DurableFile:
    """
    New file that buffers whole records and writes them in large blocks.

    Python's buffered writer retries data that could not be written at each flush and close. Here
    the first error is final: it is stored in ``failure``, every later call raises it, and closing
    truncates a partial block, so that the file ends with a whole record. A full disk is final
    only if the reserve cannot help.

    The open file is locked, but not on Windows: see :func:`is_being_written`. All methods but
    :meth:`close` raise an OSError if the disk refuses.
    """

    def __init__(self, path: Path, reserve: DiskReserve | None = None) -> None:
        self.path = path
        # The first error.
        self.failure: OSError | None = None
        # Size of the data known to be in the file, and to be on the disk [bytes].
        self.written_size = self.synced_size = self._flushed = 0
        self._reserve = reserve
        self._buffer = bytearray()
        self._descriptor = -1
        # Appending: a file that another process truncates stays shorter than the data.
        # Binary, as Windows would write a line feed as two bytes.
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL | getattr(os, 'O_BINARY', 0)
        self._descriptor = os.open(path, flags, 0o666)
        if sys.platform != 'win32':
            with suppress(OSError):  # some network disks have no locks
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def append(self, data: bytes) -> int:
        """Buffer one or more whole records; return their size [bytes]."""
        self.raise_failure()
        self._buffer += data
        if len(self._buffer) > _BUFFER_SIZE:
            self._flush()
        return len(data)

    @property
    def size(self) -> int:
        """Return the size of all data so far, the buffer included [bytes]."""
        return self._flushed + len(self._buffer)

    def raise_failure(self) -> None:
        """Raise the error of an earlier call, if any."""
        if self.failure is not None:
            raise self.failure

    def _flush(self) -> None:
        self.raise_failure()
        pending = memoryview(self._buffer)
        done = 0
        while done < len(pending):
            done += self._write_block(pending[done:])
        self._flushed += len(self._buffer)
        self._buffer = bytearray()
        self.written_size = self._flushed

    def _write_block(self, block: memoryview) -> int:
        try:
            return os.write(self._descriptor, block)
        except OSError as error:
            if self._reserve is not None and self._reserve.release_if_full(error):
                return 0
            self.failure = error
            raise

    def sync(self) -> None:
        """Write the buffer and fsync: the data survives a power failure."""
        self._flush()
        try:
            _sync(self._descriptor)
        except OSError as error:
            # The state of everything after the last fsync is unknown.
            self.written_size = self.synced_size
            self.failure = error
            raise
        self.synced_size = self._flushed

    def find_fault(self) -> FileFault | None:
        """Compare the path and the size with the written data; None if both match."""
        try:
            status = os.fstat(self._descriptor)
            if not os.path.samestat(self.path.stat(), status):
                return FileFault.GONE
        except PermissionError:
            return None  # without access no change is visible
        except OSError as error:
            if error.errno in NOT_FOUND:
                return FileFault.GONE
            raise
        is_longer = status.st_size > self._flushed and self.failure is None
        return FileFault.CHANGED if is_longer or status.st_size < self._flushed else None

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; after an error truncate it to its last whole record. Never raises."""
        if self._descriptor < 0:
            return
        descriptor = self._descriptor
        self._descriptor = -1
        # An error here follows one that was reported, or all data is synced.
        with suppress(OSError):
            if self.failure is not None and os.fstat(descriptor).st_size > self._flushed:
                os.ftruncate(descriptor, self._flushed)
        with suppress(OSError):
            os.close(descriptor)


def is_being_written(file: BinaryIO) -> bool:
    """Return whether a DurableFile of any process holds the lock of this open file."""
    if sys.platform != 'win32':  # where no recorder runs
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
        fcntl.flock(file.fileno(), fcntl.LOCK_UN)
    return False
