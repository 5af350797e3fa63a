"""What others do to a run while it is written, and by what a file is known again later."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
import errno
import os
from pathlib import Path
import stat

from klann_ros.sanitize.text import printable

from .open_folder import OpenFolder, whereabouts

# How much of the end of what was written is compared [bytes].
TAIL = 32

# What the disk says when there is nothing under a name, and of a file that another host removed.
_NOT_THERE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ESTALE)
# What network disks call a file that was removed while it is open; it goes when it is closed.
_REMOVED = ('.nfs', '.fuse_hidden')

# A line with the paths of a folder and two files in it.
_LONGEST = 2000


class Harm(Enum):
    """What was done to a file: whoever reads its folder does not find it whole."""

    REMOVED = 'removed'
    MOVED = 'moved'
    SPOILT = 'cut off or overwritten'


@dataclass(frozen=True)
class Mark:
    """The end of what was written to a file so far."""

    # How much that was [bytes].
    size: int = 0
    # Its last bytes.
    tail: bytes = b''


@dataclass(frozen=True)
class Seal:
    """
    By what a finished file is known again: its name, and how it ends.

    Not by its inode: the numbers of FAT and of many network disks do not last. What is changed in
    the midst of the file is not seen; the CRCs in it are for that.
    """

    # Its name in its folder.
    name: str
    # Its end; None where the disk does not tell.
    mark: Mark | None

    def is_intact(self, folder: OpenFolder) -> bool:
        """Return whether the file is there as it was left, as far as one may look."""
        return self.mark is None or _holds(folder, self.name, self.mark)


class FileWatch:
    """
    Looks at a file that is being written.

    Parameters
    ----------
    folder, name
        Where it was made, and how it was called.
    descriptor
        It, open.

    """

    def __init__(self, folder: OpenFolder, name: str, descriptor: int) -> None:
        self._folder, self._name, self._descriptor = folder, name, descriptor
        self._mark = self._last_look = Mark()
        self._is_cut = False
        self._appended = 0

    def before_write(self, offset: int) -> None:
        """Look before something is written: behind the end of what was cut off it hides that."""
        self._is_cut |= os.fstat(self._descriptor).st_size < offset

    def wrote(self, data: bytes | bytearray) -> None:
        """Note what was written."""
        tail = bytes((self._mark.tail + data[-TAIL:])[-TAIL:])
        self._mark = Mark(self._mark.size + len(data), tail)

    def begin(self) -> None:
        """
        Begin to look, when something is written.

        Where a disk tells nonsense of the first file in a folder, which has just been made, it is
        not believed of any: there are disks that know no sizes, or no other names, before a file
        is closed.
        """
        if self._folder.tells is None:
            is_there = _is_at(self._folder, self._name, os.fstat(self._descriptor))
            self._folder.tells = not is_there or self.look() is None
        self._last_look = self._mark

    def look(self) -> Harm | None:
        """Return what is wrong with the file; what was appended to it is cut off."""
        if self._folder.tells is False:
            return None
        try:
            status = os.fstat(self._descriptor)
        except OSError as error:
            if error.errno in _NOT_THERE:
                return Harm.REMOVED
            raise
        if not status.st_nlink:
            return Harm.REMOVED
        is_whole = _holds(self._folder, self._name, self._last_look, self._mark)
        if not is_whole and not _is_at(self._folder, self._name, status):
            return Harm.REMOVED if self._is_hidden() else Harm.MOVED
        if self._is_cut or not is_whole:
            return Harm.SPOILT
        if status.st_size > self._mark.size:
            self._appended += status.st_size - self._mark.size
            os.ftruncate(self._descriptor, self._mark.size)
        self._last_look = self._mark
        return None

    def take_appended(self) -> int:
        """Return how much was cut off that somebody had appended since this was asked [bytes]."""
        appended, self._appended = self._appended, 0
        return appended

    def place(self) -> Path | None:
        """Return what the file is called now; None where it has no name, or nobody can tell."""
        return whereabouts(self._descriptor)

    def end(self) -> None:
        """Look no more: the file is closed, and its descriptor may soon be another's."""
        self._descriptor = -1

    def seal(self) -> Seal:
        """Return by what the file is known again, when nothing more is written."""
        return Seal(self._name, None if self._folder.tells is False else self._mark)

    def _is_hidden(self) -> bool:
        place = self.place()
        return place is not None and place.name.startswith(_REMOVED)


def _is_at(folder: OpenFolder, name: str, status: os.stat_result) -> bool:
    try:
        return os.path.samestat(folder.status(name), status)
    except OSError as error:
        return error.errno not in _NOT_THERE


def _holds(folder: OpenFolder, name: str, *marks: Mark) -> bool:
    try:
        if not stat.S_ISREG(folder.status(name).st_mode):
            return False
        descriptor = folder.open_file(name, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        return error.errno not in _NOT_THERE
    try:
        return all(_is_in(descriptor, mark) for mark in marks)
    finally:
        with suppress(OSError):
            os.close(descriptor)


def _is_in(descriptor: int, mark: Mark) -> bool:
    try:
        found = os.pread(descriptor, len(mark.tail), mark.size - len(mark.tail))
    except OSError:
        return True  # it cannot be read now, which is another fault
    return found == mark.tail


def _nobody(_: str) -> None:
    """Tell nobody."""


class Faults:
    """
    What is wrong with a run that is being written, though the disk says nothing.

    Written by the thread that writes the run; any other may ask what lasts.

    Parameters
    ----------
    error, warning : callable
        Are called with a line for each fault, and for what harms nothing but should be known.

    """

    def __init__(
        self,
        error: Callable[[str], object] = _nobody,
        warning: Callable[[str], object] = _nobody,
    ) -> None:
        self._error, self._warning = error, warning
        self._lasting: dict[str, str] = {}

    @property
    def lasting(self) -> tuple[str, ...]:
        """Return what is wrong now, a line each; of many files that are gone, the last one."""
        return tuple(self._lasting.values())

    def note(self, about: str, text: str, now: str = '') -> None:
        """Note what is wrong about something; the same is told once, with what is done now."""
        line = printable(text, _LONGEST)
        if self._lasting.get(about) != line:
            self._lasting[about] = line
            self._error(f'{line}; {now}' if now else line)

    def mend(self, about: str) -> None:
        """Forget what was wrong about something."""
        self._lasting.pop(about, None)

    def has(self, about: str) -> bool:
        """Return whether something is wrong about it."""
        return about in self._lasting

    def mention(self, text: str) -> None:
        """Tell what harms nothing."""
        self._warning(printable(text, _LONGEST))
