"""Write a run: a folder with an MCAP file and its metadata, which every tool opens."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

from klann_ros import __version__
from klann_ros.log.errors import AnyPath, LogError, RunClosedError, RunHarmedError, UnwritableError
from klann_ros.log.records import Attachment, Message

from .file_series import FileSeries
from .file_watch import Faults
from .ledger import Fate
from .mcap_file import COMPRESSIONS, McapFile
from .run_folder import RunFolder

LIBRARY = f'klann_ros {__version__}'
# What the summary of a file says of each chunk [bytes], and how small a chunk may become [bytes].
INDEX_SIZE, SMALL_CHUNK = 200, 16 * 1024


class RunWriter(AbstractContextManager['RunWriter']):
    """
    Writes a run so that it survives a crash up to the last flush; a context manager.

    The folder, ``<run>/<run>_0.mcap`` with its header and ``<run>/metadata.yaml`` are on the disk
    as soon as the writer is created. To be used from one thread only: the MCAP library is not
    thread safe. What properties tell may be asked for from others.

    Each flush looks whether they are still there. A file that somebody has removed, moved or cut
    off is no part of the run any more, what was in it is counted as gone, and the run goes on in a
    new one; a folder that was removed is made anew; one that was renamed is followed.

    Parameters
    ----------
    folder
        The run's folder, which must not exist; its parents are created.
    compression
        ``zstd``, ``lz4`` or ``none``.
    chunk_size
        A chunk is finished when its messages are larger [bytes], or by a flush.
    profile
        The MCAP profile of the header.
    ros_distro
        The ROS distribution that metadata.yaml names.
    reserve
        Whether to keep a little space free on the disk, so that the run can be finished when the
        disk is full.
    faults
        Is told what others do to the run.

    Attributes
    ----------
    faults : Faults
        What is wrong with it.

    Raises
    ------
    RunExistsError
        There is something at the path already.
    UnwritableError
        The compression is none of the three.
    RunClosedError
        By every method that writes: the run is closed.
    RunLostError
        By :meth:`flush`, :meth:`look` and :meth:`split`: the file that is written was taken away,
        and no other can be made. The run is closed.
    OSError
        By every method: the disk said no; nothing more can be written, the same error is raised
        again.

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
        faults: Faults | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise UnwritableError(f'compression is {compression!r}, not one of {[*COMPRESSIONS]}')
        self.faults = faults or Faults()
        open_file = partial(
            McapFile,
            compression=compression,
            chunk_size=chunk_size,
            profile=profile,
            library=LIBRARY,
        )
        self._closed = False
        self._repeated: list[Callable[[McapFile], None]] = []
        self._flushes = 0
        self._folder = RunFolder(Path(folder), ros_distro, self.faults, reserve=reserve)
        try:
            self._series = FileSeries(self._folder, open_file, self._begin, self.faults)
        except BaseException:
            # Nothing is in it yet, and what is left would stand in the way of a second try.
            self._folder.remove()
            raise

    @property
    def path(self) -> Path:
        """Return the run's folder."""
        return self._folder.path

    @property
    def file(self) -> McapFile:
        """Return the MCAP file in it that is being written."""
        return self._series.current

    @property
    def file_path(self) -> Path:
        """Return the path of that file."""
        return self._folder.path / self.file.name

    @property
    def file_is_empty(self) -> bool:
        """Return whether there is no message in that file yet."""
        return not self.file.summary().counts

    @property
    def next_name(self) -> str:
        """Return the name of the file that follows after a split."""
        return self._series.next_name

    @property
    def counts(self) -> dict[str, int]:
        """Return how many messages are in the run, by the topic's name."""
        return dict(self.fate().written)

    def fate(self) -> Fate:
        """Return what became of the messages that it was given so far."""
        return self._series.files.fate()

    @property
    def closed(self) -> bool:
        """Return whether the run is closed, or has lost its last file."""
        return self._closed or not self._series.is_open

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written any more."""
        return self._folder.is_full

    @property
    def failure(self) -> OSError | None:
        """Return the disk's error after which nothing can be written, not even the end."""
        return self.file.failure

    @property
    def is_unfinished(self) -> bool:
        """Return whether it has a file that the disk did not let end."""
        return self.failure is not None and self._series.is_open

    @property
    def free_space(self) -> int:
        """Return how much this user may still write on its disk [bytes]; OSError if unknown."""
        return self._folder.folder.free_space()

    def write(self, message: Message) -> None:
        """
        Add a message; the first of its topic registers the topic. Equal topics share a channel.

        Raises
        ------
        UnwritableError
            A time is negative or beyond 64 bits; the message is left out, nothing else is.
        MalformedQosError
            The topic's quality of service is malformed, so that rosbag2 could not open the run.

        """
        self._check()
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
        """Add a file to the run; times in [ns since the epoch], as in :meth:`write`."""
        attachment = Attachment(name, media_type, data, log_time, create_time)
        self._add(lambda file: file.attach(attachment), in_every_file=in_every_file)

    def add_metadata(
        self, name: str, mapping: Mapping[str, str], *, in_every_file: bool = False
    ) -> None:
        """Add a metadata record of names and texts."""
        content = dict(mapping)
        self._add(lambda file: file.add_metadata(name, content), in_every_file=in_every_file)

    def flush(self) -> None:
        """Bring all to the disk that was written: no kill -9 and no power cut takes it back."""
        self._check()
        self.file.flush()
        self._flushes += 1
        self.look()

    def look(self) -> None:
        """Look what others have done to the run, and go on in a new file where one is gone."""
        self._check()
        self._series.look()

    def split(self) -> None:
        """
        Finish the file and go on in a new one; without a message in the file there is no need.

        What was added with `in_every_file` is repeated, so that every file explains itself.
        """
        self.look()
        if not self.file_is_empty:
            self._series.split()

    def space_problem(self, min_free_space: int) -> LogError | None:
        """
        Return what is wrong with the space on the disk, when less is free than this [bytes].

        The run can be closed then, and should be.

        Raises
        ------
        OSError
            The disk does not tell.

        """
        chunks = self._flushes + self.file.size // SMALL_CHUNK
        return self._folder.space_problem(min_free_space, chunks * INDEX_SIZE)

    def close(self) -> None:
        """
        Finish the run; calling it again does nothing.

        Raises
        ------
        OSError
            The disk said no, now or in an earlier call. The run is then not closed properly, but
            holds all whole records that were written.
        RunHarmedError
            Somebody else has taken away a part of it; the rest is finished.

        """
        if self._closed:
            return
        self._closed = True
        self._folder.release()
        self._series.close()
        if self.faults.lasting:
            raise RunHarmedError(self.path, self.faults.lasting)

    def discard(self) -> None:
        """Remove what was written, wherever it is now; what others have put there stays."""
        self._closed = True
        self.file.close()
        self._folder.remove()

    def __exit__(self, _: object, error: BaseException | None, *__: object) -> None:
        try:
            self.close()
        except (OSError, RunHarmedError) as failure:
            # The body is on its way out with this very error already.
            if failure is not error:
                raise failure from error

    def _check(self) -> None:
        if self.closed:
            raise RunClosedError(self._folder.path)

    def _add(self, add: Callable[[McapFile], None], *, in_every_file: bool) -> None:
        self._check()
        add(self.file)
        if in_every_file:
            self._repeated.append(add)

    def _begin(self, file: McapFile) -> None:
        for add in self._repeated:
            add(file)
