"""The messages of a damaged SQLite file, found page by page."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from klann_ros.untrusted.files import open_plain
import numpy as np

from .pages import PageRow, Pages
from .records import BrokenRowError, Field
from .rows import Row, RowRange, RowsError
from .topics import Words

# Cells may lie in one another, and claim together so many times what there is.
_PATIENCE = 4
# What a piece holds at about [bytes].
_SIZE = 2 * 1024 * 1024
_LEAF = np.dtype(
    [(name, 'i8') for name in ('page', 'first', 'last', 'count', 'size', 'start', 'end')]
)
_MOST_HOLES = 1000


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

    def read(self, piece: RowRange, topics: Collection[int] | None = None) -> list[Row]:
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


def _message(row: PageRow) -> 'Found | None':
    if not _looks_like_message(row.columns):
        return None
    topic, time = (column.integer(row.local) for column in row.columns[1:3])
    return Found(row.number, topic, time, row.columns[3].size) if time >= 0 else None


class Found(NamedTuple):
    """A message without its bytes: number, topic, time [ns], and how many bytes it has."""

    number: int
    topic: int
    time: int
    size: int


class Leaves:
    """
    Pages that hold messages.

    A number that stands in several pages counts once. rosbag2 numbers the messages from 1 on
    without a gap.

    Parameters
    ----------
    page_size
        How large a page is [bytes].
    behind
        Only messages of higher numbers count.

    Attributes
    ----------
    pieces
        What can be read by itself, in the order of the numbers.
    count
        How many messages there are.
    missing, missing_behind
        How many are missing by their numbers, and the number behind which the first of them is.
    holes
        The times before and behind those that are missing [ns].

    """

    def __init__(self, page_size: int, behind: int = 0) -> None:
        self.pieces: list[RowRange] = []
        self.count = self.missing = self.missing_behind = 0
        self.holes: list[tuple[int, int]] = []
        self._page_size = page_size
        self._behind = behind
        self._rows: list[tuple[int, ...]] = []
        self._topics: list[frozenset[int]] = []
        self._known: dict[frozenset[int], frozenset[int]] = {}
        self._pages: dict[RowRange, list[tuple[int, int]]] = {}

    def add(self, page: int, found: Sequence[Found]) -> None:
        """Take a page and the messages that were found in it, in the order of their numbers."""
        times = [message.time for message in found]
        size = sum(message.size for message in found)
        ends = found[0].number, found[-1].number
        self._rows.append((page, *ends, len(found), size, min(times), max(times)))
        topics = frozenset(message.topic for message in found)
        self._topics.append(self._known.setdefault(topics, topics))

    def pages_of(self, piece: RowRange) -> list[tuple[int, int]]:
        """Return the pages of a piece, and how many bytes the messages in each have."""
        return self._pages[piece]

    def arrange(self) -> None:
        """Put all pages that were added into pieces."""
        leaves = np.array(self._rows, dtype=_LEAF)
        self._rows.clear()
        last, end, size = self._behind, -1, 0
        together: list[int] = []
        for n in np.argsort(leaves['first'], kind='stable').tolist():
            leaf = leaves[n]
            if leaf['last'] <= last:
                continue
            # What stands in an earlier page as well is not read again.
            leaf['count'] = self._count(leaf, last, end)
            last, end = int(leaf['last']), int(leaf['end'])
            together.append(n)
            size += int(leaf['size'])
            if size > _SIZE:
                self._put_together(leaves, together)
                together, size = [], 0
        if together:
            self._put_together(leaves, together)

    def _count(self, leaf: np.void, last: int, end: int) -> int:
        """Return how many messages a page has that no other had; count those that are missing."""
        first = max(int(leaf['first']), last + 1)
        count = min(int(leaf['count']), int(leaf['last']) - first + 1)
        self.count += count
        missing = int(leaf['last']) - last - count
        if missing <= 0:
            return count
        if not self.missing:
            self.missing_behind = last
        self.missing += missing
        if end >= 0 and len(self.holes) < _MOST_HOLES:
            self.holes.append((end, max(end, int(leaf['start']))))
        return count

    def _put_together(self, leaves: np.ndarray, rows: list[int]) -> None:
        some = leaves[rows]
        before = self.pieces[-1].last if self.pieces else self._behind
        piece = RowRange(
            max(int(some['first'][0]), before + 1),
            int(some['last'][-1]),
            int(some['start'].min()),
            int(some['end'].max()),
            frozenset().union(*(self._topics[n] for n in rows)),
            int(some['count'].sum()),
            (int(some['page'][0]) - 1) * self._page_size,
        )
        self.pieces.append(piece)
        self._pages[piece] = list(zip(some['page'].tolist(), some['size'].tolist(), strict=True))
