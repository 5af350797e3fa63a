"""Space on the disk: how much is free, and what is kept so that a full disk leaves a run whole."""

from contextlib import suppress
import errno
import os
from pathlib import Path
import shutil
import tempfile

from klann_ros.log.errors import LowSpaceError
from klann_ros.sanitize.files import open_plain

# Enough for what is not written yet when the disk says no: a piece with a chunk and its index, the
# chunk in progress with its own, the losses, the summary, metadata.yaml.
SIZE = 512 * 1024

_FULL = (errno.ENOSPC, errno.EDQUOT)

# Recorders once gave their reserve a name, and left it behind when they were killed.
_OLD_NAME = '.reserve'
_OLD_SIZES = range(256 * 1024, 2**30)


class DiskReserve:
    """
    A file without a name that takes up space until that is needed.

    As it has no name, nobody removes it by accident, and whatever ends the process gives the
    space back: a killed recorder leaves nothing behind. Where the system cannot allocate space
    there is no reserve.

    Parameters
    ----------
    folder
        A folder on the disk.

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
        self._size = 0
        self._descriptor = -1
        if hasattr(os, 'posix_fallocate'):
            with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
                self._descriptor = os.dup(file.fileno())
            self.hold(SIZE)
            if self.spent is not None:
                raise OSError(self.spent.errno, self.spent.strerror, str(folder))

    def hold(self, size: int) -> None:
        """Grow to a size [bytes]; where the disk has not that much, give all up."""
        if self._descriptor < 0 or size <= self._size:
            return
        try:
            os.posix_fallocate(self._descriptor, self._size, size - self._size)
        except OSError as error:
            self.helps(error)
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
            os.close(descriptor)

    def __del__(self) -> None:
        self.release()


def remove_old_reserve(run: Path) -> None:
    """
    Remove the named reserve that an earlier version left in the folder of a run. Never raises.

    Only what can be nothing else goes: a plain file, no link, of that name, at least as large as
    a reserve was, and with nothing in it but zeros.
    """
    path = run / _OLD_NAME
    with suppress(OSError):
        if path.is_symlink() or path.stat().st_size not in _OLD_SIZES:
            return
        with open_plain(path) as file:
            is_empty = not any(any(piece) for piece in iter(lambda: file.read(SIZE), b''))
        if is_empty:
            path.unlink()


def free_space(folder: Path) -> int:
    """
    Return how much this user may still write on the disk of a folder, there or not [bytes].

    An OSError says that the disk does not tell.
    """
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    return shutil.disk_usage(there).free


def check_free_space(folder: Path, least: int) -> None:
    """
    Let a folder be written to as long as so much is free on its disk [bytes]; 0 is no limit.

    Raises
    ------
    LowSpaceError
        Less is free.
    OSError
        The disk does not tell.

    """
    if least > 0 and (free := free_space(folder)) < least:
        raise LowSpaceError(folder, free, least)
