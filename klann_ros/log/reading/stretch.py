"""
Messages outside of chunks, read many at a time.

What stands one behind the other in a file without chunks are messages, hundreds of thousands of
them, and now and then a small record of a kind that nobody knows. As long as it is nothing else,
each is believed since sound ones follow it, and to look at each by itself takes twenty times as
long. The last of them are left to whoever does.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass
import struct
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from .content import Content
from .layout import is_known

if TYPE_CHECKING:
    from typing import BinaryIO

_HEAD = struct.Struct('<BQ')
_LOG_TIME = struct.Struct('<6xQ')
_MESSAGE_HEAD = 22
# An unknown record that is longer could be one whose opcode is damaged.
_MAX_UNKNOWN = 32
# So many are left.
_LEFT = 3
_FIRST, _LAST = 4096, 1024 * 1024


@dataclass(frozen=True)
class Stretch:
    """
    Messages that stand together.

    Parameters
    ----------
    content
        The messages.
    end
        Where they end in the file [bytes].

    """

    content: Content
    end: int


class Stretches:
    """Reads them from an open file, as much at once as was of use before."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = _FIRST

    def at(self, offset: int, until: int) -> Stretch | None:
        """Return the messages that stand between two offsets; None if these are too few."""
        self._file.seek(offset)
        data = self._file.read(max(0, min(self._size, until - offset)))
        found = _records(data)
        taken = found[: max(0, len(found) - _LEFT)]
        position = found[len(taken)] if taken else 0
        of_use = 2 * position > len(data)
        self._size = min(4 * self._size, _LAST) if of_use else _FIRST
        if not taken:
            return None
        starts = array('Q', (start for start in taken if data[start] == Opcode.MESSAGE))
        times = array('Q', (_LOG_TIME.unpack_from(data, start + 9)[0] for start in starts))
        content = Content(
            memoryview(data),
            starts,
            times,
            array('Q'),
            verified=False,
            unknown=len(taken) - len(starts),
        )
        return Stretch(content, offset + position)


def _records(data: bytes) -> list[int]:
    """Return where the messages and the small unknown records start that are whole in the data."""
    found = []
    position, last = 0, len(data) - _HEAD.size
    while position <= last:
        opcode, length = _HEAD.unpack_from(data, position)
        end = position + _HEAD.size + length
        if end > len(data):
            break
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE_HEAD:
                break
        elif not opcode or is_known(opcode) or length > _MAX_UNKNOWN:
            break
        found.append(position)
        position = end
    return found
