"""The contents of records, parsed by the mcap library on bytes that cannot mislead it."""

import io
import struct
from typing import Any, cast, TypeVar
import zlib

from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Attachment
from klann_ros.sanitize.text import printable
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError

Parsed = TypeVar('Parsed', bound=records.McapRecord)


_TEXTS = ('ros2msg', 'ros2idl', 'ros1msg')


class _Content(ReadDataStream):
    """A record's content; unlike the library's stream it gives all bytes asked for, or none."""

    def __init__(self, content: bytes) -> None:
        # Nothing is read of a stream: to cut the bytes saves a third of the time.
        super().__init__(io.BytesIO())
        self._content, self._at = content, 0

    @property
    def count(self) -> int:
        return self._at

    def read(self, length: int) -> bytes:
        begin, end = self._at, self._at + length
        if end > len(self._content):
            raise EndOfFile
        self._at = end
        return self._content[begin:end]


def parse(kind: type[Parsed], content: bytes, offset: int = 0) -> Parsed:
    """Return a record of one of the library's classes; the offset is for the error's message."""
    try:
        # Each class has a `read`, though their base has none.
        parsed: Parsed = cast('Any', kind).read(_Content(content))
    except (McapError, struct.error, ValueError) as error:
        reason = f'the {kind.__name__.lower()} cannot be understood'
        raise DamagedError(reason, offset) from error
    return parsed


def parse_schema(content: bytes, offset: int = 0) -> records.Schema:
    """Return a schema; the offset is for the error's message."""
    schema = parse(records.Schema, content, offset)
    if schema.encoding in _TEXTS:
        try:
            schema.data.decode()
        except UnicodeDecodeError:
            reason = f"the definition of '{printable(schema.name)}' is no text"
            raise DamagedError(reason, offset) from None
    return schema


def parse_attachment(content: bytes, offset: int = 0) -> Attachment:
    """Return an attachment, its CRC checked where there is one; the offset is for the error."""
    record = parse(records.Attachment, content, offset)
    said = crc_of_attachment(content)
    if said not in (0, zlib.crc32(content[:-4])):
        reason = f"the CRC of the attachment '{printable(record.name)}' is wrong"
        raise DamagedError(reason, offset)
    return Attachment(
        record.name, record.media_type, record.data, record.log_time, record.create_time
    )


def crc_of_attachment(content: bytes) -> int:
    """Return the CRC that an attachment says it has, 0 for none."""
    return int.from_bytes(content[-4:], 'little')
