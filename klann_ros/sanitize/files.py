"""Safe access to files that a user or a log names: regular files only, of limited size."""

from contextlib import suppress
import errno
import os
from pathlib import Path
import stat
from typing import BinaryIO, TypeAlias

from .text import printable

AnyPath: TypeAlias = str | os.PathLike[str]

_KINDS = {
    stat.S_IFDIR: 'a folder',
    stat.S_IFIFO: 'a named pipe',
    stat.S_IFSOCK: 'a socket',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
}
# Flags that never let an opening wait; absent on Windows, as is what lseek looks for.
NO_WAITING: int = getattr(os, 'O_NONBLOCK', 0) | getattr(os, 'O_NOCTTY', 0)
_DATA: int | None = getattr(os, 'SEEK_DATA', None)
_HOLE: int | None = getattr(os, 'SEEK_HOLE', None)


class NotRegularFileError(OSError):
    """A folder, a pipe, a socket or a device in place of a file."""


def open_regular(path: AnyPath) -> BinaryIO:
    """
    Open a regular file for reading; never block on a pipe or read an endless device.

    A NotRegularFileError names the kind of another file in `strerror`.
    """
    # Opening a device may have an effect, so its kind is checked first; and again when it is
    # open, since it may have been replaced.
    _check_regular(Path(path).stat(), path)
    descriptor = os.open(path, os.O_RDONLY | NO_WAITING)
    try:
        _check_regular(os.fstat(descriptor), path)
        return os.fdopen(descriptor, 'rb')
    except BaseException:
        os.close(descriptor)
        raise


def with_home(path: AnyPath) -> Path:
    """Return a path with a home folder in the place of `~`; a ValueError for an unknown user."""
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise ValueError(f'{printable(path)} is in the home folder of no user here') from None


def is_regular_file(path: AnyPath) -> bool:
    """Return whether there is a regular file at a path."""
    with suppress(OSError, ValueError):
        return stat.S_ISREG(Path(path).stat().st_mode)
    return False


def is_within(path: AnyPath, folder: AnyPath) -> bool:
    """
    Return whether a path, which need not exist, is a folder (or a file), or leads into it.

    Links are followed; the folder's own files may have hard links elsewhere.
    """
    with suppress(OSError, ValueError):
        folder_status = Path(folder).stat()
        real_path = Path(os.path.realpath(path))
        if any(_is_same(parent, folder_status) for parent in (real_path, *real_path.parents)):
            return True
        status = real_path.stat()
        files = Path(folder).iterdir()
        return stat.S_ISREG(status.st_mode) and any(_is_same(file, status) for file in files)
    return False


def next_data(file: BinaryIO, offset: int) -> int:
    """
    Return the offset of the next written bytes of a sparse file, from an offset on.

    A file of some kilobytes may have any length: its holes read as zeros, as slowly as data. The
    result is the offset itself on a system without sparse files.
    """
    return _seek(file, offset, _DATA, offset)


def is_hollow(file: BinaryIO, start: int, end: int) -> bool:
    """Return whether less than an eighth of a part of a sparse file was written."""
    written = 0
    offset = start
    while (offset := next_data(file, offset)) < end:
        hole = min(_seek(file, offset, _HOLE, end), end)
        written += hole - offset
        if written >= (end - start) / 8:
            return False
        offset = hole
    return start < end


def read_regular(path: AnyPath, max_size: int) -> str:
    """Return the text of a regular file; a ValueError beyond `max_size` bytes, or if not UTF-8."""
    with open_regular(path) as file:
        data = file.read(max_size + 1)
    if len(data) > max_size:
        raise ValueError(f'it is longer than {max_size} bytes')
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise ValueError(f'it is no UTF-8 text: {error.reason} at byte {error.start}') from None


def _seek(file: BinaryIO, offset: int, whence: int | None, default: int) -> int:
    """Return the offset of data or of a hole; `default` if the system cannot say."""
    if whence is None:
        return default
    descriptor = file.fileno()
    # The file object relies on its position.
    position = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        return os.lseek(descriptor, offset, whence)
    except OSError as error:
        # There is none behind the offset.
        return os.fstat(descriptor).st_size if error.errno == errno.ENXIO else default
    finally:
        os.lseek(descriptor, position, os.SEEK_SET)


def _is_same(path: Path, status: os.stat_result) -> bool:
    with suppress(OSError):
        return os.path.samestat(path.stat(), status)
    return False


def _check_regular(status: os.stat_result, path: AnyPath) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), 'something else')
        raise NotRegularFileError(errno.EINVAL, f'it is {kind}, not a regular file', str(path))
