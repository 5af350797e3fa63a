"""Files that a user or a log names: plain ones only, and no larger than they may be."""

import errno
import os
from pathlib import Path
import stat
from typing import BinaryIO, TypeAlias

AnyPath: TypeAlias = str | os.PathLike[str]

_KINDS = (
    (stat.S_ISDIR, 'a folder'),
    (stat.S_ISFIFO, 'a named pipe'),
    (stat.S_ISSOCK, 'a socket'),
    (stat.S_ISCHR, 'a device'),
    (stat.S_ISBLK, 'a device'),
)


_DATA: int | None = getattr(os, 'SEEK_DATA', None)
_HOLE: int | None = getattr(os, 'SEEK_HOLE', None)


class NotAPlainFileError(OSError):
    """What is no file with an end: a folder, a pipe, a socket or a device."""


def open_plain(path: AnyPath) -> BinaryIO:
    """
    Open a regular file for reading, and nothing that waits for a writer or never ends.

    Raises
    ------
    NotAPlainFileError
        It is no regular file; `strerror` says what it is.
    OSError
        It cannot be opened.

    """
    # A device may do something when it is opened, so it is looked at before; and again when it is
    # open, for it may have been replaced.
    _check(Path(path).stat(), path)
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        _check(os.fstat(descriptor), path)
        return os.fdopen(descriptor, 'rb')
    except BaseException:
        os.close(descriptor)
        raise


def is_plain(path: AnyPath) -> bool:
    """Return whether there is a regular file at a path."""
    try:
        return stat.S_ISREG(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


def is_within(path: AnyPath, folder: AnyPath) -> bool:
    """
    Return whether a path leads to a file or folder, or into it, by whatever links.

    Parameters
    ----------
    path
        What may not be there yet.
    folder
        A folder, whose own files may have other names elsewhere; or a file.

    """
    try:
        known, place = Path(folder).stat(), Path(os.path.realpath(path))
        if any(_is(parent, known) for parent in (place, *place.parents)):
            return True
        there = place.stat()
        return stat.S_ISREG(there.st_mode) and any(
            _is(file, there) for file in Path(folder).iterdir()
        )
    except (OSError, ValueError):
        return False


def next_data(file: BinaryIO, offset: int) -> int:
    """
    Return where the next bytes stand in an open file that were ever written, from an offset on.

    A file of some kilobytes may be as long as it likes: what was never written are zeros, which
    take as long to read as any other bytes. Where the system does not tell, it is the offset.
    """
    return _seek(file, offset, _DATA, offset)


def is_hollow(file: BinaryIO, start: int, end: int) -> bool:
    """
    Return whether little of a stretch of an open file was ever written: less than an eighth.

    Who reads it would ask for more memory than the file takes on the disk.
    """
    enough, offset = (end - start) / 8, start
    while (offset := next_data(file, offset)) < end:
        hole = min(_seek(file, offset, _HOLE, end), end)
        enough -= hole - offset
        if enough <= 0:
            return False
        offset = hole
    return start < end


def read_plain(path: AnyPath, longest: int) -> str:
    """
    Return the text of a regular file.

    Parameters
    ----------
    path
        The file.
    longest
        How long it may be [bytes]; nothing beyond is read.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is longer, it is no UTF-8, or the path is none.

    """
    with open_plain(path) as file:
        data = file.read(longest + 1)
    if len(data) > longest:
        raise ValueError(f'it is longer than {longest} bytes')
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise ValueError(f'it is no UTF-8 text: {error.reason} at byte {error.start}') from None


def _seek(file: BinaryIO, offset: int, whence: int | None, otherwise: int) -> int:
    """Return where data or a hole is; `otherwise` where the system cannot tell."""
    if whence is None:
        return otherwise
    descriptor = file.fileno()
    # The file object counts on it that nobody moves.
    here = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        return os.lseek(descriptor, offset, whence)
    except OSError as error:
        # There is none behind the offset.
        return os.fstat(descriptor).st_size if error.errno == errno.ENXIO else otherwise
    finally:
        os.lseek(descriptor, here, os.SEEK_SET)


def _is(path: Path, known: os.stat_result) -> bool:
    try:
        return os.path.samestat(path.stat(), known)
    except OSError:
        return False


def _check(status: os.stat_result, path: AnyPath) -> None:
    if stat.S_ISREG(status.st_mode):
        return
    kind = next((name for is_one, name in _KINDS if is_one(status.st_mode)), 'something else')
    raise NotAPlainFileError(errno.EINVAL, f'it is {kind}, not a regular file', str(path))
