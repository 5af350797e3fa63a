"""
Messages decoded by the library that knows all types, from definitions that may be anybody's.

It prints what it cannot parse, and takes the square of the time for comments and fields that are
many; so it is given no comments, no definition that is longer than those of legs, and no terminal.
"""

from collections.abc import Callable
from contextlib import redirect_stderr
from functools import lru_cache
from io import StringIO
import re
from typing import Any

from klann_ros.log.records import Topic
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

# A message that tells of a leg is much smaller; what a small file unpacks to may be anything.
MAX_MESSAGE = 256 * 1024
# A DiagnosticArray's, without comments, has 600 characters.
MAX_DEFINITION = 16 * 1024

_COMMENT = re.compile('#[^\r\n]*')
Decode = Callable[[bytes], Any]


def decoder(topic: Topic) -> Decode:
    """Return what decodes a topic's messages; it raises whatever comes of the bytes."""
    return _decoder(topic.type, topic.definition, topic.schema_encoding, topic.message_encoding)


@lru_cache(maxsize=16)
def _decoder(name: str, definition: str, schema_encoding: str, encoding: str) -> Decode:
    text = _COMMENT.sub('', definition)
    if len(text) > MAX_DEFINITION:
        return _refuse
    schema = Schema(id=1, data=text.encode(), encoding=schema_encoding, name=name)
    try:
        with redirect_stderr(StringIO()):
            decode = DecoderFactory().decoder_for(encoding, schema)
    except Exception:  # noqa: BLE001, RUF100 - the text may be anything
        decode = None
    if decode is None:
        return _refuse

    def bounded(data: bytes) -> Any:
        if len(data) > MAX_MESSAGE:
            raise ValueError(f'{len(data)} bytes, more than the limit of {MAX_MESSAGE}')
        return decode(data)

    return bounded


def _refuse(_: bytes) -> Any:
    raise ValueError('no decoder for this topic')
