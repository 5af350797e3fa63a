"""The folder of a run that is being written, its numbered MCAP files and metadata.yaml."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
import errno
import os
from pathlib import Path
import re
import shutil

from klann_ros.log.bag_metadata import (
    bag_metadata,
    FILE_NAME,
    metadata_record,
    metadata_yaml,
    RECORD_NAME,
)
from klann_ros.log.errors import (
    DiskFullError,
    LogError,
    LowSpaceError,
    RunExistsError,
    RunLostError,
)
from klann_ros.sanitize.text import counted, verb

from .drop_counters import FinishedFile, WrittenFiles
from .durable_file import DiskReserve, FileFault, NOT_FOUND, RESERVE_SIZE, RunFaults
from .mcap_file import McapFile

# Subjects of faults, beside metadata.yaml.
_CURRENT, _FINISHED = 'current file', 'finished files'


class RunFiles:
    """
    The new folder of a run and the files in it, one of which is being written.

    Parameters
    ----------
    path
        Must not exist; its parents are created.
    ros_distro
        The ROS distribution that metadata.yaml names.
    open_file
        Creates a file, given its path and a reserve.
    begin_file
        Writes the records that each file begins with.
    faults
        Collects outside changes.
    reserve
        Whether to keep a little space free on the disk.

    Attributes
    ----------
    path : Path
        Absolute.
    current : McapFile
        The file in progress, or the last one.
    files : WrittenFiles
        All files; thread-safe.

    Raises
    ------
    RunExistsError
        The path exists.
    OSError
        The disk refused.

    """

    def __init__(
        self,
        path: Path,
        ros_distro: str,
        *,
        open_file: Callable[..., McapFile],
        begin_file: Callable[[McapFile], None],
        faults: RunFaults,
        reserve: bool,
    ) -> None:
        self.path = path.absolute()
        self._ros_distro, self._faults, self._has_reserve = ros_distro, faults, reserve
        self._open_file, self._begin_file = open_file, begin_file
        self._reserve: DiskReserve | None = None
        self._descriptor = -1
        self._number = self._checks = 0
        _make_parents(self.path.parent)
        self._create_folder()
        try:
            self.current = self._open(0)
            # Some network disks report no sizes or names of files before they are closed.
            self._can_check = self.current.find_fault() is None
            self.files = WrittenFiles(self.current)
            self._replace_metadata_yaml()
        except BaseException:
            # Nothing is in it yet, and it would block a second attempt.
            self.remove()
            raise

    @property
    def is_open(self) -> bool:
        """Return whether a file is in progress."""
        return self.files.current is not None

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written."""
        return self._reserve is not None and self._reserve.spent is not None

    @property
    def free_space(self) -> int:
        """Return the space free for this user on the disk [bytes]; OSError if unknown."""
        return shutil.disk_usage(self._descriptor).free

    @property
    def next_name(self) -> str:
        """Return the name of the next file."""
        number = self._number + 1
        with suppress(OSError):
            number = self._next_number()
        return self._name(number)

    def split(self) -> None:
        """Finish the file and begin the next one."""
        self._finish_current()
        self._open_next()
        self._write_metadata_yaml()

    def check(self) -> None:
        """
        Check that the file in progress is intact, and begin a new one if it is not.

        One of the finished files is checked at each call, in turn.

        Raises
        ------
        RunLostError
            The file in progress is gone or changed, and no other can be created.

        """
        fault = self._find_fault()
        if fault is not None:
            self._replace_current(fault)
        finished = self.files.finished
        if finished:
            self._checks += 1
            self._check_finished([finished[self._checks % len(finished)]])
        if FILE_NAME in self._faults:
            self._write_metadata_yaml()

    def close(self) -> None:
        """Finish the file in progress, and check all files for the last time."""
        try:
            if self.is_open and self.current.failure is None:
                self.check()
            if self.is_open:
                self._finish_current()
        finally:
            with suppress(OSError):
                if self.is_open and (fault := self._find_fault()) is not None:
                    self._faults.add(_CURRENT, self._drop_current(fault))
            self.current.close()
            self._check_finished(self.files.finished)
            self._write_metadata_yaml()

    def remove(self) -> None:
        """Remove the folder with its content, unless another one has its path now."""
        self.release_reserve()
        if self._owns_path():
            shutil.rmtree(self.path, ignore_errors=True)

    def release_reserve(self) -> None:
        """Release the reserved space for the end of the run."""
        if self._reserve is not None:
            self._reserve.release()

    def space_problem(self, min_free: int, summary_size: int) -> LogError | None:
        """
        Return the problem with the disk's free space, if any.

        Parameters
        ----------
        min_free
            Space that must remain free [bytes]; 0 is no limit.
        summary_size
            Size of the run's chunk indices [bytes], for which the reserve grows.

        """
        if self._reserve is not None:
            self._reserve.grow(RESERVE_SIZE + summary_size)
            if self._reserve.spent is not None:
                return DiskFullError(self.path, str(self._reserve.spent))
        if min_free > 0 and (free := self.free_space) < min_free:
            return LowSpaceError(self.path, free, min_free)
        return None

    def _create_folder(self) -> None:
        try:
            self.path.mkdir()
        except FileExistsError:
            raise RunExistsError(self.path) from None
        self._close_folder()
        try:
            # An open folder keeps its inode number.
            self._descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            self._reserve = DiskReserve(self.path) if self._has_reserve else None
            _sync_folder(self.path.parent)
        except OSError:
            self.remove()
            raise

    def _close_folder(self) -> None:
        self.release_reserve()
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def __del__(self) -> None:
        self._close_folder()

    def _owns_path(self) -> bool:
        """Return whether the path is that of the created folder, as far as that is visible."""
        try:
            return os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
        except OSError as error:
            return error.errno not in (*NOT_FOUND, errno.EBADF)

    def _name(self, number: int) -> str:
        return f'{self.path.name}_{number}.mcap'

    def _next_number(self) -> int:
        """Return a number above those of all existing files."""
        pattern = re.compile(re.escape(self.path.name) + r'_([0-9]+)\.mcap')
        found = (pattern.fullmatch(path.name) for path in self.path.iterdir())
        return max(self._number, *(int(match[1]) for match in found if match), -1) + 1

    def _open(self, number: int) -> McapFile:
        file = self._open_file(self.path / self._name(number), reserve=self._reserve)
        self._number = number
        return file

    def _open_next(self) -> None:
        """Begin the next file, in a new folder if there is none any more."""
        if not self._owns_path():
            self._create_folder()
        self.current = self._open(self._next_number())
        self.files = replace(self.files, current=self.current)
        self._begin_file(self.current)

    def _find_fault(self) -> FileFault | None:
        return self.current.find_fault() if self._can_check else None

    def _write_end(self) -> None:
        metadata = bag_metadata(self.files.summaries(), self._ros_distro)
        self.current.add_metadata(RECORD_NAME, metadata_record(metadata))
        self.current.finish()

    def _finish_current(self) -> None:
        self._write_end()
        fault = self._find_fault()
        if fault is None:
            self.files = self.files.finish_current(self.current)
        else:
            self._faults.add(_CURRENT, self._drop_current(fault))
        self.current.close()

    def _replace_current(self, fault: FileFault) -> None:
        """Continue in a new file."""
        if fault is FileFault.GONE:
            with suppress(OSError):
                self._write_end()  # a moved file becomes complete
        text = self._drop_current(fault)
        self.current.close()
        try:
            self._open_next()
        except RunExistsError as error:
            raise RunLostError(f'{text}; {error}') from None
        except OSError as error:
            raise RunLostError(f'{text}; no new file: {error.strerror}') from error
        self._faults.add(_CURRENT, text, f'the recording continues in {self.current.path.name}')
        self._check_finished(self.files.finished)
        self._write_metadata_yaml()

    def _drop_current(self, fault: FileFault) -> str:
        """Take the file in progress out of the run; return the text of the fault."""
        path, count = self.current.path, self.current.message_count
        self.files = self.files.drop_current(self.current)
        number = f'{counted(count, "message")} {verb(count, "counts", "count")} as lost'
        text = f'{path.name} {fault.value} while it was recorded: its {number}'
        return f'{text}; `recover {path}` saves the rest' if fault is FileFault.CHANGED else text

    def _check_finished(self, files: Sequence[FinishedFile]) -> None:
        """Take finished files out of the run that are gone or changed."""
        lost = [file for file in files if self._can_check and not file.is_intact(self.path)]
        if not lost:
            return
        self.files = self.files.drop_finished(lost)
        names = ', '.join(file.summary.name for file in lost[:3])
        others = f' and {len(lost) - 3} more' if len(lost) > 3 else ''
        count = counted(sum(file.summary.message_count for file in lost), 'message')
        text = f'finished files are gone or changed: {names}{others}, with {count}'
        self._faults.add(_FINISHED, text)
        self._write_metadata_yaml()

    def _write_metadata_yaml(self) -> None:
        """Write metadata.yaml; an error is a fault until it can be written."""
        try:
            self._replace_metadata_yaml()
        except OSError as error:
            text = f'{self.path / FILE_NAME} cannot be written: {error.strerror}'
            self._faults.add(FILE_NAME, text)
        else:
            self._faults.clear(FILE_NAME)

    def _replace_metadata_yaml(self) -> None:
        """Replace metadata.yaml atomically."""
        if not self._owns_path():
            raise FileNotFoundError(errno.ENOENT, 'the folder was removed or replaced')
        text = metadata_yaml(bag_metadata(self.files.summaries(), self._ros_distro))
        temporary = self.path / f'.{FILE_NAME}.new'
        # A leftover of a user or a crash, maybe a pipe that would block.
        temporary.unlink(missing_ok=True)
        try:
            with temporary.open('xb') as file:
                file.write(text.encode())
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(self.path / FILE_NAME)
        except OSError:
            with suppress(OSError):
                temporary.unlink()
            raise
        os.fsync(self._descriptor)


def _make_parents(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        reason = 'it is no folder, so no run can be made in it'
        raise NotADirectoryError(errno.ENOTDIR, reason, error.filename) from None


def _sync_folder(path: Path) -> None:
    """Make the names in a folder survive a power failure."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
