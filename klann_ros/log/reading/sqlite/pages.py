"""
The pages of an SQLite file, read without SQLite, which gives up at the first that is damaged.

A row stands in a cell of a leaf page of its table, and what of it has no room there in a chain of
overflow pages; no page above is needed to read it (https://www.sqlite.org/fileformat2.html).
"""

from collections.abc import Iterator
from dataclasses import dataclass
import struct
from typing import BinaryIO, NamedTuple

from klann_ros.untrusted.files import next_data

from .records import BrokenRowError, Field, fields, signed, varint

SQLITE_MAGIC = b'SQLite format 3\0'
"""The first bytes of an SQLite file."""

HEADER_SIZE = 100
"""The first bytes of the first page, which tell the form of all."""

_TABLE_LEAF = 13
_LEAF_HEAD = 8
# Whether anything was written is asked once for so many pages.
_TOGETHER = 256
_USUAL_SIZE = 4096
_SIZES = tuple(2**n for n in range(9, 17))
_TEXTS = {1: 'utf-8', 2: 'utf-16-le', 3: 'utf-16-be'}


class Page(NamedTuple):
    """A page: its bytes, where rows may be from on, and where they are; none if it has none."""

    data: bytes
    first: int
    places: list[int]


class PageRow(NamedTuple):
    """A row as it stands in a page."""

    # Its number, and how long its record is in all [bytes].
    number: int
    size: int
    # The values in the record.
    columns: list[Field]
    # What of the record stands in the page itself.
    local: bytes
    # Where the rest is, if there is one.
    following: bytes


@dataclass(frozen=True)
class Form:
    """What the first page says of all."""

    # The size of a page, and what of it is used [bytes].
    page_size: int
    usable: int
    # How many pages there should be; 0 if it does not say.
    said: int
    # How texts are written.
    encoding: str
    # Whether there is such a first page.
    sound: bool


def form_of(head: bytes) -> Form:
    """Return the form of a file by its first bytes; what rosbag2 writes if they are damaged."""
    size = int.from_bytes(head[16:18], 'big')
    size = 65536 if size == 1 else size
    reserved = head[20] if len(head) > 20 else 0
    if not head.startswith(SQLITE_MAGIC) or size not in _SIZES or size - reserved < 480:
        return Form(_USUAL_SIZE, _USUAL_SIZE, 0, 'utf-8', sound=False)
    said, changes, valid_for = (_number(head, at, 4) for at in (28, 24, 92))
    encoding = _TEXTS.get(int.from_bytes(head[56:60], 'big'), 'utf-8')
    return Form(size, size - reserved, said if changes == valid_for else 0, encoding, sound=True)


class Pages:
    """
    The pages of an open file.

    Parameters
    ----------
    file, size
        The file, and its size [bytes].

    Attributes
    ----------
    form : Form
        What the first page says.
    count : int
        How many there are, the last of which may be cut off.

    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        file.seek(0)
        self.form = form_of(file.read(HEADER_SIZE))
        self.count = -(-size // self.form.page_size)
        self._file = file

    def numbers(self) -> Iterator[int]:
        """Yield the pages of which something was ever written: a sparse file is mostly holes."""
        size, number = self.form.page_size, 0
        while number < self.count:
            first = max(number, next_data(self._file, number * size) // size)
            number = min(first + _TOGETHER, self.count)
            yield from range(first + 1, number + 1)

    def page(self, number: int) -> Page:
        """Return a page; what is cut off is missing."""
        self._file.seek((number - 1) * self.form.page_size)
        data = self._file.read(self.form.page_size)
        head = HEADER_SIZE if number == 1 else 0
        if len(data) < head + _LEAF_HEAD or data[head] != _TABLE_LEAF:
            return Page(data, 0, [])
        count = _number(data, head + 3, 2)
        first = head + _LEAF_HEAD
        end = min(first + 2 * count, len(data) // 2 * 2)
        if first + 2 * count > self.form.usable:
            return Page(data, 0, [])
        places = [place for (place,) in struct.iter_unpack('>H', data[first:end])]
        return Page(data, first + 2 * count, places)

    def rows(self, page: Page) -> Iterator[PageRow | None]:
        """Yield the rows in a page of a table; None for what is none."""
        for place in page.places:
            yield self._row(page.data, place) if page.first <= place < len(page.data) else None

    def last_number(self, page: Page) -> int:
        """Return the number of the last row in a page of a table."""
        try:
            _, at = varint(page.data, page.places[-1])
            return signed(varint(page.data, at)[0])
        except BrokenRowError:
            return 2**63 - 1

    def whole(self, row: PageRow) -> bytes:
        """Return a row's record with its overflow pages; a BrokenRowError if not all is there."""
        parts, left, following = [row.local], row.size - len(row.local), row.following
        if left > self.count * self.form.usable:
            raise BrokenRowError
        while left > 0:
            number = int.from_bytes(following, 'big')
            # The first page never is one.
            if len(following) < 4 or not 1 < number <= self.count:
                raise BrokenRowError
            page = self.page(number).data
            end = min(self.form.usable, 4 + left)
            part = page[4:end]
            if len(part) < min(self.form.usable - 4, left):
                raise BrokenRowError
            parts.append(part)
            following, left = page[:4], left - len(part)
        return b''.join(parts)

    def _row(self, page: bytes, place: int) -> PageRow | None:
        try:
            size, at = varint(page, place)
            number, at = varint(page, at)
            end = at + _local(size, self.form.usable)
            if end > min(self.form.usable, len(page)):
                return None
            local = page[at:end]
            columns = fields(local, size)
        except BrokenRowError:
            return None
        behind = end + 4
        return PageRow(signed(number), size, columns, local, page[end:behind])


def _local(size: int, usable: int) -> int:
    """Return how much of a record of a size stands in its cell [bytes]."""
    most = usable - 35
    if size <= most:
        return size
    least = (usable - 12) * 32 // 255 - 23
    part = least + (size - least) % (usable - 4)
    return part if part <= most else least


def _number(data: bytes, start: int, size: int) -> int:
    end = start + size
    return int.from_bytes(data[start:end], 'big')
