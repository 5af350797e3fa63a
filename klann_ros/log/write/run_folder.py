"""The folder of a run that is being written, its files, and runs that a crash left unfinished."""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
import errno
import os
from pathlib import Path
import re
import shutil
import stat
import sys

from klann_ros.log.bag_metadata import FileSummary
from klann_ros.log.errors import RunExistsError
from klann_ros.log.loss import StoredCounts
from klann_ros.log.mcap.records import find_footer, MAGIC
from klann_ros.log.records import Topic
from klann_ros.sanitize.files import open_regular

from .durable_file import DiskReserve, is_being_written, NOT_FOUND
from .mcap_file import McapFile


@dataclass(frozen=True)
class RunContent:
    """The files of a run at a moment; immutable, as other threads read the counts."""

    # The file in progress; None after the last.
    current: McapFile | None
    # Content and size [bytes] of each finished file.
    finished: tuple[tuple[FileSummary, int], ...] = ()
    # Messages of the finished files, and of files that are gone or changed, by topic name.
    written: Counter[str] = field(default_factory=Counter)
    dropped: Counter[str] = field(default_factory=Counter)

    def stored_counts(self) -> StoredCounts:
        """Return what became of all messages so far."""
        if self.current is None:
            return StoredCounts(self.written, self.dropped)
        summary, dropped = self.current.durable_summary()
        written = self.written + _by_name(summary.counts)
        return StoredCounts(written, self.dropped + _by_name(dropped))

    def summaries(self) -> list[FileSummary]:
        """Return the content of each file."""
        finished = [summary for summary, _ in self.finished]
        return finished if self.current is None else [*finished, self.current.summary()]

    def finish_current(self, file: McapFile) -> 'RunContent':
        """Return the content after the file in progress was finished."""
        summary = file.summary()
        written = self.written + _by_name(summary.counts)
        finished = (*self.finished, (summary, file.size))
        return replace(self, current=None, finished=finished, written=written)

    def drop_current(self, file: McapFile) -> 'RunContent':
        """Return the content without the file in progress."""
        summary, unwritten = file.durable_summary()
        dropped = self.dropped + _by_name(summary.counts) + _by_name(unwritten)
        return replace(self, current=None, dropped=dropped)

    def drop_finished(self, files: Sequence[tuple[FileSummary, int]]) -> 'RunContent':
        """Return the content without some of the finished files."""
        lost = sum((_by_name(summary.counts) for summary, _ in files), Counter[str]())
        return replace(
            self,
            finished=tuple(file for file in self.finished if file not in files),
            written=self.written - lost,
            dropped=self.dropped + lost,
        )


def _by_name(counts: Mapping[Topic, int]) -> Counter[str]:
    named = Counter[str]()
    for topic, count in counts.items():
        named[topic.name] += count
    return named


class RunFolder:
    """
    A new folder with a space reserve; open, so that another one with its path is detected.

    Raises a RunExistsError if the path exists, and an OSError if the disk refuses.
    """

    def __init__(self, path: Path, *, has_reserve: bool) -> None:
        self.path = path
        self.reserve: DiskReserve | None = None
        self._has_reserve = has_reserve
        self._descriptor = -1
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            reason = 'it is no folder, so no run can be made in it'
            raise NotADirectoryError(errno.ENOTDIR, reason, error.filename) from None
        self.create()

    def create(self) -> None:
        """Create the folder, again if it was removed."""
        try:
            self.path.mkdir()
        except FileExistsError:
            raise RunExistsError(self.path) from None
        self._close()
        try:
            # An open folder keeps its inode number; Windows opens none.
            if sys.platform != 'win32':
                self._descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
            self.reserve = DiskReserve(self.path) if self._has_reserve else None
            _sync_folder(self.path.parent)
        except OSError:
            self.remove()
            raise

    def _close(self) -> None:
        self.release_reserve()
        descriptor = self._descriptor
        self._descriptor = -1
        if descriptor >= 0:
            os.close(descriptor)

    def __del__(self) -> None:
        self._close()

    def release_reserve(self) -> None:
        """Release the reserved space for the end of the run."""
        if self.reserve is not None:
            self.reserve.release()

    def remove(self) -> None:
        """Remove the folder with its content, unless its path leads to another folder now."""
        self.release_reserve()
        if self.is_in_place():
            shutil.rmtree(self.path, ignore_errors=True)

    def is_in_place(self) -> bool:
        """Return whether the path leads to the created folder, as far as that is visible."""
        if sys.platform == 'win32':
            return self.path.is_dir()
        try:
            return os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
        except OSError as error:
            return error.errno not in (*NOT_FOUND, errno.EBADF)

    @property
    def free_space(self) -> int:
        """Return the space free for this user on the disk [bytes]."""
        return shutil.disk_usage(self.path if self._descriptor < 0 else self._descriptor).free

    def name_of(self, number: int) -> str:
        """Return the name of a numbered file."""
        return f'{self.path.name}_{number}.mcap'

    def next_number(self, last: int) -> int:
        """Return a number above the last one and those of all existing files."""
        pattern = re.compile(re.escape(self.path.name) + r'_([0-9]+)\.mcap')
        matches = (pattern.fullmatch(path.name) for path in self.path.iterdir())
        return max(last, *(int(match[1]) for match in matches if match), -1) + 1

    def has_file(self, name: str, size: int) -> bool:
        """Return whether a file has its size [bytes], as far as that is visible."""
        try:
            status = (self.path / name).stat()
        except OSError as error:
            return error.errno not in NOT_FOUND
        return stat.S_ISREG(status.st_mode) and status.st_size == size

    def replace_file(self, name: str, data: bytes) -> None:
        """Replace a file of the folder atomically; a FileNotFoundError if the folder is gone."""
        if not self.is_in_place():
            raise FileNotFoundError(errno.ENOENT, 'the folder was removed or replaced')
        temporary = self.path / f'.{name}.new'
        # A crash or a user may have left something of this name, even a pipe, which would block.
        temporary.unlink(missing_ok=True)
        try:
            with temporary.open('xb') as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(self.path / name)
        except OSError:
            with suppress(OSError):
                temporary.unlink()
            raise
        if self._descriptor >= 0:
            os.fsync(self._descriptor)


def _sync_folder(path: Path) -> None:
    """Make the names in a folder survive a power failure; Windows does so itself."""
    if sys.platform == 'win32':
        return
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def unfinished_runs(folder: Path) -> list[Path]:
    """
    Return the runs in a folder that a crash left unfinished.

    Runs that a process is writing, and recovered ones (with ``<run>_recovered`` beside them), are
    not among them.
    """
    try:
        runs = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []
    return [
        run
        for run in runs
        if _is_unfinished(run) and not run.with_name(f'{run.name}_recovered').exists()
    ]


def _is_unfinished(run: Path) -> bool:
    try:
        files = [path for path in run.glob('*.mcap') if not path.name.startswith('.')]
    except OSError:
        return False
    in_progress = [_is_in_progress(path) for path in files]
    # A run in progress may have a file that was cut off.
    return False in in_progress and True not in in_progress


def _is_in_progress(path: Path) -> bool | None:
    """Return whether an MCAP file without an end is being written; None of any other file."""
    with suppress(OSError), open_regular(path) as file:
        size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(MAGIC)) in (MAGIC, b'') and find_footer(file, size) is None:
            return is_being_written(file)
    return None
