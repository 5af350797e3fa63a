"""Write a run: a folder of MCAP files and metadata.yaml, which every rosbag2 tool opens."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

from klann_ros import __version__
from klann_ros.log.errors import (
    AnyPath,
    LogError,
    RunClosedError,
    RunIncompleteError,
    UnwritableError,
)
from klann_ros.log.records import Attachment, Message

from .drop_counters import StoredCounts
from .durable_file import RunFaults
from .mcap_file import COMPRESSIONS, McapFile
from .run_files import RunFiles

_LIBRARY = f'klann_ros {__version__}'
# A chunk's entry in the summary, and the size of a small chunk [bytes].
_INDEX_SIZE, _SMALL_CHUNK_SIZE = 200, 16 * 1024


class RunWriter(AbstractContextManager['RunWriter']):
    """
    Write a run that survives a crash up to the last flush; a context manager.

    The folder, ``<run>/<run>_0.mcap`` with its header and ``<run>/metadata.yaml`` are on the disk
    as soon as the writer is created. Its methods must be called from one thread, as the MCAP
    library is not thread-safe; its properties may be read from any.

    Each flush checks that the files are still there with their sizes. The messages of a file that
    is gone or changed count as dropped, and the run continues in a new file, in a new folder if
    that is gone too.

    Parameters
    ----------
    folder
        The run's folder, which must not exist; its parents are created.
    compression
        ``zstd``, ``lz4`` or ``none``.
    chunk_size
        Size of messages that finishes a chunk [bytes]; a flush finishes it too.
    profile
        The MCAP profile of the header.
    ros_distro
        The ROS distribution in metadata.yaml.
    reserve
        Whether to keep a little disk space, so that the run can be finished on a full disk.
    faults
        Collects outside changes of the run.

    Attributes
    ----------
    faults : RunFaults
        Outside changes of the run.

    Raises
    ------
    RunExistsError
        The path exists.
    UnwritableError
        The compression is none of the three.
    RunClosedError
        By every method that writes: the run is closed.
    RunLostError
        By :meth:`flush`, :meth:`check_files` and :meth:`split`: the file in progress is gone or
        changed, and no other can be created. The run is closed.
    OSError
        By every method: the disk refused; every later call raises the same error.

    """

    def __init__(
        self,
        folder: AnyPath,
        *,
        compression: str = 'zstd',
        chunk_size: int = 1024 * 1024,
        profile: str = 'ros2',
        ros_distro: str = 'jazzy',
        reserve: bool = False,
        faults: RunFaults | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise UnwritableError(f'compression is {compression!r}, not one of {[*COMPRESSIONS]}')
        self.faults = faults or RunFaults()
        self._closed = False
        self._repeated: list[Callable[[McapFile], None]] = []
        self._flushes = 0
        self._files = RunFiles(
            Path(folder),
            ros_distro,
            open_file=partial(
                McapFile,
                compression=compression,
                chunk_size=chunk_size,
                profile=profile,
                library=_LIBRARY,
            ),
            begin_file=self._repeat_entries,
            faults=self.faults,
            reserve=reserve,
        )

    @property
    def path(self) -> Path:
        """Return the run's folder."""
        return self._files.path

    @property
    def file(self) -> McapFile:
        """Return the MCAP file in progress."""
        return self._files.current

    @property
    def file_is_empty(self) -> bool:
        """Return whether that file has no message."""
        return not self.file.summary().counts

    @property
    def next_name(self) -> str:
        """Return the name of the file after the next split."""
        return self._files.next_name

    @property
    def counts(self) -> dict[str, int]:
        """Return the messages in the run, by topic name."""
        return dict(self.stored_counts().written)

    def stored_counts(self) -> StoredCounts:
        """Return the messages that are in the run, and those dropped after writing."""
        return self._files.files.stored_counts()

    @property
    def closed(self) -> bool:
        """Return whether the run is closed, or has lost its last file."""
        return self._closed or not self._files.is_open

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written."""
        return self._files.is_full

    @property
    def failure(self) -> OSError | None:
        """Return the disk's first error; nothing can be written after it."""
        return self.file.failure

    @property
    def is_unfinished(self) -> bool:
        """Return whether the disk prevented the end of a file."""
        return self.failure is not None and self._files.is_open

    @property
    def free_space(self) -> int:
        """Return the space free for this user on the disk [bytes]; OSError if unknown."""
        return self._files.free_space

    def write(self, message: Message) -> None:
        """
        Add a message; the first of a topic registers it. Equal topics share a channel.

        Raises
        ------
        UnwritableError
            A time is negative or beyond 64 bits; only this message is skipped.
        MalformedQosError
            The topic's quality of service is malformed, so that rosbag2 could not open the run.

        """
        self._require_open()
        self.file.write(message)

    def attach(
        self,
        name: str,
        media_type: str,
        data: bytes,
        log_time: int,
        create_time: int = 0,
        *,
        in_every_file: bool = False,
    ) -> None:
        """Add an attachment; times in [ns since the epoch], as in :meth:`write`."""
        attachment = Attachment(name, media_type, data, log_time, create_time)
        self._add(lambda file: file.attach(attachment), in_every_file=in_every_file)

    def add_metadata(
        self, name: str, mapping: Mapping[str, str], *, in_every_file: bool = False
    ) -> None:
        """Add a metadata record of names and texts."""
        content = dict(mapping)
        self._add(lambda file: file.add_metadata(name, content), in_every_file=in_every_file)

    def flush(self) -> None:
        """Flush and fsync: neither kill -9 nor a power cut loses what was written before."""
        self._require_open()
        self.file.flush()
        self._flushes += 1
        self.check_files()

    def check_files(self) -> None:
        """Check that the files are intact, and begin a new one if the present one is not."""
        self._require_open()
        self._files.check()

    def split(self) -> None:
        """
        Finish the file and begin a new one, unless it has no message.

        Entries added with `in_every_file` are repeated, so that every file explains itself.
        """
        self.check_files()
        if not self.file_is_empty:
            self._files.split()

    def space_problem(self, min_free_space: int) -> LogError | None:
        """
        Return the problem with free space on the disk, if less than this is free [bytes].

        The run can and should be closed then. An OSError if the free space is unknown.
        """
        chunks = self._flushes + self.file.size // _SMALL_CHUNK_SIZE
        return self._files.space_problem(min_free_space, chunks * _INDEX_SIZE)

    def close(self) -> None:
        """
        Finish the run; further calls do nothing.

        Raises
        ------
        OSError
            The disk refused, now or earlier. The run is not closed properly then, but holds all
            whole records that were written.
        RunIncompleteError
            A part of the run is gone or changed; the rest is finished.

        """
        if self._closed:
            return
        self._closed = True
        self._files.release_reserve()
        self._files.close()
        if self.faults.active:
            raise RunIncompleteError(self.path, self.faults.active)

    def discard(self) -> None:
        """Remove the run, unless its path is another folder's now."""
        self._closed = True
        self.file.close()
        self._files.remove()

    def __exit__(self, _: object, error: BaseException | None, *__: object) -> None:
        try:
            self.close()
        except (OSError, RunIncompleteError) as failure:
            # The body may raise this very error already.
            if failure is not error:
                raise failure from error

    def _require_open(self) -> None:
        if self.closed:
            raise RunClosedError(self.path)

    def _add(self, add: Callable[[McapFile], None], *, in_every_file: bool) -> None:
        self._require_open()
        add(self.file)
        if in_every_file:
            self._repeated.append(add)

    def _repeat_entries(self, file: McapFile) -> None:
        for add in self._repeated:
            add(file)
