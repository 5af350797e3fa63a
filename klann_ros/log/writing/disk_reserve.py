"""Space on the disk that is kept for the end of a run, so that a full disk leaves it whole."""

from contextlib import suppress
import errno
import os
from pathlib import Path

# Enough for what is not written yet when the disk says no: a chunk, the losses, the summary.
SIZE = 256 * 1024
NAME = '.reserve'

_FULL = (errno.ENOSPC, errno.EDQUOT)


class DiskReserve:
    """
    A hidden file beside a run's files that takes up space until that is needed.

    Where the system cannot allocate space there is no reserve.

    Parameters
    ----------
    folder
        The run's folder.

    Attributes
    ----------
    spent : OSError or None
        What the disk said when the reserve was given up.

    Raises
    ------
    OSError
        There is not that much space.

    """

    def __init__(self, folder: Path) -> None:
        self.spent: OSError | None = None
        self._path = folder / NAME
        self._size = 0
        self._descriptor = -1
        if hasattr(os, 'posix_fallocate'):
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            self._descriptor = os.open(self._path, flags, 0o666)
            self.hold(SIZE)

    def hold(self, size: int) -> None:
        """
        Grow to a size [bytes]; where the disk has not that much, give all up.

        Raises
        ------
        OSError
            What the disk said; it is told once.

        """
        if self._descriptor < 0 or size <= self._size:
            return
        try:
            os.posix_fallocate(self._descriptor, self._size, size - self._size)
        except OSError as error:
            if self.helps(error):
                raise OSError(error.errno, error.strerror, str(self._path.parent)) from None
        else:
            self._size = size

    def helps(self, error: OSError) -> bool:
        """Give the space up if an error says that there is too little; return whether it did."""
        if self._descriptor < 0 or error.errno not in _FULL:
            return False
        self.spent = error
        self.release()
        return True

    def release(self) -> None:
        """Give the space up. Never raises."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        with suppress(OSError):
            self._path.unlink(missing_ok=True)
        with suppress(OSError):
            os.close(descriptor)
