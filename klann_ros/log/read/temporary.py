"""Temporary files with the unpacked or copied content of a log, in folders below TMPDIR."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
import shutil
import tempfile
import weakref

from klann_ros.log.errors import AnyPath, NotALogError

_PREFIX = 'klann_ros-unpacked-'
# Space that stays free for others [bytes].
_MIN_FREE = 200 * 1024 * 1024


class TemporaryFile:
    """
    A file with a name that is removed with this object, or at the end of the process.

    All errors of its disk are a NotALogError of the source, the log that it is made from.
    """

    def __init__(self, source: AnyPath, name: str) -> None:
        self._source = source
        with self._disk():
            folder = tempfile.mkdtemp(prefix=_PREFIX)
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
