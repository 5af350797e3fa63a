"""The messages of a sound SQLite file: in pieces by their numbers, each as large as a chunk."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
import sqlite3
from typing import TypeAlias

from .database import database, DatabaseError

Row: TypeAlias = tuple[int, int, bytes]

_MOST_ROWS = 4096
# What a piece holds at about and at most [bytes]; a single message may be larger.
_SIZE, _MAX_SIZE = 2 * 1024 * 1024, 16 * 1024 * 1024
# What a row takes at least: its length, its number, and what the columns are [bytes].
_LEAST = 6
# What a log can hold: columns may hold anything, whatever they are declared to be.
_SOUND = (
    "typeof(data) = 'blob' AND typeof(topic_id) = 'integer' "
    "AND typeof(timestamp) = 'integer' AND timestamp >= 0"
)
# Never by an index: what it says may be anything as well.
_FROM = 'FROM messages NOT INDEXED'
_SURVEY = f"""
SELECT topic, sound, count(*), min(time), max(time), min(id), max(id), sum(size),
    count(DISTINCT id) FROM (
    SELECT id, CASE typeof(topic_id) WHEN 'integer' THEN topic_id END AS topic,
        CASE typeof(timestamp) WHEN 'integer' THEN timestamp END AS time,
        length(data) AS size, {_SOUND} AS sound
    {_FROM} WHERE id >= ? ORDER BY id LIMIT ?
) GROUP BY topic, sound
"""  # noqa: S608 - nothing of it is a stranger's
# Limited: pages that are linked repeatedly hold endless rows.
_COUNT = f'SELECT count(*) FROM (SELECT 1 {_FROM} LIMIT ?)'  # noqa: S608 - our own
_READ = f'SELECT topic_id, timestamp, data {_FROM} WHERE id BETWEEN ? AND ? AND {_SOUND}'


@dataclass(frozen=True)
class RowRange:
    """Messages that are read together."""

    # The numbers of the first and the last of them.
    first: int
    last: int
    # Their earliest and latest time [ns].
    start: int
    end: int
    # Whose they are, by the numbers of the topics.
    topics: frozenset[int]
    # How many they are.
    count: int
    # About where they are in the file [bytes].
    offset: int

    def __str__(self) -> str:
        """Return which messages they are."""
        return f'messages {self.first} to {self.last}'


class MessageRows:
    """
    The messages of a file, read by SQLite; a row is topic, time [ns] and bytes.

    Parameters
    ----------
    path, size
        The file, and its size [bytes].

    Attributes
    ----------
    pieces, size
        What can be read by itself, and how large the file is [bytes].
    count, unsound
        How many messages there are, and how many rows that are none.

    Raises
    ------
    DatabaseError
        SQLite finds it damaged, or its rows are more than can be in it.

    """

    def __init__(self, path: Path, size: int) -> None:
        self.pieces: list[RowRange] = []
        self.count = self.unsound = 0
        self._path = path
        self.size = size
        with database(path) as connection:
            self._survey(connection)
            expected = self.count + self.unsound
            (rows,) = connection.execute(_COUNT, (expected + 1,)).fetchone()
        if rows != expected:
            raise DatabaseError('its rows are out of order')

    def read(self, piece: RowRange, topics: Collection[int] | None = None) -> list[Row]:
        """Return the rows of a piece, those of some topics or all; raises DatabaseError."""
        wanted = piece.topics if topics is None else piece.topics & set(topics)
        if not wanted:
            return []
        query = _READ
        if wanted != piece.topics:
            query += f' AND topic_id IN ({",".join(map(str, sorted(wanted)))})'
        with database(self._path) as connection:
            ends = piece.first, piece.last
            return connection.execute(f'{query} ORDER BY id', ends).fetchall()

    def _survey(self, connection: sqlite3.Connection) -> None:
        """Cut the table into pieces; their sizes follow those of the messages before."""
        following, limit, done = -(2**63), 64, 0
        while True:
            found = connection.execute(_SURVEY, (following, limit)).fetchall()
            if not found:
                return
            rows, numbers = sum(row[2] for row in found), sum(row[8] for row in found)
            size = sum(row[7] or 0 for row in found)
            if size > _MAX_SIZE and limit > 1:
                limit = max(1, min(limit, rows) // 2)
                continue
            first, last = min(row[5] for row in found), max(row[6] for row in found)
            if first < following or numbers < rows or rows > last - first + 1:
                raise DatabaseError('its rows are out of order')
            self._check_size(rows, done + size)
            self._take(found, first, last, done)
            done += size
            if last == 2**63 - 1:
                return
            following = last + 1
            limit = min(_MOST_ROWS, max(1, _SIZE * rows // (size + 1)))

    def _check_size(self, rows: int, size: int) -> None:
        """Refuse more rows than can be in the file: its pages may lie in one another."""
        least = size + _LEAST * (self.count + self.unsound + rows)
        if least > self.size:
            raise DatabaseError('its rows are larger than the file')

    def _take(self, found: list[tuple[int, ...]], first: int, last: int, offset: int) -> None:
        sound = [row for row in found if row[1]]
        count = sum(row[2] for row in sound)
        self.count += count
        self.unsound += sum(row[2] for row in found) - count
        if sound:
            start, end = min(row[3] for row in sound), max(row[4] for row in sound)
            topics = frozenset(row[0] for row in sound)
            self.pieces.append(RowRange(first, last, start, end, topics, count, offset))
