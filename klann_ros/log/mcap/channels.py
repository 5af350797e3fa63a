"""Which topic a channel's number stands for."""

from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from klann_ros.log.bag_metadata import HASH_KEY, QOS_KEY
from klann_ros.log.errors import DamagedError
from klann_ros.log.records import Topic
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from .parsing import parse, parse_schema

_MAX_SIZE = 32 * 1024 * 1024
# What an entry takes beside its content.
_ENTRY = 256


class Channels:
    """
    The schemas and channels of one file, gathered from wherever the file repeats them.

    Where what it says differs, since bits of it flipped, that counts which stands under a CRC that
    holds, and then what stands there most often.
    """

    def __init__(self) -> None:
        self._schemas = _Definitions('schema', parse_schema)
        self._channels = _Definitions('channel', partial(parse, Channel))
        self._topics: dict[int, Topic | None] = {}
        # Many channels may share one schema: its text is made once, and those it is told by.
        self._texts: dict[int, tuple[Schema, str]] = {0: (Schema(0, b'', '', ''), '')}
        self._sharing: defaultdict[int, set[int]] = defaultdict(set)

    @property
    def contradictions(self) -> list[str]:
        """Return which schemas and channels the file describes in several ways, a line each."""
        return self._schemas.contradictions() + self._channels.contradictions()

    def add(self, opcode: int, content: bytes, offset: int = 0, *, verified: bool = False) -> None:
        """Take a schema or a channel record; others are ignored."""
        if opcode == Opcode.SCHEMA:
            # One with the number 0, which stands for none, is to be ignored.
            if content[:2] == bytes(2):
                return
            changed = self._schemas.add(content, offset, verified=verified)
            if changed is not None:
                self._texts.pop(changed, None)
                for channel in self._sharing.pop(changed, ()):
                    self._topics.pop(channel, None)
        elif opcode == Opcode.CHANNEL:
            changed = self._channels.add(content, offset, verified=verified)
            if changed is not None:
                self._topics.pop(changed, None)

    def add_all(
        self, definitions: Iterable[tuple[int, bytes]], offset: int = 0, *, verified: bool = False
    ) -> None:
        """Take the schemas and channels of a chunk at this offset."""
        for opcode, content in definitions:
            self.add(opcode, content, offset, verified=verified)

    def update(self, other: 'Channels') -> None:
        """Take all that another table of the same file knows."""
        self._schemas.update(other._schemas)  # noqa: SLF001 - its own kind
        self._channels.update(other._channels)  # noqa: SLF001 - as above
        self._forget()

    def _forget(self) -> None:
        self._topics.clear()
        self._sharing.clear()
        self._texts = {0: self._texts[0]}

    def topic(self, channel: int) -> Topic | None:
        """Return the topic of a channel; None while its record or its schema is not known."""
        if channel not in self._topics:
            self._topics[channel] = self._make_topic(channel)
        return self._topics[channel]

    def numbers(self) -> list[int]:
        """Return the channels that are known."""
        return self._channels.numbers()

    def topics(self) -> list[Topic]:
        """Return the topics that are known."""
        found = map(self.topic, self._channels.numbers())
        return [topic for topic in found if topic is not None]

    def _make_topic(self, number: int) -> Topic | None:
        channel = self._channels.get(number)
        if channel is None:
            return None
        self._sharing[channel.schema_id].add(number)
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
        """Return a schema and its text; None while it is not known."""
        if number not in self._texts:
            schema = self._schemas.get(number)
            if schema is None:
                return None
            self._texts[number] = schema, schema.data.decode('utf-8', 'replace')
        return self._texts[number]


class _Definitions:
    """Records of one kind by their number, each in all the versions that were met."""

    def __init__(self, name: str, parse_one: Callable[[bytes, int], Any]) -> None:
        self._name = name
        self._parse = parse_one
        # Under the number each version's content: whether a CRC held, and how often it was met.
        self._versions: dict[int, dict[bytes, tuple[bool, int]]] = {}
        self._best: dict[int, bytes] = {}
        self._size = 0

    def add(self, content: bytes, offset: int, *, verified: bool) -> int | None:
        """Take a record; return its number if something else holds for that number now."""
        number = int.from_bytes(content[:2], 'little')
        versions = self._versions.setdefault(number, {})
        if content not in versions:
            self._parse(content, offset)
            self._size += len(content) + _ENTRY
            if self._size > _MAX_SIZE:
                reason = f'there are more than {_MAX_SIZE} bytes of schemas or channels'
                raise DamagedError(reason, offset)
        checked, count = versions.get(content, (False, 0))
        versions[content] = (checked or verified, count + 1)
        best = self._best.get(number)
        if best == content or (best is not None and versions[best] >= versions[content]):
            return None
        self._best[number] = content
        return number

    def update(self, other: '_Definitions') -> None:
        """Take the versions of another table, as often as they were met there."""
        for versions in other._versions.values():  # noqa: SLF001 - its own kind
            for content, (verified, _) in versions.items():
                self.add(content, 0, verified=verified)

    def get(self, number: int) -> Any:
        """Return the record of a number, None if there is none."""
        content = self._best.get(number)
        return None if content is None else self._parse(content, 0)

    def numbers(self) -> list[int]:
        """Return the numbers, in the order in which they were met."""
        return list(self._best)

    def contradictions(self) -> list[str]:
        """Return which numbers have several versions, a line each."""
        return [
            f'{self._name} {number} is described in {len(versions)} ways, '
            + ('the one under a CRC' if versions[self._best[number]][0] else 'the most frequent')
            + ' was taken'
            for number, versions in self._versions.items()
            if len(versions) > 1
        ]
