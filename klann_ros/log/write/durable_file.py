"""Files that survive: what was synced is on the disk, and a full disk leaves no half record."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
import fcntl
import os
from typing import BinaryIO

from klann_ros.log.bag_metadata import FileSummary
from mcap.opcode import Opcode

from .disk_space import DiskReserve
from .file_watch import FileWatch
from .open_folder import OpenFolder

# Where there is no fdatasync (macOS) its slower brother does the same and more.
_sync = getattr(os, 'fdatasync', os.fsync)

# What is not handed over yet when the disk is full has to find room in the reserve.
_BUFFER = 64 * 1024

_CHUNK = bytes([Opcode.CHUNK])


class DurableFile:
    """
    A new file that collects whole records and hands them to the system in large pieces.

    Not Python's buffered writer: that one keeps what it could not write and tries again whenever
    it is flushed, closed or collected. Here the first error is final; it is kept in ``failure``,
    raised by whatever is asked of the file afterwards, and what was written of the last piece is
    cut off on closing, so that the file ends with a whole record. Full is final only where the
    reserve does not help.

    While it is open the file is locked, so that others can tell it from one that was left behind:
    see :func:`is_being_written`.

    Parameters
    ----------
    folder
        Where it is made.
    name
        What it is called, which nothing may be yet.
    reserve
        Space on the same disk that can be given up.

    Attributes
    ----------
    name : str
        Its name.
    watch : FileWatch
        Looks what others do to it.
    failure : OSError or None
        The first error.
    held, synced : int
        How much of what was taken is known to be in the file, and to be on the disk [bytes].

    Raises
    ------
    OSError
        By every method but :meth:`tell` and :meth:`close`: the disk said no.

    """

    def __init__(self, folder: OpenFolder, name: str, reserve: DiskReserve | None = None) -> None:
        self.name = name
        self.failure: OSError | None = None
        self.held = self.synced = self._written = 0
        self._reserve = reserve
        self._buffer = bytearray()
        self._descriptor = -1
        descriptor = folder.create_file(name, os.O_WRONLY)
        self.watch = FileWatch(folder, name, descriptor)
        self._descriptor = descriptor
        with suppress(OSError):  # some network disks have no locks
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def write(self, data: bytes) -> int:
        """Take one or more whole records; return their size [bytes]."""
        self.check()
        self._buffer += data
        if len(self._buffer) > _BUFFER:
            self.flush()
        return len(data)

    def tell(self) -> int:
        """Return the size of all that was taken so far [bytes]."""
        return self._written + len(self._buffer)

    def check(self) -> None:
        """Raise the error that an earlier call met, if any."""
        if self.failure is not None:
            raise self.failure

    def flush(self) -> None:
        """Hand everything to the system: it survives the end of this process."""
        self.check()
        pending = memoryview(self._buffer)
        done = 0
        while done < len(pending):
            done += self._write(pending[done:], self._written + done)
        self._written += len(self._buffer)
        self.watch.wrote(self._buffer)
        self._buffer = bytearray()
        self.held = self._written

    def _write(self, piece: memoryview, offset: int) -> int:
        try:
            self.watch.before_write(offset)
            return os.write(self._descriptor, piece)
        except OSError as error:
            if self._reserve is not None and self._reserve.helps(error):
                return 0
            self.failure = error
            raise

    def sync(self) -> None:
        """Hand everything to the disk: it survives a power failure."""
        self.flush()
        try:
            _sync(self._descriptor)
        except OSError as error:
            # What became of the rest nobody can tell.
            self.held, self.failure = self.synced, error
            raise
        self.synced = self._written

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; after an error cut it back to its last whole record. Never raises."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        self.watch.end()
        # A disk that fails here has either failed before, which was said, or has synced all.
        with suppress(OSError):
            if self.failure is not None and os.fstat(descriptor).st_size > self._written:
                os.ftruncate(descriptor, self._written)
        with suppress(OSError):
            os.close(descriptor)


def is_being_written(file: BinaryIO) -> bool:
    """Return whether a DurableFile has this open file in its hands, in whatever process."""
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    fcntl.flock(file.fileno(), fcntl.LOCK_UN)
    return False


class NotedFile:
    """
    What the MCAP library writes to: a file that notes what is in it whenever a chunk is written.

    Parameters
    ----------
    file
        The file.
    taken
        Returns which messages were given to the library so far. All of them are in chunks when a
        chunk is written.

    """

    def __init__(self, file: DurableFile, taken: Callable[[], FileSummary]) -> None:
        self.tell, self.flush = file.tell, file.flush
        self._file, self._taken = file, taken
        # Where each chunk ends [bytes], and what the file holds up to there.
        self._chunks = deque([(0, taken())])

    def write(self, data: bytes) -> int:
        """Take what the library writes: a chunk's record always comes by itself."""
        if data[:1] == _CHUNK:
            # Noted before, for to write it may hand it over.
            self._forget()
            self._chunks.append((self.tell() + len(data), self._taken()))
        return self._file.write(data)

    def kept(self) -> FileSummary:
        """Return what is known to be in the file, after a failure."""
        return [summary for end, summary in self._chunks if end <= self._file.held][-1]

    def _forget(self) -> None:
        while len(self._chunks) > 1 and self._chunks[1][0] <= self._file.synced:
            self._chunks.popleft()
