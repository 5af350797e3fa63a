"""Write a run: a folder with an MCAP file and its metadata, which every tool opens."""

from __future__ import annotations

from pathlib import Path
import shutil
from typing import TYPE_CHECKING

from klann_ros import __version__

from .bag_metadata import bag_metadata, FILE_NAME, metadata_record, metadata_yaml, RECORD_NAME
from .durable_file import replace_file, sync_folder
from .errors import AnyPath, RunClosedError, RunExistsError, UnwritableError
from .mcap_file import COMPRESSIONS, McapFile
from .records import Attachment, Message

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType

    from typing_extensions import Self

LIBRARY = f'klann_ros {__version__}'


class RunWriter:
    """
    Writes a run so that it survives a crash up to the last flush; a context manager.

    The folder, ``<run>/<run>_0.mcap`` with its header and ``<run>/metadata.yaml`` are on the disk
    as soon as the writer is created. To be used from one thread only: the MCAP library is not
    thread safe.

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

    Raises
    ------
    RunExistsError
        There is something at the path already.
    UnwritableError
        The compression is none of the three.
    OSError
        The disk said no.

    """

    def __init__(
        self,
        folder: AnyPath,
        *,
        compression: str = 'zstd',
        chunk_size: int = 1024 * 1024,
        profile: str = 'ros2',
        ros_distro: str = 'jazzy',
    ) -> None:
        if compression not in COMPRESSIONS:
            raise UnwritableError(f'compression is {compression!r}, not one of {[*COMPRESSIONS]}')
        self._folder = Path(folder).absolute()
        self._ros_distro = ros_distro
        self._closed = False
        self._make_folder()
        try:
            self._file = McapFile(
                self._folder / f'{self._folder.name}_0.mcap',
                compression=compression,
                chunk_size=chunk_size,
                profile=profile,
                library=LIBRARY,
            )
            self._write_metadata_yaml()
            sync_folder(self._folder.parent)
        except BaseException:
            # Nothing is in it yet, and what is left would stand in the way of a second try.
            shutil.rmtree(self._folder, ignore_errors=True)
            raise

    @property
    def path(self) -> Path:
        """Return the run's folder."""
        return self._folder

    @property
    def file_path(self) -> Path:
        """Return the path of the MCAP file in it."""
        return self._file.path

    @property
    def counts(self) -> dict[str, int]:
        """Return how many messages were written so far, by the topic's name."""
        counts: dict[str, int] = {}
        for topic, count in self._file.summary().counts.items():
            counts[topic.name] = counts.get(topic.name, 0) + count
        return counts

    @property
    def closed(self) -> bool:
        """Return whether the run is closed."""
        return self._closed

    def write(self, message: Message) -> None:
        """
        Add a message; the first of its topic registers the topic. Equal topics share a channel.

        Raises
        ------
        UnwritableError
            A time is negative or beyond 64 bits; the message is left out, nothing else is.
        MalformedQosError
            The topic's quality of service is malformed, so that rosbag2 could not open the run.
        RunClosedError
            The run is closed.
        OSError
            The disk said no; nothing more can be written, the same error is raised again.

        """
        self._check()
        self._file.write(message)

    def attach(
        self, name: str, media_type: str, data: bytes, log_time: int, create_time: int = 0
    ) -> None:
        """
        Add a file to the run; times in [ns since the epoch].

        Raises
        ------
        UnwritableError, RunClosedError, OSError
            As :meth:`write`.

        """
        self._check()
        self._file.attach(Attachment(name, media_type, data, log_time, create_time))

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """
        Add a metadata record of names and texts.

        Raises
        ------
        RunClosedError, OSError
            As :meth:`write`.

        """
        self._check()
        self._file.add_metadata(name, mapping)

    def flush(self) -> None:
        """
        Bring all that was written to the disk: neither kill -9 nor a power cut takes it back.

        Raises
        ------
        RunClosedError, OSError
            As :meth:`write`.

        """
        self._check()
        self._file.flush()

    def close(self) -> None:
        """
        Finish the run; calling it again does nothing.

        Raises
        ------
        OSError
            The disk said no, now or in an earlier call. The run is then not closed properly, but
            holds all whole records that were written.

        """
        if self._closed:
            return
        self._closed = True
        try:
            if self._file.failure is not None:
                raise self._file.failure
            self._file.add_metadata(RECORD_NAME, metadata_record(self._metadata()))
            self._file.finish()
        finally:
            self._file.abandon()
        self._write_metadata_yaml()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except OSError as failure:
            # The body is on its way out with this very error already.
            if failure is not error:
                raise failure from error

    def _make_folder(self) -> None:
        self._folder.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._folder.mkdir()
        except FileExistsError:
            raise RunExistsError(self._folder) from None

    def _check(self) -> None:
        if self._closed:
            raise RunClosedError(self._folder)

    def _metadata(self) -> dict[str, object]:
        return bag_metadata([self._file.summary()], self._ros_distro)

    def _write_metadata_yaml(self) -> None:
        replace_file(self._folder / FILE_NAME, metadata_yaml(self._metadata()))
