"""The topics that the channel numbers of a file stand for."""

from collections.abc import Callable
from functools import partial
from typing import Any

from klann_ros.log.bag_metadata import HASH_KEY, QOS_KEY
from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Topic
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from .content import Content
from .records import parse, parse_schema

_MAX_DEFINITIONS_SIZE = 32 * 1024 * 1024
# Memory of an entry beside its content [bytes].
_ENTRY_SIZE = 256


class Channels:
    """
    The schemas and channels of one file, collected from all places that repeat them.

    Where versions differ, because bits flipped, one under a matching CRC has priority, then the
    most frequent one.
    """

    def __init__(self) -> None:
        self._schemas = _Definitions('schema', parse_schema)
        self._channels = _Definitions('channel', partial(parse, Channel))
        # Caches: many channels may share one schema.
        self._topics: dict[int, Topic | None] = {}
        self._texts: dict[int, tuple[Schema, str]] = {}

    @property
    def contradictions(self) -> list[str]:
        """Return the schemas and channels with several versions, one line each."""
        return self._schemas.contradictions() + self._channels.contradictions()

    def add(self, opcode: int, content: bytes, offset: int = 0, *, verified: bool = False) -> None:
        """Add a schema or a channel record; ignore others, and schema 0, which means none."""
        if opcode == Opcode.SCHEMA and content[:2] != bytes(2):
            changed = self._schemas.add(content, offset, verified=verified)
            if changed is not None:
                self._texts.pop(changed, None)
                self._topics.clear()
        elif opcode == Opcode.CHANNEL:
            changed = self._channels.add(content, offset, verified=verified)
            if changed is not None:
                self._topics.pop(changed, None)

    def add_all(self, chunk: Content, offset: int) -> None:
        """Add the schemas and channels of a chunk at this offset."""
        for opcode, content in chunk.definitions():
            self.add(opcode, content, offset, verified=chunk.verified)

    def topic(self, channel: int) -> Topic | None:
        """Return the topic of a channel; None while its record or its schema is unknown."""
        if channel not in self._topics:
            self._topics[channel] = self._make_topic(channel)
        return self._topics[channel]

    def numbers(self) -> list[int]:
        """Return the known channels in the order of the file."""
        return list(self._channels.best)

    def topics(self) -> dict[int, Topic]:
        """Return the known topics by channel, in the order of the file."""
        found = {number: self.topic(number) for number in self.numbers()}
        return {number: topic for number, topic in found.items() if topic is not None}

    def _make_topic(self, number: int) -> Topic | None:
        channel = self._channels.get(number)
        if channel is None:
            return None
        known = self._schema(channel.schema_id)
        if known is None:
            return None
        schema, definition = known
        extra = dict(channel.metadata)
        qos, type_hash = extra.pop(QOS_KEY, ''), extra.pop(HASH_KEY, '')
        return Topic(
            name=channel.topic,
            type=schema.name,
            definition=definition,
            qos=qos,
            type_hash=type_hash,
            message_encoding=channel.message_encoding,
            schema_encoding=schema.encoding,
            extra=tuple(extra.items()),
        )

    def _schema(self, number: int) -> tuple[Schema, str] | None:
        """Return a schema and its text; None while it is unknown."""
        if number not in self._texts:
            schema = self._schemas.get(number) if number else Schema(0, b'', '', '')
            if schema is None:
                return None
            self._texts[number] = schema, schema.data.decode('utf-8', 'replace')
        return self._texts[number]


class _Definitions:
    """All versions of the records of one kind, by number."""

    def __init__(self, name: str, parse_one: Callable[[bytes, int], Any]) -> None:
        self._name = name
        self._parse = parse_one
        # Of each content: whether a CRC matched, and its count.
        self._versions: dict[int, dict[bytes, tuple[bool, int]]] = {}
        self.best: dict[int, bytes] = {}
        self._size = 0

    def add(self, content: bytes, offset: int, *, verified: bool) -> int | None:
        """Add a record; return its number if that has another best version now."""
        number = int.from_bytes(content[:2], 'little')
        versions = self._versions.setdefault(number, {})
        if content not in versions:
            self._parse(content, offset)
            self._size += len(content) + _ENTRY_SIZE
            if self._size > _MAX_DEFINITIONS_SIZE:
                limit = f'{_MAX_DEFINITIONS_SIZE} bytes of schemas or channels'
                raise DamagedError(f'there are more than {limit}', offset)
        checked, count = versions.get(content, (False, 0))
        versions[content] = (checked or verified, count + 1)
        best = self.best.get(number)
        if best == content or (best is not None and versions[best] >= versions[content]):
            return None
        self.best[number] = content
        return number

    def get(self, number: int) -> Any:
        content = self.best.get(number)
        return None if content is None else self._parse(content, 0)

    def contradictions(self) -> list[str]:
        return [
            f'{self._name} {number} is described in {len(versions)} ways, '
            + ('the one under a CRC' if versions[self.best[number]][0] else 'the most frequent')
            + ' was taken'
            for number, versions in self._versions.items()
            if len(versions) > 1
        ]
