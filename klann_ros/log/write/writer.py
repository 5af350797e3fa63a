"""Write a run: a folder of MCAP files and metadata.yaml, which every rosbag2 tool opens."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from klann_ros import __version__
from klann_ros.log import errors
from klann_ros.log.bag_metadata import (
    FILE_NAME,
    FileSummary,
    metadata_record,
    metadata_yaml,
    RECORD_NAME,
)
from klann_ros.log.loss import StoredCounts
from klann_ros.log.records import Attachment, Message
from klann_ros.sanitize.text import counted, printable, verb

from .durable_file import FileFault, RESERVE_SIZE, RunFaults
from .mcap_file import COMPRESSIONS, McapFile
from .run_folder import RunContent, RunFolder

_LIBRARY = f'klann_ros {__version__}'
# A chunk's entry in the summary, and the size of a small chunk [bytes].
_INDEX_SIZE, _SMALL_CHUNK_SIZE = 200, 16 * 1024
# Subjects of faults, beside metadata.yaml.
_CURRENT, _FINISHED = 'current file', 'finished files'


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
    reserve
        Whether to keep a little disk space, so that the run can be finished on a full disk.
    faults
        Collects outside changes of the run.

    Attributes
    ----------
    path : pathlib.Path
        The run's folder, absolute.
    file : McapFile
        The MCAP file in progress, or the last one.
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
        folder: errors.AnyPath,
        *,
        compression: str = 'zstd',
        chunk_size: int = 1024 * 1024,
        reserve: bool = False,
        faults: RunFaults | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise errors.UnwritableError(
                f'compression is {compression!r}, not one of {[*COMPRESSIONS]}'
            )
        self.path = Path(folder).absolute()
        self.faults = faults or RunFaults()
        self._open_file = partial(
            McapFile, compression=compression, chunk_size=chunk_size, library=_LIBRARY
        )
        self._repeated: list[Callable[[McapFile], None]] = []
        self._number = self._checks = self._flushes = 0
        self._closed = False
        self._folder = RunFolder(self.path, has_reserve=reserve)
        try:
            self.file = self._open(0)
            # Some network disks report no sizes or names of files before they are closed.
            self._can_check = self.file.find_fault() is None
            self._content = RunContent(self.file)
            self._replace_metadata_yaml()
        except BaseException:
            # Nothing is in it yet, and it would block a second attempt.
            self._folder.remove()
            raise

    @property
    def file_is_empty(self) -> bool:
        """Return whether the file in progress has no message."""
        return not self.file.summary().counts

    @property
    def next_name(self) -> str:
        """Return the name of the file after the next split."""
        number = self._number + 1
        with suppress(OSError):
            number = self._folder.next_number(self._number)
        return self._folder.name_of(number)

    @property
    def counts(self) -> dict[str, int]:
        """Return the messages in the run, by topic name."""
        return dict(self.stored_counts().written)

    def stored_counts(self) -> StoredCounts:
        """Return the messages that are in the run, and those dropped after writing."""
        return self._content.stored_counts()

    @property
    def closed(self) -> bool:
        """Return whether the run is closed, or has lost its last file."""
        return self._closed or not self._is_open

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written."""
        return self._folder.reserve is not None and self._folder.reserve.spent is not None

    @property
    def is_unfinished(self) -> bool:
        """Return whether the disk prevented the end of a file."""
        return self.file.failure is not None and self._is_open

    @property
    def free_space(self) -> int:
        """Return the space free for this user on the disk [bytes]; OSError if unknown."""
        return self._folder.free_space

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
        if self._closed or self._content.current is None:
            raise errors.RunClosedError(self.path)
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
        """Flush and fsync: neither kill -9 nor a power cut loses earlier writes."""
        self._require_open()
        self.file.flush()
        self._flushes += 1
        self.check_files()

    def check_files(self) -> None:
        """Check that the files are intact, and begin a new one if the present one is not."""
        self._require_open()
        self._check()

    def split(self) -> None:
        """
        Finish the file and begin a new one, unless it has no message.

        Entries added with `in_every_file` are repeated, so that every file explains itself.
        """
        self.check_files()
        if not self.file_is_empty:
            self._finish_current()
            self._open_next()
            self._write_metadata_yaml()

    def check_space(self, min_free_space: int) -> None:
        """
        Raise a LogError if the disk is full, or less than this is free on it [bytes].

        The run can and should be closed then. An OSError means that the free space is unknown.
        """
        reserve = self._folder.reserve
        if reserve is not None:
            chunks = self._flushes + self.file.size // _SMALL_CHUNK_SIZE
            reserve.grow(RESERVE_SIZE + chunks * _INDEX_SIZE)
            if reserve.spent is not None:
                text = f'the disk of {printable(self.path)} is full: {reserve.spent}'
                raise errors.LogError(text)
        if min_free_space > 0 and (free := self.free_space) < min_free_space:
            raise errors.LowSpaceError(self.path, free, min_free_space)

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
        self._folder.release_reserve()
        try:
            if self._is_open and self.file.failure is None:
                self._check()
            if self._is_open:
                self._finish_current()
        finally:
            with suppress(OSError):
                if self._is_open and (fault := self._find_fault()) is not None:
                    self.faults.add(_CURRENT, self._drop_current(fault))
            self.file.close()
            self._check_finished(self._content.finished)
            self._write_metadata_yaml()
        if self.faults.active:
            raise errors.RunIncompleteError(self.path, self.faults.active)

    def discard(self) -> None:
        """Remove the run, unless its path is another folder's now."""
        self._closed = True
        self.file.close()
        self._folder.remove()

    def __exit__(self, _: object, error: BaseException | None, *__: object) -> None:
        try:
            self.close()
        except (OSError, errors.RunIncompleteError) as failure:
            # The body may raise this very error already.
            if failure is not error:
                raise failure from error

    @property
    def _is_open(self) -> bool:
        return self._content.current is not None

    def _require_open(self) -> None:
        if self.closed:
            raise errors.RunClosedError(self.path)

    def _add(self, add: Callable[[McapFile], None], *, in_every_file: bool) -> None:
        self._require_open()
        add(self.file)
        if in_every_file:
            self._repeated.append(add)

    def _open(self, number: int) -> McapFile:
        path = self.path / self._folder.name_of(number)
        file = self._open_file(path, reserve=self._folder.reserve)
        self._number = number
        return file

    def _open_next(self) -> None:
        """Begin the next file, in a new folder if there is none any more."""
        if not self._folder.is_in_place():
            self._folder.create()
        self.file = self._open(self._folder.next_number(self._number))
        self._content = replace(self._content, current=self.file)
        for add_to_file in self._repeated:
            add_to_file(self.file)

    def _find_fault(self) -> FileFault | None:
        return self.file.find_fault() if self._can_check else None

    def _check(self) -> None:
        """Check the file in progress, and at each call one of the finished files in turn."""
        fault = self._find_fault()
        if fault is not None:
            self._replace_current(fault)
        finished = self._content.finished
        if finished:
            self._checks += 1
            self._check_finished([finished[self._checks % len(finished)]])
        if FILE_NAME in self.faults:
            self._write_metadata_yaml()

    def _check_finished(self, files: Sequence[tuple[FileSummary, int]]) -> None:
        """Take finished files out of the run that are gone or changed."""
        if not self._can_check:
            return
        lost = [file for file in files if not self._folder.has_file(file[0].name, file[1])]
        if not lost:
            return
        self._content = self._content.drop_finished(lost)
        names = ', '.join(summary.name for summary, _ in lost[:3])
        further = f' and {len(lost) - 3} more' if len(lost) > 3 else ''
        count = counted(sum(summary.message_count for summary, _ in lost), 'message')
        text = f'finished files are gone or changed: {names}{further}, with {count}'
        self.faults.add(_FINISHED, text)
        self._write_metadata_yaml()

    def _write_end(self) -> None:
        self.file.add_metadata(RECORD_NAME, metadata_record(self._content.summaries()))
        self.file.finish()

    def _finish_current(self) -> None:
        self._write_end()
        fault = self._find_fault()
        if fault is None:
            self._content = self._content.finish_current(self.file)
        else:
            self.faults.add(_CURRENT, self._drop_current(fault))
        self.file.close()

    def _replace_current(self, fault: FileFault) -> None:
        """Continue in a new file."""
        if fault is FileFault.GONE:
            with suppress(OSError):
                self._write_end()  # a moved file becomes complete
        text = self._drop_current(fault)
        self.file.close()
        try:
            self._open_next()
        except errors.RunExistsError as error:
            raise errors.RunLostError(f'{text}; {error}') from None
        except OSError as error:
            raise errors.RunLostError(f'{text}; no new file: {error.strerror}') from error
        self.faults.add(_CURRENT, text, f'the recording continues in {self.file.path.name}')
        self._check_finished(self._content.finished)
        self._write_metadata_yaml()

    def _drop_current(self, fault: FileFault) -> str:
        """Take the file in progress out of the run; return the text of the fault."""
        path = self.file.path
        count = self.file.received().message_count
        self._content = self._content.drop_current(self.file)
        loss = f'{counted(count, "message")} {verb(count, "counts", "count")} as lost'
        text = f'{path.name} {fault.value} while it was recorded: its {loss}'
        return f'{text}; `recover {path}` saves the rest' if fault is FileFault.CHANGED else text

    def _write_metadata_yaml(self) -> None:
        """Replace metadata.yaml; an error is a fault until it can be written."""
        try:
            self._replace_metadata_yaml()
        except OSError as error:
            text = f'{self.path / FILE_NAME} cannot be written: {error.strerror}'
            self.faults.add(FILE_NAME, text)
        else:
            self.faults.clear(FILE_NAME)

    def _replace_metadata_yaml(self) -> None:
        text = metadata_yaml(self._content.summaries())
        self._folder.replace_file(FILE_NAME, text.encode())
