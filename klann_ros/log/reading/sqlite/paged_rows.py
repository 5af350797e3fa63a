"""The messages of a damaged SQLite file, found page by page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from klann_ros.untrusted.files import open_plain

from .leaves import Found, Leaves
from .pages import Pages
from .records import BrokenRowError
from .rows import RowsError
from .topics import Words

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from .pages import PageRow
    from .records import Field
    from .rows import Piece, Row

# Cells may lie in one another, and claim together so many times what there is.
_PATIENCE = 4


class PagedRows:
    """
    The messages of a file that SQLite cannot read, or not all of.

    A row is taken for a message if it has the columns of one.

    Parameters
    ----------
    path
        The file.
    behind
        Only messages of higher numbers are wanted.

    Attributes
    ----------
    pieces, size
        What can be read by itself, and how large the file is [bytes].
    leaves
        The pages that hold messages.
    described
        What the bag says of itself.
    form, pages
        What the first page says of all, and how many there are.
    count, broken
        How many messages there are, and how many rows cannot be read.

    Raises
    ------
    OSError
        The file cannot be read.

    """

    def __init__(self, path: Path, behind: int = 0) -> None:
        self.broken = 0
        self._path = path
        self._behind = behind
        with open_plain(path) as file:
            self.size = file.seek(0, 2)
            self._left = _PATIENCE * self.size
            pages = Pages(file, self.size)
            self.form, self.pages = pages.form, pages.count
            self.leaves = Leaves(self.form.page_size, behind)
            words = Words(self.form.encoding)
            for number in pages.numbers():
                self._scan(pages, number, words)
        self.described = words.described()
        self.leaves.arrange()
        self.pieces, self.count = self.leaves.pieces, self.leaves.count

    def read(self, piece: Piece, topics: Collection[int] | None = None) -> list[Row]:
        """Return the rows of a piece, those of some topics or all; raises RowsError."""
        if topics is not None and piece.topics.isdisjoint(topics):
            return []
        rows: list[Row] = []
        last = piece.first - 1
        try:
            with open_plain(self._path) as file:
                pages = Pages(file, self.size)
                for page, left in self.leaves.pages_of(piece):
                    for number, row in _read(pages, page, left, topics):
                        if last < number <= piece.last:
                            last = number
                            rows.append(row)
        except OSError as error:
            raise RowsError(error.strerror or str(error)) from None
        return rows

    def _scan(self, pages: Pages, number: int, words: Words) -> None:
        """Take what is in a page."""
        page = pages.page(number)
        found: list[Found] = []
        for row in pages.rows(page):
            message = None if row is None else _message(row)
            if message is not None:
                if not found and pages.last_number(page) <= self._behind:
                    return
                self._left -= message.size
                if self._left >= 0 and (not found or message.number > found[-1].number):
                    found.append(message)
            elif not _take(pages, row, words):
                self.broken += 1
        if found:
            self.leaves.add(number, found)


def _take(pages: Pages, row: PageRow | None, words: Words) -> bool:
    """Let words take a row that is no message; return whether it is a row at all."""
    if row is None or _looks_like_message(row.columns):
        return False
    if not words.want(row.size, row.columns):
        return True
    try:
        words.take(row.number, pages.whole(row), row.columns)
    except BrokenRowError:
        return False
    return True


def _read(
    pages: Pages, page: int, left: int, topics: Collection[int] | None
) -> Iterator[tuple[int, Row]]:
    """Yield the messages in a page that are wanted, by number, up to so many bytes."""
    for row in pages.rows(pages.page(page)):
        message = None if row is None else _message(row)
        if row is None or message is None:
            continue
        left -= message.size
        if left < 0:
            return
        if topics is None or message.topic in topics:
            try:
                data = row.columns[3].raw(pages.whole(row))
            except BrokenRowError:
                continue
            yield message.number, (message.topic, message.time, data)


def _looks_like_message(columns: list[Field]) -> bool:
    """Return whether these are a number that stands before the record, two others, and bytes."""
    if len(columns) != 4:
        return False
    number, topic, time, data = columns
    return not number.kind and topic.is_integer and time.is_integer and data.is_blob


def _message(row: PageRow) -> Found | None:
    if not _looks_like_message(row.columns):
        return None
    topic, time = (column.integer(row.local) for column in row.columns[1:3])
    return Found(row.number, topic, time, row.columns[3].size) if time >= 0 else None
