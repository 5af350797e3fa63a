"""One maker, many users: a lock on a folder."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path

from command_error import CommandError
import stop


@contextmanager
def made_folder(
    folder: Path, is_ready: Callable[[], bool], make: Callable[[], None]
) -> Iterator[None]:
    """
    Hold `folder` in a ready state: make it so if it is not, and let nobody make it anew meanwhile.

    Users share the lock; the one that makes it has it alone. The lock is on the folder itself,
    which stays when its contents are cleared.
    """
    handle = _open(folder)
    try:
        _acquire(handle, fcntl.LOCK_SH, folder)
        # Between the two locks another process may come first, hence a loop.
        while not is_ready():
            _acquire(handle, fcntl.LOCK_EX, folder)
            if not is_ready():
                make()
            _acquire(handle, fcntl.LOCK_SH, folder)
        yield
    finally:
        os.close(handle)


def _open(folder: Path) -> int:
    try:
        folder.mkdir(exist_ok=True)
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise CommandError(
            f'cannot make {folder}: {error.strerror}. The environment is kept in the checkout: '
            'use a copy of it that you can write to'
        ) from error


def _acquire(handle: int, kind: int, folder: Path) -> None:
    if _try(handle, kind):
        return
    print(f'Waiting for another command that uses {folder.name} ...')
    while not _try(handle, kind):
        stop.pause(0.2)


def _try(handle: int, kind: int) -> bool:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        # A file system without locks: then nothing can be promised to two at once.
        return True
    return True
