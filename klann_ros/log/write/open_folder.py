"""A folder that is held open: it stays the same one, whatever it is called meanwhile."""

from contextlib import suppress
import os
from pathlib import Path
import shutil


class OpenFolder:
    """
    A folder by what it is, not by its name: whoever renames it takes nothing away.

    Parameters
    ----------
    path
        It, which must exist.

    Attributes
    ----------
    path : pathlib.Path
        What it was called when that was last looked at.
    tells : bool or None
        Whether its disk tells the truth of files that are open; None before that is known.

    Raises
    ------
    OSError
        By every method but :meth:`place` and :meth:`close`: the disk said no. After the folder
        was removed that is a FileNotFoundError.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tells: bool | None = None
        self._descriptor = -1
        self._descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)

    def place(self) -> Path | None:
        """Return what it is called now; None where it was removed, or nobody can tell."""
        try:
            if os.path.samestat(self.path.stat(), os.fstat(self._descriptor)):
                return self.path
        except PermissionError:
            return self.path  # who may not look has not seen a change
        except OSError:
            pass
        return whereabouts(self._descriptor)

    def names(self) -> list[str]:
        """Return the names of what is in it."""
        return os.listdir(self._descriptor)  # noqa: PTH208 - a Path knows no descriptors

    def status(self, name: str) -> os.stat_result:
        """Return what stands under a name in it, or under the link that has this name."""
        return os.stat(name, dir_fd=self._descriptor)

    def open_file(self, name: str, flags: int) -> int:
        """Open what has a name in it; return the descriptor."""
        try:
            return os.open(name, flags | os.O_CLOEXEC, 0o666, dir_fd=self._descriptor)
        except OSError as error:
            error.filename = str(self.path / name)
            raise

    def create_file(self, name: str, flags: int) -> int:
        """Make a new file in it that nothing else stands in the place of; see `open_file`."""
        return self.open_file(name, flags | os.O_CREAT | os.O_EXCL)

    def remove(self, name: str) -> None:
        """Remove a file; without one there is nothing to do."""
        with suppress(FileNotFoundError):
            os.unlink(name, dir_fd=self._descriptor)

    def replace(self, name: str, text: str) -> None:
        """Write a text file so that at any moment the old or the new one is there, whole."""
        temporary = f'.{name}.new'
        # Whatever a user or a crash has put there is in the way, and might be a pipe that hangs.
        self.remove(temporary)
        try:
            with os.fdopen(self.create_file(temporary, os.O_WRONLY), 'wb') as file:
                file.write(text.encode())
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, name, src_dir_fd=self._descriptor, dst_dir_fd=self._descriptor)
        except OSError:
            with suppress(OSError):
                self.remove(temporary)
            raise
        self.sync()

    def sync(self) -> None:
        """Make the names of new files in it survive a power failure."""
        os.fsync(self._descriptor)

    def free_space(self) -> int:
        """Return how much this user may still write on its disk [bytes]."""
        return shutil.disk_usage(self._descriptor).free

    def close(self) -> None:
        """Let it go. Never raises."""
        descriptor, self._descriptor = self._descriptor, -1
        with suppress(OSError):
            os.close(descriptor)

    def __del__(self) -> None:
        self.close()


def whereabouts(descriptor: int) -> Path | None:
    """Return what an open file or folder is called now; None where it has no name to be seen."""
    with suppress(OSError):
        found = Path(f'/proc/self/fd/{descriptor}').readlink()  # where there is none, nobody tells
        if os.path.samestat(found.stat(), os.fstat(descriptor)):
            return found
    return None
