"""What a file is that is no log: named by its first bytes, with what can be done about it."""

from __future__ import annotations

from codecs import getincrementaldecoder
import shlex
from typing import TYPE_CHECKING

from klann_ros.log.bag_metadata import FILE_NAME
from klann_ros.untrusted.text import printable

if TYPE_CHECKING:
    from pathlib import Path

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
