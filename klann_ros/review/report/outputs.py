"""
The files that a review writes: none that it reads, and each whole or not at all.

They are looked at before the review begins, since it may take minutes. What is written goes to a
file beside its place, which it takes at once: a full disk leaves the page of before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
import errno
import os
from pathlib import Path
import secrets
import stat
from typing import BinaryIO

from klann_ros.log.read.opening import LONGEST_MAGIC, MAGICS
from klann_ros.sanitize.files import is_plain, is_within, open_plain
from klann_ros.sanitize.text import printable

Save = Callable[[BinaryIO], object]


class OutputError(Exception):
    """A file that cannot be written; the text says which, and why."""


@dataclass(frozen=True)
class Output:
    """A file to be written."""

    # Which one, such as '--html'.
    option: str
    # As it was given.
    path: str

    def save(self, save: Save) -> None:
        """Write the file; an OutputError where it cannot be, and what was there before stays."""
        with self._told(), self._opened() as file:
            save(file)

    def check(self, inputs: Sequence[str]) -> None:
        """Find out whether it may and can be written, by what is read; an OutputError if not."""
        with self._told():
            for given in inputs:
                if is_within(self.path, given):
                    inside = 'inside ' if Path(given).is_dir() else ''
                    raise OutputError(f'it is {inside}{printable(given)}, which is only read')
            if not self.path or self.path.endswith(os.sep):
                raise OutputError('that is no path of a file')
            if _is_special(self.path):
                return
            if is_plain(self.path):
                _check_old(self.path)
            descriptor, probe = _new_beside(_place(self.path))
            os.close(descriptor)
            probe.unlink()

    def is_same(self, other: 'Output') -> bool:
        """Return whether both are one file."""
        if _is_special(self.path):
            return False
        return is_within(self.path, other.path) or _place(self.path) == _place(other.path)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError, OutputError) as error:
            reason = getattr(error, 'strerror', None) or error
            what = f'{self.option} {printable(self.path)} cannot be written'
            raise OutputError(f'{what}: {printable(reason)}') from error

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        if _is_special(self.path):
            # A pipe that nobody reads is not waited for; one that is read takes its time.
            descriptor = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            os.set_blocking(descriptor, True)
            with os.fdopen(descriptor, 'wb') as file:
                yield file
            return
        place = _place(self.path)
        descriptor, beside = _new_beside(place)
        try:
            with os.fdopen(descriptor, 'wb') as file:
                yield file
                file.flush()
                os.fsync(descriptor)
            beside.replace(place)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise


def outputs(given: Mapping[str, str | None], inputs: Sequence[str]) -> list[Output]:
    """
    Return the files to be written, all of which can be.

    Parameters
    ----------
    given : mapping of str to str or None
        The path of each option.
    inputs : sequence of str
        The files and folders that are read.

    Raises
    ------
    OutputError
        One of them cannot be written, or is read, or two of them are one.

    """
    found = [Output(option, path) for option, path in given.items() if path is not None]
    for number, output in enumerate(found):
        output.check(inputs)
        for other in found[:number]:
            if output.is_same(other):
                raise OutputError(f'{other.option} and {output.option} are the same file')
    return found


def _place(path: str) -> Path:
    """Return where a file really is: what leads there by a link stays a link."""
    return Path(os.path.realpath(path))


def _new_beside(place: Path) -> tuple[int, Path]:
    """Open a new file in the folder of another, as what that one is going to be."""
    old = place.stat() if place.exists() else None
    if old is not None and not stat.S_ISREG(old.st_mode):
        raise OutputError('it is a folder' if place.is_dir() else 'it is no regular file')
    if not place.parent.is_dir():
        raise OutputError(f'there is no folder {printable(place.parent)}')
    beside = place.with_name(f'.review-{secrets.token_hex(8)}.new')
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    descriptor = os.open(beside, flags, 0o666)
    if old is not None:
        with suppress(OSError):
            os.fchmod(descriptor, stat.S_IMODE(old.st_mode))
    return descriptor, beside


def _is_special(path: str) -> bool:
    """Return whether a path is a pipe or a device, which is written as it is."""
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)


def _is_open_as(path: str, descriptor: int) -> bool:
    try:
        return os.path.samestat(Path(path).stat(), os.fstat(descriptor))
    except OSError:
        return False


def _check_old(path: str) -> None:
    """Refuse to replace a file that is a log, or that this process writes to already."""
    with suppress(PermissionError), open_plain(path) as file:
        if file.read(LONGEST_MAGIC).startswith(MAGICS):
            raise OutputError('it is a log, and no log is overwritten')
    if any(_is_open_as(path, descriptor) for descriptor in (1, 2)):
        raise OutputError('the report itself goes there')
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
