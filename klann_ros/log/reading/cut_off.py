"""Where a file ends that was not closed: the last records may be cut off without any loss."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from klann_ros.log.bag_metadata import RECORD_NAME
from mcap.opcode import Opcode

from .container import MAGIC

if TYPE_CHECKING:
    from typing import BinaryIO

_INDEX_HEAD = 6
_CUT_INDEX = struct.Struct('<QHI')
_CUT_HEAD = 8 + 4 + len(RECORD_NAME)
_DATA_END_LENGTH = 4


def is_made_anew(file: BinaryIO, offset: int, opcode: int, left: int) -> bool:
    """Tell whether what is cut off at an offset is what a recovery makes anew anyway."""
    file.seek(offset + 1)
    head = file.read(_CUT_HEAD)
    if opcode == Opcode.MESSAGE_INDEX:
        if len(head) < _CUT_INDEX.size:
            return True
        length, _, size = _CUT_INDEX.unpack_from(head)
        return bool(length >= size + _INDEX_HEAD > left - 9)
    if opcode == Opcode.METADATA:
        return head[8:] == struct.pack('<I', len(RECORD_NAME)) + RECORD_NAME.encode()
    return opcode == Opcode.DATA_END and left < len(MAGIC) + 1 + _DATA_END_LENGTH
