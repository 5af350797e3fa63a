"""
Temporary files with the unpacked or copied content of a log.

They are in one folder of this process below TMPDIR, which is removed at the end of the process;
that of a killed process is removed when the next one makes its own.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
import os
from pathlib import Path
import shutil
import tempfile
import time
import weakref

from klann_ros.log.browser import fcntl
from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.sanitize.files import is_regular_file

_PREFIX = 'klann_ros-unpacked-'
# File that marks a folder as one of these.
_MARK = '.made-to-be-removed'
# A younger folder may not be locked yet [s].
_MIN_AGE = 60.0
# Space that stays free for others [bytes].
_MIN_FREE = 200 * 1024 * 1024


class TemporaryFile:
    """
    A file with a name that is removed with this object.

    All errors of its disk are a NotALogError of the source, the log that it is made from.
    """

    def __init__(self, source: AnyPath, name: str) -> None:
        self._source = source
        with self._disk():
            folder = tempfile.mkdtemp(dir=_folder(os.getpid()))
        self.path = Path(folder, name)
        self._remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def close(self) -> None:
        """Remove it with all files beside it."""
        self._remove()

    def write(self, pieces: Iterable[bytes], suffix: str = '', size: int = 0) -> None:
        """
        Write the file, or one beside it whose name has a suffix.

        Nothing is written if the disk has no room for a known size [bytes]. An OSError means that
        the pieces cannot be read.
        """
        with self._disk():
            room = shutil.disk_usage(self.path.parent).free - _MIN_FREE
            self._check_room(size, room)
            file = self.path.with_name(self.path.name + suffix).open('wb')
        with file:
            for piece in pieces:
                room -= len(piece)
                self._check_room(0, room)
                with self._disk():
                    file.write(piece)
                    file.flush()

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Convert an error of this disk; reading the source may raise its own."""
        try:
            yield
        except OSError as error:
            raise self._refusal(error.strerror or str(error)) from None

    def _check_room(self, size: int, room: int) -> None:
        if size > room:
            raise self._refusal('there is no room for it')

    def _refusal(self, reason: str) -> NotALogError:
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
    """Lock a folder until this process ends; None if another process has locked it."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if fcntl:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _sweep(place: Path) -> None:
    """Remove this user's folders of ended processes."""
    for folder in place.glob(f'{_PREFIX}*'):
        try:
            status = folder.lstat()
            is_new = time.time() - status.st_mtime < _MIN_AGE
            if is_new or status.st_uid != os.getuid() or not is_regular_file(folder / _MARK):
                continue
            lock = _lock(folder)
        except OSError:
            continue
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)
