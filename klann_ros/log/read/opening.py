"""Open the files of a log by their first bytes; other formats are named, with what helps."""

from codecs import getincrementaldecoder
from collections.abc import Callable
from pathlib import Path
import shlex
from typing import TypeAlias

from klann_ros.log.bag_metadata import FILE_NAME
from klann_ros.log.errors import AnyPath, NotALogError
from klann_ros.log.mcap.mcap_storage import McapStorage
from klann_ros.log.mcap.records import MAGIC
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .compressed import COMPRESSED_SUFFIXES, CompressedMessages, is_compressed, unpack, ZSTD_MAGIC
from .run_files import LogFiles, run_files
from .storage import Storage, TemporaryFile

_SQLITE_MAGIC = b'SQLite format 3\0'

_OpenStorage: TypeAlias = Callable[[Path, TemporaryFile | None], Storage]

_PCAP = 'a pcap capture of a network'
_UNPACK = '; unpack it first'
_ROS_1 = (
    '; `rosbags-convert --src {path} --dst {stem} --dst-storage mcap` makes a run of it '
    '(pip install rosbags)'
)
_FOREIGN_FORMATS = {
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
    b'version https://git-lfs': 'a pointer of Git LFS; `git lfs pull` fetches the file',
}
_TAR, _TAR_OFFSET = b'ustar', 257
# A path in a command to be copied.
_MAX_PATH = 1000
# No log with a damaged start begins with as many bytes of another format.
_CERTAIN_SIZE = 7
_START_SIZE = 512


def _open_sqlite(path: Path, unpacked: TemporaryFile | None) -> Storage:
    """Open an SQLite file; a Python built by hand may lack SQLite."""
    try:
        from .sqlite_storage import SqliteStorage  # noqa: PLC0415
    except ImportError as error:
        reason = f"it is SQLite, rosbag2's .db3, which this Python was built without ({error})"
        raise NotALogError(path, reason) from None
    return SqliteStorage(path, unpacked)


_STORAGES: dict[bytes, _OpenStorage] = {MAGIC: McapStorage, _SQLITE_MAGIC: _open_sqlite}


def open_files(path: AnyPath) -> tuple[list[Storage], LogFiles]:
    """Return the readable files of a log, and all its files; a NotALogError if none is one."""
    log_files = run_files(path)
    storages: list[Storage] = []
    failures: list[NotALogError] = []
    for file_path in log_files.paths:
        storage = _open_or_original(file_path, log_files.packed.get(file_path))
        if isinstance(storage, NotALogError):
            failures.append(storage)
        else:
            storages.append(storage)
    if not storages:
        raise failures[0]
    log_files.missing += map(str, failures)
    return storages, log_files


def _open_or_original(path: Path, packed: Path | None) -> Storage | NotALogError:
    """Open a file, or its compressed original if that is intact and the file is not."""
    try:
        storage = open_storage(path)
    except NotALogError as error:
        return error if packed is None else _open_or_original(packed, None)
    if packed is None or not storage.problems:
        return storage
    original = _open_or_original(packed, None)
    return storage if isinstance(original, NotALogError) or original.problems else original


def open_storage(path: Path) -> Storage:
    """Open a file of a log; a NotALogError if it is none, or nothing of it can be read."""
    start = _first_bytes(path, path)
    storage = _open_unpacked(path) if start.startswith(ZSTD_MAGIC) else _open_plain(path, start)
    # Its messages may be compressed as well.
    return CompressedMessages(storage) if is_compressed(storage.first_data()) else storage


def _open_plain(path: Path, start: bytes) -> Storage:
    """Open a file that is not compressed, by its first bytes or its suffix."""
    open_format = _opener(start)
    if open_format is not None:
        return open_format(path, None)
    reason = _foreign_format(path, start)
    if any(start.startswith(magic) for magic in _FOREIGN_FORMATS if len(magic) >= _CERTAIN_SIZE):
        raise NotALogError(path, reason)
    try:
        return (_open_sqlite if path.suffix == '.db3' else McapStorage)(path, None)
    except NotALogError:
        if not reason and path.suffix in COMPRESSED_SUFFIXES:
            reason = 'it should be a zstd file, and does not start as one'
        if reason:
            raise NotALogError(path, reason) from None
        raise


def _open_unpacked(path: Path) -> Storage:
    """Unpack a zstd file and open its content, by default as MCAP."""
    unpacked, problem = unpack(path, lambda start: _opener(start) is not None)
    open_format = _opener(_first_bytes(path, unpacked.path)) or McapStorage
    storage = open_format(path, unpacked)
    if problem:
        storage.problems.note_whole(problem)
    return storage


def _opener(start: bytes) -> _OpenStorage | None:
    """Return what opens a file with these first bytes; None for another format."""
    return next((opener for magic, opener in _STORAGES.items() if start.startswith(magic)), None)


def _first_bytes(path: Path, plain_path: Path) -> bytes:
    """Return the first bytes of a file or its plain copy."""
    try:
        with open_regular(plain_path) as file:
            return file.read(_START_SIZE)
    except OSError as error:
        raise NotALogError(path, error.strerror or str(error)) from None


def _foreign_format(path: Path, start: bytes) -> str:
    """Return the format of a file by its first bytes, as a half sentence; '' if unknown."""
    for magic, kind in _FOREIGN_FORMATS.items():
        if start.startswith(magic):
            names = {'path': _quoted(path), 'stem': _quoted(path.with_suffix(''))}
            return f'it is {kind.format(**names)}'
    if start[_TAR_OFFSET:].startswith(_TAR):
        return f'it is a tar archive{_UNPACK}'
    if path.name == FILE_NAME:
        return f'it only describes the bag; give the folder, {printable(path.parent)}'
    return 'it does not start as an MCAP file does; it is text' if _is_text(start) else ''


def _quoted(path: Path) -> str:
    return printable(shlex.quote(str(path)), _MAX_PATH)


def _is_text(start: bytes) -> bool:
    try:
        # The last character may be truncated.
        text = getincrementaldecoder('utf-8')().decode(start)
    except UnicodeDecodeError:
        return False
    return bool(text) and all(c.isprintable() or c in '\t\r\n' for c in text)
