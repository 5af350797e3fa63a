"""Which topic a channel's number stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from .mcap_file import HASH_KEY, QOS_KEY
from .parsing import parse
from .records import Topic

if TYPE_CHECKING:
    from collections.abc import Iterable


class Channels:
    """The schemas and channels of one file, gathered from wherever the file repeats them."""

    def __init__(self) -> None:
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._topics: dict[int, Topic | None] = {}

    def add(self, opcode: int, content: bytes, offset: int = 0) -> None:
        """
        Take a schema or a channel record; others are ignored.

        Raises
        ------
        DamagedError
            The record cannot be understood; the offset is for its message.

        """
        if opcode == Opcode.SCHEMA:
            schema = parse(Schema, content, offset)
            if self._schemas.get(schema.id) != schema:
                self._schemas[schema.id] = schema
                self._topics.clear()
        elif opcode == Opcode.CHANNEL:
            channel = parse(Channel, content, offset)
            if self._channels.get(channel.id) != channel:
                self._channels[channel.id] = channel
                self._topics.pop(channel.id, None)

    def add_all(self, definitions: Iterable[tuple[int, bytes]], offset: int = 0) -> None:
        """
        Take the schemas and channels of a chunk at this offset.

        Raises
        ------
        DamagedError
            As :meth:`add`.

        """
        for opcode, content in definitions:
            self.add(opcode, content, offset)

    def update(self, other: Channels) -> None:
        """Take all that another table of the same file knows."""
        self._schemas.update(other._schemas)
        self._channels.update(other._channels)
        self._topics.clear()

    def topic(self, channel: int) -> Topic | None:
        """Return the topic of a channel; None while its record or its schema is not known."""
        if channel not in self._topics:
            self._topics[channel] = self._make_topic(channel)
        return self._topics[channel]

    def numbers(self) -> list[int]:
        """Return the channels that are known."""
        return list(self._channels)

    def topics(self) -> list[Topic]:
        """Return the topics that are known."""
        found = map(self.topic, self._channels)
        return [topic for topic in found if topic is not None]

    def _make_topic(self, number: int) -> Topic | None:
        channel = self._channels.get(number)
        if channel is None:
            return None
        schema = Schema(0, b'', '', '')
        if channel.schema_id:
            known = self._schemas.get(channel.schema_id)
            if known is None:
                return None
            schema = known
        extra = dict(channel.metadata)
        qos, type_hash = extra.pop(QOS_KEY, ''), extra.pop(HASH_KEY, '')
        return Topic(
            name=channel.topic,
            type=schema.name,
            definition=schema.data.decode('utf-8', 'replace'),
            qos=qos,
            type_hash=type_hash,
            message_encoding=channel.message_encoding,
            schema_encoding=schema.encoding,
            extra=tuple(extra.items()),
        )
