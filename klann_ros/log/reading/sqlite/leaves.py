"""The pages that hold messages, put in order: what is read together, and what is missing."""

from __future__ import annotations

from typing import NamedTuple, TYPE_CHECKING

import numpy as np

from .rows import Piece

if TYPE_CHECKING:
    from collections.abc import Sequence

# What a piece holds at about [bytes].
_SIZE = 2 * 1024 * 1024
_LEAF = np.dtype(
    [(name, 'i8') for name in ('page', 'first', 'last', 'count', 'size', 'start', 'end')]
)
_MOST_HOLES = 1000


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
        self.pieces: list[Piece] = []
        self.count = self.missing = self.missing_behind = 0
        self.holes: list[tuple[int, int]] = []
        self._page_size = page_size
        self._behind = behind
        self._rows: list[tuple[int, ...]] = []
        self._topics: list[frozenset[int]] = []
        self._known: dict[frozenset[int], frozenset[int]] = {}
        self._pages: dict[Piece, list[tuple[int, int]]] = {}

    def add(self, page: int, found: Sequence[Found]) -> None:
        """Take a page and the messages that were found in it, in the order of their numbers."""
        times = [message.time for message in found]
        size = sum(message.size for message in found)
        ends = found[0].number, found[-1].number
        self._rows.append((page, *ends, len(found), size, min(times), max(times)))
        topics = frozenset(message.topic for message in found)
        self._topics.append(self._known.setdefault(topics, topics))

    def pages_of(self, piece: Piece) -> list[tuple[int, int]]:
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
        piece = Piece(
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
