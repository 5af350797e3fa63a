"""
Files that are there only to be read, such as what a compressed file holds.

They are in one folder of this process under the system's folder for such things (TMPDIR). It goes
at the end of the process; that of a process which was killed goes when the next one makes its own.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import fcntl
from functools import cache
import os
from pathlib import Path
import shutil
import tempfile
import time
import weakref

from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.sanitize.files import is_regular_file

_PREFIX = 'klann_ros-unpacked-'
# What marks a folder as one of these, whatever else is called like that.
_MARK = '.made-to-be-removed'
# A folder that is younger may be about to be locked [s].
_NEW = 60.0
# So much stays free for others [bytes].
_KEPT_FREE = 200 * 1024 * 1024


class TemporaryFile:
    """
    A file of a name of one's choice that goes with this object.

    Parameters
    ----------
    source
        What is read by it, for messages.
    name
        How it is called.

    Raises
    ------
    NotALogError
        There is no place for it.

    """

    def __init__(self, source: AnyPath, name: str) -> None:
        self._source = source
        try:
            folder = tempfile.mkdtemp(dir=_folder(os.getpid()))
        except OSError as error:
            raise self._refused(error.strerror or str(error)) from None
        self.path = Path(folder, name)
        self._remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def close(self) -> None:
        """Remove it, and all that is beside it."""
        self._remove()

    def write(self, pieces: Iterable[bytes], beside: str = '', size: int = 0) -> None:
        """
        Write the file, or one beside it.

        Parameters
        ----------
        pieces
            What is to be in it.
        beside
            How much longer the name of the one beside it is.
        size
            How large it is going to be [bytes], if that is known: of what has no room nothing is
            written then.

        Raises
        ------
        NotALogError
            There is no room for it.
        OSError
            The pieces cannot be read.

        """
        with self._told():
            room = shutil.disk_usage(self.path.parent).free - _KEPT_FREE
            self._check_room(size, room)
            file = self.path.with_name(self.path.name + beside).open('wb')
        with file:
            for piece in pieces:
                room -= len(piece)
                self._check_room(0, room)
                with self._told():
                    file.write(piece)
                    file.flush()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Tell an error of this disk as what it is; what is read may have one of its own."""
        try:
            yield
        except OSError as error:
            raise self._refused(error.strerror or str(error)) from None

    def _check_room(self, size: int, room: int) -> None:
        if size > room:
            raise self._refused('there is no room for it')

    def _refused(self, reason: str) -> NotALogError:
        place = tempfile.gettempdir()
        return NotALogError(
            self._source,
            f'it has to be unpacked, or copied, to {place} to be read: {reason}; '
            'let TMPDIR name a folder with room',
        )


@cache
def _folder(process: int) -> Path:
    """Return this process's folder; a forked process has another one."""
    _sweep(Path(tempfile.gettempdir()))
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
    lock = _lock(folder)
    (folder / _MARK).touch()
    weakref.finalize(_folder, _remove, folder, lock, process)
    return folder


def _remove(folder: Path, lock: int | None, process: int) -> None:
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder as long as this process lives; None if somebody has done so."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _sweep(place: Path) -> None:
    """Remove this user's folders that no process has any more."""
    for folder in place.glob(f'{_PREFIX}*'):
        try:
            status = folder.lstat()
            is_new = time.time() - status.st_mtime < _NEW
            if is_new or status.st_uid != os.getuid() or not is_regular_file(folder / _MARK):
                continue
            lock = _lock(folder)
        except OSError:
            continue
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)
