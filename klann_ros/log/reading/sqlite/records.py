"""The record format of SQLite: the values of a row, and where each is."""

from typing import NamedTuple

_MOST_COLUMNS = 6
_LONGEST_VARINT = 9
_INTEGERS = frozenset((1, 2, 3, 4, 5, 6))
_ZERO, _ONE, _FIRST_TEXT = 8, 9, 12
# How long values of the kinds below are [bytes].
_LENGTHS = (0, 1, 2, 3, 4, 6, 8, 8, 0, 0, 0, 0)


class BrokenRowError(Exception):
    """What stands there is no row, or not all of it is there."""


class Field(NamedTuple):
    """A value in a record: its kind, where it starts, and how long it is [bytes]."""

    kind: int
    start: int
    size: int

    @property
    def is_integer(self) -> bool:
        """Return whether it is a whole number."""
        return self.kind in _INTEGERS or self.kind in (_ZERO, _ONE)

    @property
    def is_blob(self) -> bool:
        """Return whether it is bytes."""
        return self.kind >= _FIRST_TEXT and self.kind % 2 == 0

    @property
    def is_text(self) -> bool:
        """Return whether it is a text."""
        return self.kind >= _FIRST_TEXT and self.kind % 2 == 1

    def integer(self, record: bytes) -> int:
        """Return the whole number."""
        if self.kind in (_ZERO, _ONE):
            return self.kind - _ZERO
        return int.from_bytes(self.raw(record), 'big', signed=True)

    def raw(self, record: bytes) -> bytes:
        """Return the bytes in which it stands."""
        start, end = self.start, self.start + self.size
        return record[start:end]


def fields(record: bytes, size: int) -> list[Field]:
    """Return the values in a record of a size, whose first bytes tell where they are."""
    head, at = varint(record, 0)
    if head > len(record):
        raise BrokenRowError
    place = head
    found: list[Field] = []
    while at < head and len(found) < _MOST_COLUMNS:
        kind, at = varint(record, at)
        length = _LENGTHS[kind] if kind < _FIRST_TEXT else (kind - _FIRST_TEXT) // 2
        found.append(Field(kind, place, length))
        place += length
    if (at, place) != (head, size):
        raise BrokenRowError
    return found


def varint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number of variable length, and where it ends."""
    value = 0
    # Most are short; a bag has some millions of them.
    if at < len(data) and data[at] < 0x80:
        return data[at], at + 1
    end = at + _LONGEST_VARINT
    for n, byte in enumerate(data[at:end]):
        if n == _LONGEST_VARINT - 1:
            return value << 8 | byte, at + _LONGEST_VARINT
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + n + 1
    raise BrokenRowError


def signed(number: int) -> int:
    """Return a number of 64 bits as one with a sign."""
    return number - 2**64 if number >= 2**63 else number
