"""An SQLite file of rosbag2's as a storage: a `.db3`, of any age and in any state."""

from collections.abc import Collection, Iterator
from functools import partial
from operator import itemgetter
from pathlib import Path

from klann_ros.log.bag_metadata import RECORD_KEY, RECORD_NAME
from klann_ros.log.read.block import block_of_messages, HEAD, MessageBlock
from klann_ros.log.read.sources import Source, Topics
from klann_ros.log.read.storage import Overview, Problems
from klann_ros.log.read.temporary import TemporaryFile
from klann_ros.log.records import Attachment, Message
from klann_ros.sanitize.text import counted, printable, verb
import numpy as np

from .contents import contents_of
from .database import DatabaseError
from .rows import Row, RowRange

_time_of = itemgetter(1)


class SqliteStorage:
    """
    An SQLite file of rosbag2's; see :class:`~klann_ros.log.read.storage.Storage`.

    It takes, and raises, what :func:`contents_of` does.
    """

    # What stands in it is what stands in MCAP files of this profile.
    profile = 'ros2'

    def __init__(self, path: Path, unpacked: TemporaryFile | None = None) -> None:
        self.path = path
        self.name = printable(path.name) + (' (unpacked)' if unpacked else '')
        self.contents = contents_of(path, unpacked)
        self.size = self.contents.rows.size
        self.closed = not self.contents.remarks
        self.problems = Problems()
        for text in (*self.contents.remarks, *self.contents.losses):
            self.problems.note_whole(text)
        self.holes: set[tuple[int, int]] = set()
        self._channels = {
            number: channel for channel, number in enumerate(self.contents.described.topics)
        }

    def overview(self) -> Overview:
        """Return what it holds; topics without messages are among it."""
        pieces = self.contents.rows.pieces
        described = self.contents.described
        times = None
        if pieces:
            times = min(piece.start for piece in pieces), max(piece.end for piece in pieces)
        metadata = [0] if described.metadata else []
        return Overview(list(described.topics.values()), times, metadata, [])

    def sources(self, _: Overview) -> Iterator[Source]:
        """Yield what can be read by itself."""
        for piece in self.contents.rows.pieces:
            yield Source(piece.start, piece.end, partial(self._in_time_order, piece))

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages in large pieces as they stand in it, and where each is [bytes]."""
        for piece in self.contents.rows.pieces:
            yield piece.offset, self._block(self._rows(piece))

    def first_data(self) -> bytes:
        """Return the bytes of the message that stands first; b'' if there is none."""
        for piece in self.contents.rows.pieces:
            for *_, data in self._rows(piece):
                return data
        return b''

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """Return what the table of metadata said last, as it stands in an MCAP file."""
        found = self.contents.described.metadata[offset:]
        return (RECORD_NAME, {RECORD_KEY: found[-1]}) if found else None

    def attachment_at(self, _: int) -> Attachment | None:
        """Return None: there is nothing of the kind in such files."""
        return None

    def salvage(self) -> 'SqliteSalvage':
        """Return a pass over all that is intact in it."""
        return SqliteSalvage(self)

    def close(self) -> None:
        """Let go of what was unpacked or copied to read it."""
        self.contents.close()

    def message(self, row: Row) -> Message | None:
        """Return a row as a message; None if the bag does not tell its topic."""
        number, time, data = row
        topic = self.contents.described.topics.get(number)
        # The file has one time only, and no sequence numbers.
        return None if topic is None else Message(topic, data, time, time, 0)

    def _rows(self, piece: RowRange, topics: Collection[int] | None = None) -> list[Row]:
        """Return the rows of a piece whose topics are known."""
        try:
            rows = self.contents.rows.read(piece, topics)
        except DatabaseError as error:
            self.problems.note_whole(f'{piece} are left out: {error}')
            return []
        if topics is None and len(rows) < piece.count:
            self.problems.note_whole(f'{piece.count - len(rows)} of {piece} are not all there')
        unknown = piece.topics - self._channels.keys()
        for number in unknown:
            self.problems.note_whole(f'messages of topic {number}, which is not known')
        return [row for row in rows if row[0] not in unknown] if unknown else rows

    def _in_time_order(self, piece: RowRange, names: Topics) -> Iterator[Message]:
        topics = self.contents.described.topics
        wanted = None
        if names is not None:
            wanted = [number for number, topic in topics.items() if topic.name in names]
        for number, time, data in sorted(self._rows(piece, wanted), key=_time_of):
            yield Message(topics[number], data, time, time, 0)

    def _block(self, rows: list[Row]) -> MessageBlock:
        count = len(rows)
        numbers, times, data = zip(*rows, strict=True) if rows else ((), (), ())
        heads = np.zeros(count, dtype=HEAD)
        heads['channel'] = np.fromiter(map(self._channels.__getitem__, numbers), 'u2', count)
        heads['log_time'] = heads['publish_time'] = np.fromiter(times, 'u8', count)
        topics = dict(enumerate(self.contents.described.topics.values()))
        return block_of_messages(heads, data, topics)


class SqliteSalvage:
    """All that is intact in such a file; see :class:`~klann_ros.log.read.storage.Salvage`."""

    def __init__(self, file: SqliteStorage) -> None:
        contents = file.contents
        said = [*contents.remarks, *contents.notes()]
        self.remarks = [f'{file.name}: {text}' for text in said]
        self.lost = [f'{file.name}: {text}' for text in contents.losses]
        self._file = file

    def messages(self) -> Iterator[Message]:
        """Yield all intact messages in the order in which they stand in it."""
        rows, damaged, unknown = self._file.contents.rows, 0, 0
        for piece in rows.pieces:
            try:
                found = rows.read(piece)
            except DatabaseError as error:
                self.lost.append(f'{self._file.name}: {piece}: {error}')
                continue
            damaged += piece.count - len(found)
            for row in found:
                message = self._file.message(row)
                if message is None:
                    unknown += 1
                else:
                    yield message
        if damaged:
            are = verb(damaged, 'message is', 'messages are')
            self.lost.append(f'{self._file.name}: {damaged} {are} not all there')
        if unknown:
            what = f'{counted(unknown, "message")} of topics whose description is lost'
            self.lost.append(f'{self._file.name}: {what}')

    def attachments(self) -> Iterator[Attachment]:
        """Yield nothing: there is nothing of the kind in such files."""
        return iter(())

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield nothing: rosbag2's own is made anew."""
        return iter(())
