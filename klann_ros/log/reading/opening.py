"""Open a file of a log, whatever it is: its first bytes tell, not its name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from klann_ros.log.errors import NotALogError
from klann_ros.untrusted.files import open_plain

from .container import MAGIC
from .foreign import foreign, is_certain
from .mcap_storage import McapStorage
from .sqlite.pages import SQLITE_MAGIC
from .unpacking.packed_messages import is_packed, PackedMessages
from .unpacking.whole_file import SUFFIXES, unpack
from .unpacking.zstd_frames import ZSTD_MAGIC

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import TypeAlias

    from .storage import Storage
    from .unpacking.temporary import TemporaryFile

    Kind: TypeAlias = Callable[[Path, TemporaryFile | None], Storage]


def _sqlite(path: Path, unpacked: TemporaryFile | None) -> Storage:
    """Return an SQLite file, where Python has SQLite: one that was built by hand may lack it."""
    try:
        from .sqlite.sqlite_storage import SqliteStorage  # noqa: PLC0415
    except ImportError as error:
        reason = f"it is SQLite, rosbag2's .db3, which this Python was built without ({error})"
        raise NotALogError(path, reason) from None
    return SqliteStorage(path, unpacked)


STORAGES: dict[bytes, Kind] = {MAGIC: McapStorage, SQLITE_MAGIC: _sqlite}
"""What reads a file, by the bytes with which it starts."""

MAGICS = (*STORAGES, ZSTD_MAGIC)
"""How files begin that hold what was recorded."""

LONGEST_MAGIC = max(map(len, MAGICS))
"""So many bytes of a file tell whether it does [bytes]."""

# What reads a file whose first bytes are damaged, by its name; MCAP if that does not tell either.
_BY_SUFFIX: dict[str, Kind] = {'.db3': _sqlite}
_START = 512


def open_storage(path: Path) -> Storage:
    """
    Open a file of a log.

    Raises
    ------
    NotALogError
        It is none, or nothing of it can be read.

    """
    start = _start(path, path)
    storage = _unpacked(path) if start.startswith(ZSTD_MAGIC) else _plain(path, start)
    # Each of its messages may be packed as well.
    return PackedMessages(storage) if is_packed(storage.first_data()) else storage


def _plain(path: Path, start: bytes) -> Storage:
    kind = _kind(start)
    if kind is not None:
        return kind(path, None)
    reason = foreign(path, start)
    if is_certain(start):
        raise NotALogError(path, reason)
    try:
        return _BY_SUFFIX.get(path.suffix, McapStorage)(path, None)
    except NotALogError:
        if not reason and path.suffix in SUFFIXES:
            reason = 'it should be a zstd file, and does not start as one'
        if reason:
            raise NotALogError(path, reason) from None
        raise


def _unpacked(path: Path) -> Storage:
    unpacked, problem = unpack(path, lambda start: _kind(start) is not None)
    kind = _kind(_start(path, unpacked.path)) or McapStorage
    storage = kind(path, unpacked)
    if problem:
        storage.problems.note_whole(problem)
    return storage


def _kind(start: bytes) -> Kind | None:
    return next((kind for magic, kind in STORAGES.items() if start.startswith(magic)), None)


def _start(path: Path, place: Path) -> bytes:
    try:
        with open_plain(place) as file:
            return file.read(_START)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None
