"""
Open the files of a log, whatever they are: the first bytes of each tell, not its name.

What is no log is named by them as well, with what can be done about it.
"""

from codecs import getincrementaldecoder
from collections.abc import Callable
from pathlib import Path
import shlex
from typing import TypeAlias

from klann_ros.log.bag_metadata import FILE_NAME
from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.log.mcap.container import MAGIC
from klann_ros.log.mcap.mcap_storage import McapStorage
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .packed_messages import is_packed, PackedMessages
from .run_files import run_files, RunFiles
from .storage import Storage
from .temporary import TemporaryFile
from .zstd_file import SUFFIXES, unpack, ZSTD_MAGIC

SQLITE_MAGIC = b'SQLite format 3\0'

Kind: TypeAlias = Callable[[Path, TemporaryFile | None], Storage]

_PCAP = 'a pcap capture of a network'
_UNPACK = '; unpack it first'
_ROS_1 = (
    '; `rosbags-convert --src {path} --dst {stem} --dst-storage mcap` makes a run of it '
    '(pip install rosbags)'
)
_KINDS = {
    b'#ROSBAG V': f'a ROS 1 bag{_ROS_1}',
    b'\xd4\xc3\xb2\xa1': _PCAP,
    b'\xa1\xb2\xc3\xd4': _PCAP,
    b'\x4d\x3c\xb2\xa1': _PCAP,
    b'\xa1\xb2\x3c\x4d': _PCAP,
    b'\x0a\x0d\x0d\x0a': 'a pcapng capture of a network',
    b'ULog\x01\x12\x35': 'a ULog of PX4',
    b'\x89HDF\r\n\x1a\n': 'an HDF5 file',
    b'PAR1': 'a Parquet file',
    b'\x1f\x8b': f'a gzip file{_UNPACK}',
    b'\x04\x22\x4d\x18': f'an lz4 file{_UNPACK}',
    b'\xfd7zXZ\0': f'an xz file{_UNPACK}',
    b'BZh': f'a bzip2 file{_UNPACK}',
    b'PK\x03\x04': f'a zip file{_UNPACK}',
}
_TAR, _TAR_AT = b'ustar', 257
# It is there to be copied.
_LONGEST = 1000
# No log whose start is damaged begins with so many bytes of another kind.
_CERTAIN = 7


def _sqlite(path: Path, unpacked: TemporaryFile | None) -> Storage:
    """Return an SQLite file, where Python has SQLite: one that was built by hand may lack it."""
    try:
        from klann_ros.log.sqlite.sqlite_storage import SqliteStorage  # noqa: PLC0415
    except ImportError as error:
        reason = f"it is SQLite, rosbag2's .db3, which this Python was built without ({error})"
        raise NotALogError(path, reason) from None
    return SqliteStorage(path, unpacked)


STORAGES: dict[bytes, Kind] = {MAGIC: McapStorage, SQLITE_MAGIC: _sqlite}
"""What reads a file, by the bytes with which it starts."""

# What reads a file whose first bytes are damaged, by its name; MCAP if that does not tell either.
_BY_SUFFIX: dict[str, Kind] = {'.db3': _sqlite}
_START = 512


def open_files(path: AnyPath) -> tuple[list[Storage], RunFiles]:
    """Return those files of a log that are logs, and all files; a NotALogError if none is one."""
    found = run_files(path)
    tried = [_try(file_path, found.packed.get(file_path)) for file_path in found.paths]
    files = [file for file in tried if not isinstance(file, NotALogError)]
    failures = [failure for failure in tried if isinstance(failure, NotALogError)]
    if not files:
        raise failures[0]
    found.missing += [str(failure) for failure in failures]
    return files, found


def _try(path: Path, packed: Path | None) -> Storage | NotALogError:
    """Open a file; if it is not all that is in it as it was packed, that one."""
    try:
        storage = open_storage(path)
    except NotALogError as error:
        return error if packed is None else _try(packed, None)
    if packed is None or not storage.problems:
        return storage
    other = _try(packed, None)
    return storage if isinstance(other, NotALogError) or other.problems else other


def open_storage(path: Path) -> Storage:
    """Open a file of a log; a NotALogError if it is none, or nothing of it can be read."""
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
        with open_regular(place) as file:
            return file.read(_START)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None


def foreign(path: Path, start: bytes) -> str:
    """Return what a file is by its first bytes, for a line to people; '' if nothing tells."""
    for magic, kind in _KINDS.items():
        if start.startswith(magic):
            names = {'path': _quoted(path), 'stem': _quoted(path.with_suffix(''))}
            return f'it is {kind.format(**names)}'
    if start[_TAR_AT:].startswith(_TAR):
        return f'it is a tar archive{_UNPACK}'
    if path.name == FILE_NAME:
        return f'it only says what is in the bag; give the folder, {printable(path.parent)}'
    return 'it does not start as an MCAP file does; it is text' if _is_text(start) else ''


def is_certain(start: bytes) -> bool:
    """Return whether a file cannot be a log whose first bytes are damaged."""
    return any(start.startswith(magic) for magic in _KINDS if len(magic) >= _CERTAIN)


def _quoted(path: Path) -> str:
    return printable(shlex.quote(str(path)), _LONGEST)


def _is_text(start: bytes) -> bool:
    try:
        # The last character may be cut off.
        words = getincrementaldecoder('utf-8')().decode(start)
    except UnicodeDecodeError:
        return False
    return bool(words) and all(c.isprintable() or c in '\t\r\n' for c in words)
