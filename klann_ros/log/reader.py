"""
Read a log of any recorder: a run's folder or a file of it, however it is stored, also damaged.

Nothing but :class:`~klann_ros.log.errors.NotALogError` comes of what stands in a file; what is
damaged is left out and told by :attr:`Log.problem`. An OSError comes of the disk only.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
import hashlib
from pathlib import Path

from .errors import AnyPath
from .read.block import MessageBlock
from .read.opening import open_files
from .read.sources import in_time_order, latest
from .read.storage import Storage
from .records import Attachment, Message


class Log(AbstractContextManager['Log']):
    """
    An open log; get one by :func:`open_log`.

    Attributes
    ----------
    path : pathlib.Path
        Where it is.
    paths : tuple of pathlib.Path
        The files it consists of.
    topics : tuple of Topic
        All topics in it, in the order of their channels.
    start_time, end_time : int
        Log time of the earliest and the latest message [ns]; 0 without any.
    metadata : dict of str to list of dict
        The contents of the metadata records under their names, which may occur several times;
        what a later file of a split run repeats is left out.

    """

    def __init__(self, path: Path, files: list[Storage], problems: list[str]) -> None:
        self.path = path
        self._files = [(file, file.overview()) for file in files]
        self._problems = problems
        self.paths = tuple(file.path for file in files)
        overviews = [overview for _, overview in self._files]
        times = [overview.times for overview in overviews if overview.times is not None]
        self.start_time = min((start for start, _ in times), default=0)
        self.end_time = max((end for _, end in times), default=0)
        self.topics = tuple(dict.fromkeys(topic for item in overviews for topic in item.topics))
        self._sources = [
            source for file, overview in self._files for source in file.sources(overview)
        ]
        self.metadata: dict[str, list[dict[str, str]]] = {}
        repeats = Repeats()
        for file, overview in self._files:
            for offset in overview.metadata:
                self._add_metadata(file, offset, repeats)

    @property
    def problems(self) -> tuple[str, ...]:
        """Return what is wrong with the log, one line each; reading may find more."""
        found = [
            f'{file.name}{problem.place}: {problem.text}'
            for file, _ in self._files
            for problem in list(file.problems.values())
        ]
        return (*self._problems, *found)

    @property
    def problem(self) -> str:
        """Return the first problem and how many there are beside it; '' without any."""
        first, *more = self.problems or ('',)
        return f'{first} (and {len(more)} more)' if more else first

    @property
    def holes(self) -> tuple[tuple[int, int], ...]:
        """Return the log times [ns] of what is damaged, from and to; reading may find more."""
        return tuple(hole for file, _ in self._files for hole in file.holes)

    @property
    def complete(self) -> bool:
        """Return whether all files were closed and nothing was found to be wrong so far."""
        return not self.problems

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Return the attachments, read anew; damaged ones and repeated ones are left out."""
        found = (
            (file.path, file.attachment_at(offset))
            for file, overview in self._files
            for offset in overview.attachments
        )
        repeats = Repeats()
        return tuple(
            attachment
            for path, attachment in found
            if attachment is not None and not repeats.is_one(path, attachment_key(attachment))
        )

    def messages(
        self,
        topics: Iterable[str] | None = None,
        *,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Message]:
        """
        Yield the messages in the order of their log times.

        Where an index is missing, messages wait for earlier ones that stand behind them, up to
        40 MB or eight times the file's size; only beyond that is the order partial. Damaged
        chunks are left out, and are a problem from then on.

        Parameters
        ----------
        topics
            Names of the topics that are wanted; all by default.
        start, end
            The first and the last log time that is wanted [ns]; chunks before and after are not
            unpacked, as far as an index tells of them.

        """
        wanted = None if topics is None else frozenset(topics)
        if start is None and end is None:
            return in_time_order(self._sources, wanted)
        first = self.start_time if start is None else start
        last = self.end_time if end is None else end
        within = [s for s in self._sources if s.end >= first and s.start <= last]
        found = in_time_order(within, wanted)
        return (message for message in found if first <= message.log_time <= last)

    def latest(self, counts: Mapping[str, int], before: int) -> list[Message]:
        """
        Return the last messages before a log time [ns], in the order of their log times.

        Parameters
        ----------
        counts
            How many are wanted of which topic.
        before
            The time before which they were received.

        """
        return latest(self._sources, counts, before)

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """
        Yield the messages in large pieces, as they stand in the files.

        Parameters
        ----------
        progress
            Is called for each with how much of the log was read before it, from 0 to 1.

        """
        whole = sum(file.size for file, _ in self._files) or 1
        before = 0
        for file, _ in self._files:
            for offset, block in file.blocks():
                if progress is not None:
                    progress((before + offset) / whole)
                yield block
            before += file.size

    def close(self) -> None:
        """
        Let go of the log; what it has told stays valid.

        Files are open only while they are read; what was unpacked to read them is removed.
        """
        for file, _ in self._files:
            file.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _add_metadata(self, file: Storage, offset: int, repeats: 'Repeats') -> None:
        record = file.metadata_at(offset)
        if record is not None and not repeats.is_one(file.path, metadata_key(*record)):
            name, content = record
            self.metadata.setdefault(name, []).append(content)


def open_log(path: AnyPath) -> Log:
    """
    Open a log: a run's folder, or one file of MCAP or SQLite, as rosbag2 packs them or not.

    Raises
    ------
    NotALogError
        There is nothing at the path, or nothing of it can be read.

    """
    files, found = open_files(path)
    return Log(Path(path), files, found.missing + found.remarks)


class Repeats:
    """Tells what was met in an earlier file of a run already; within one file nothing is one."""

    def __init__(self) -> None:
        self._met: dict[Hashable, Path] = {}

    def is_one(self, path: Path, key: Hashable) -> bool:
        """Return whether an earlier file than this one has the same."""
        return self._met.setdefault(key, path) != path


def metadata_key(name: str, content: Mapping[str, str]) -> Hashable:
    """Return what makes two metadata records the same."""
    return name, tuple(sorted(content.items()))


def attachment_key(attachment: Attachment) -> Hashable:
    """Return what makes two attachments the same: all but when they were attached."""
    digest = hashlib.sha256(attachment.data).digest()
    return attachment.name, attachment.media_type, digest
