"""
Read a log of any recorder: a run's folder or a file of it, in any format and state.

The content of a file raises nothing but :class:`~klann_ros.log.errors.NotALogError`; damaged parts
are left out and reported by :attr:`Log.problem`. An OSError is an error of the disk.
Impossible log times are replaced: a counter rolled over, or a clock was not set.
"""

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property
import hashlib
import heapq
from itertools import chain
from operator import attrgetter
from pathlib import Path

from klann_ros.sanitize.text import counted, verb
import numpy as np

from . import run_parameters
from .errors import AnyPath
from .read.opening import open_files
from .read.storage import MessageBlock, Source, spanned_time, Storage, Topics
from .records import Attachment, Message

MAX_LOG_DURATION = 10 * 365 * 86400 * 10**9
"""A log time further from the others is impossible [ns]: ten years."""
MAX_ROS_TIME = 2**63 - 1
"""ROS's times are signed [ns]."""


@dataclass(frozen=True)
class LogTimes:
    """The log times of a log [ns]: the first and the last possible one, and impossible ones."""

    start: int
    end: int
    count: int = 0
    impossible_count: int = 0
    # An impossible one [ns].
    example: int = 0

    def __str__(self) -> str:
        """Return the impossible log times in one line; '' for none."""
        if not self.impossible_count:
            return ''
        are_impossible = verb(self.impossible_count, 'is', 'are')
        date = datetime.fromtimestamp(self.example // 10**9, timezone.utc)
        return (
            f'{self.impossible_count} of {counted(self.count, "log time")} {are_impossible} '
            f'impossible ({date:%Y-%m-%d %H:%M:%S}), more than ten years from the others'
        )

    def repaired(self, blocks: Iterable[MessageBlock]) -> Iterator[MessageBlock]:
        """Yield blocks where an impossible log time is replaced by the one before it."""
        if not self.impossible_count:
            yield from blocks
            return
        last_time = np.uint64(self.start)
        for block in blocks:
            times = block.heads['log_time']
            is_possible = (times >= self.start) & (times <= self.end)
            rows = np.maximum.accumulate(np.where(is_possible, np.arange(len(times)), -1))
            heads = block.heads.copy()
            heads['log_time'] = np.where(rows < 0, last_time, times[rows])
            # An unknown publish time is the log time.
            heads['publish_time'] = np.where(is_possible, heads['publish_time'], heads['log_time'])
            last_time = heads['log_time'][-1] if len(heads) else last_time
            yield replace(block, heads=heads)


def possible_times(blocks: Iterable[MessageBlock]) -> LogTimes:
    """Return the possible log times: those less than MAX_LOG_DURATION from their median."""
    pieces = [block.heads['log_time'].copy() for block in blocks]
    times = np.concatenate(pieces) if pieces else np.empty(0, np.uint64)
    if not len(times):
        return LogTimes(0, 0)
    ros_times = times[times <= MAX_ROS_TIME]
    candidates = ros_times if len(ros_times) else times
    middle = len(candidates) // 2
    median = np.partition(candidates, middle)[middle]
    distances = np.maximum(times, median) - np.minimum(times, median)
    is_possible = distances < MAX_LOG_DURATION
    possible = times[is_possible]
    impossible = times[~is_possible]
    return LogTimes(
        int(possible.min()),
        int(possible.max()),
        len(times),
        len(impossible),
        int(impossible[0]) if len(impossible) else 0,
    )


# Messages that are kept beside the wanted number while the last ones are searched.
_SLACK = 100


class Log(AbstractContextManager['Log']):
    """
    An open log, returned by :func:`open_log`.

    Attributes
    ----------
    path : pathlib.Path
        Its path.
    paths : tuple of pathlib.Path
        Its files.
    topics : tuple of Topic
        All topics, in the order of their channels.
    times : LogTimes
        Its log times; printed, the impossible ones in a line.
    start_time, end_time : int
        Earliest and latest possible log time [ns]; 0 without any message.
    metadata : dict of str to list of dict
        The contents of the metadata records by name; those that a later file of a split run
        repeats are left out.

    """

    def __init__(self, path: Path, files: list[Storage], problems: list[str]) -> None:
        self.path = path
        self._files = files
        self._problems = problems
        self.paths = tuple(file.path for file in files)
        overviews = [file.overview() for file in files]
        times = spanned_time(overview.times for overview in overviews)
        self.times = LogTimes(*(times or (0, 0)))
        if self.times.end - self.times.start > MAX_LOG_DURATION:
            self.times = possible_times(self.blocks())
        self.start_time = self.times.start
        self.end_time = self.times.end
        self.topics = tuple(dict.fromkeys(chain(*(overview.topics for overview in overviews))))
        self._sources = [source for file in files for source in file.sources()]
        self.metadata: dict[str, list[dict[str, str]]] = {}
        # The first file with each record: a file does not repeat itself.
        first_files: dict[Hashable, Path] = {}
        for file in files:
            for name, content in file.metadata():
                key = name, tuple(sorted(content.items()))
                if first_files.setdefault(key, file.path) == file.path:
                    self.metadata.setdefault(name, []).append(content)

    @property
    def problems(self) -> tuple[str, ...]:
        """Return the faults of the log, one line each; reading may find more."""
        problems = list(self._problems)
        for file in self._files:
            problems += file.problems.lines(file.name)
        return tuple(problems)

    @property
    def is_refused_only(self) -> bool:
        """Return whether all its problems are limits of this machine, and none is damage."""
        problems = list(chain(*(file.problems.values() for file in self._files)))
        return not self._problems and bool(problems) and all(p.is_refusal for p in problems)

    @property
    def problem(self) -> str:
        """Return the first problem and the number of further ones; '' without any."""
        first, *further = self.problems or ('',)
        return f'{first} (and {len(further)} more)' if further else first

    @property
    def solvers(self) -> list[run_parameters.SolverParameters]:
        """
        Return the parameters of the run's solvers, in the order of time.

        They are records of recorder_node, or else messages of `leg_description`, which any
        recorder has.
        """
        return [*self._described_solvers.solvers]

    @property
    def refused_descriptions(self) -> list[str]:
        """Return why messages of `leg_description` describe no solver."""
        return [*self._described_solvers.refusals]

    @cached_property
    def _described_solvers(self) -> run_parameters.DescribedSolvers:
        # Read once: it may unpack the whole log.
        records = self.metadata.get(run_parameters.SOLVER_RECORD)
        if records:
            solvers = run_parameters.recorded_solvers(records)
            return run_parameters.DescribedSolvers(solvers, [])
        names = {t.name for t in self.topics if run_parameters.is_leg_description(t)}
        messages = self.messages(names) if names else ()
        return run_parameters.described_solvers(messages)

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Return the first and last log time [ns] of damaged parts; reading may find more."""
        return tuple(gap for file in self._files for gap in file.gaps)

    @property
    def complete(self) -> bool:
        """Return whether all files were closed and no fault was found so far."""
        return not self.problems

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Return the attachments, without damaged and repeated ones; read at each call."""
        return tuple(self.each_attachment())

    def each_attachment(self) -> Iterator[Attachment]:
        """Yield the attachments, as in `attachments`, with one at a time in memory."""
        first_files: dict[Hashable, Path] = {}
        for file in self._files:
            for attachment in file.attachments():
                digest = hashlib.sha256(attachment.data).digest()
                key = attachment.name, attachment.media_type, digest
                if first_files.setdefault(key, file.path) == file.path:
                    yield attachment

    def messages(
        self,
        topics: Iterable[str] | None = None,
        *,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Message]:
        """
        Yield the messages ordered by log time.

        Chunks that overlap in time are unpacked together, up to the larger of 80 MB and eight
        times the file's size; beyond that they are read one after the other, so that their
        messages may be out of order. Damaged chunks are left out, and then in `problems`.

        Parameters
        ----------
        topics
            Names of the wanted topics; all by default.
        start, end
            The first and the last wanted log time [ns]; chunks before and after are not unpacked
            if the file has an index of their times.

        """
        names = None if topics is None else frozenset(topics)
        if start is None and end is None:
            return _merge_by_time(self._sources, names)
        start = self.start_time if start is None else start
        end = self.end_time if end is None else end
        sources = [
            source for source in self._sources if source.end >= start and source.start <= end
        ]
        merged = _merge_by_time(sources, names)
        return (message for message in merged if start <= message.log_time <= end)

    def latest(self, counts: Mapping[str, int], end_time: int) -> list[Message]:
        """Return the last messages before a log time [ns], by it: `counts` of each topic."""
        latest: dict[str, list[Message]] = {name: [] for name in counts}
        earlier = (source for source in self._sources if source.start < end_time)
        # Backwards, until no earlier source can hold a wanted message.
        for source in sorted(earlier, key=attrgetter('end'), reverse=True):
            incomplete = {
                name
                for name, messages in latest.items()
                if len(messages) < counts[name] or messages[0].log_time <= source.end
            }
            if not incomplete:
                break
            for message in source.read(incomplete):
                name = message.topic.name
                if message.log_time < end_time:
                    latest[name].append(message)
                    # A file without an index may have any number of messages.
                    if len(latest[name]) > 2 * counts[name] + _SLACK:
                        latest[name] = _last_by_time(latest[name], counts[name])
            for name in incomplete:
                latest[name] = _last_by_time(latest[name], counts[name])
        return _last_by_time(list(chain(*latest.values())), sum(counts.values()))

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """
        Yield the messages in large blocks, in the order of the files.

        `progress` is called for each block with the part of the log before it, from 0 to 1.
        """
        total_size = sum(file.size for file in self._files) or 1
        file_offset = 0
        for file in self._files:
            for offset, block in file.blocks():
                if progress is not None:
                    progress((file_offset + offset) / total_size)
                yield block
            file_offset += file.size

    def close(self) -> None:
        """Remove the unpacked copies; returned data stay valid."""
        for file in self._files:
            file.close()

    def __exit__(self, *_: object) -> None:
        self.close()


def open_log(path: AnyPath) -> Log:
    """
    Open a log: a run's folder, or one file of MCAP or SQLite, compressed by rosbag2 or not.

    Raises
    ------
    NotALogError
        The path does not exist, or nothing of it can be read.

    """
    files, log_files = open_files(path)
    return Log(Path(path), files, log_files.missing + log_files.remarks)


def _merge_by_time(sources: Sequence[Source], topics: Topics) -> Iterator[Message]:
    """Merge sources by log time; only chunks that overlap are unpacked at the same time."""
    waiting = deque(sorted((source.start, number) for number, source in enumerate(sources)))
    started: list[tuple[int, int, Message, Iterator[Message]]] = []
    while waiting or started:
        if waiting and (not started or waiting[0] <= started[0][:2]):
            _, number = waiting.popleft()
            messages = sources[number].read(topics)
        else:
            _, number, message, messages = heapq.heappop(started)
            yield message
        next_message = next(messages, None)
        if next_message is not None:
            heapq.heappush(started, (next_message.log_time, number, next_message, messages))


def _last_by_time(messages: list[Message], count: int) -> list[Message]:
    first = max(0, len(messages) - count)
    return sorted(messages, key=attrgetter('log_time'))[first:]
