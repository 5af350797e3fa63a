"""The folder of a run that is being written: its files' names, metadata.yaml, and its space."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from klann_ros.log.bag_metadata import bag_metadata, FILE_NAME, metadata_yaml
from klann_ros.log.errors import DiskFullError, LowSpaceError, RunExistsError

from .disk_reserve import DiskReserve, SIZE
from .durable_file import replace_file, sync_folder
from .free_space import check_free_space

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from klann_ros.log.bag_metadata import FileSummary
    from klann_ros.log.errors import LogError


class RunFolder:
    """
    A new folder.

    Parameters
    ----------
    path
        It, which must not exist; its parents are created.
    ros_distro
        The ROS distribution that metadata.yaml names.
    reserve
        Whether to keep a little space free on the disk.

    Attributes
    ----------
    path : pathlib.Path
        It, absolute.
    reserve : DiskReserve or None
        The space that is kept free.

    Raises
    ------
    RunExistsError
        There is something at the path already.
    OSError
        The disk said no.

    """

    def __init__(self, path: Path, ros_distro: str, *, reserve: bool) -> None:
        self.path = path.absolute()
        self.reserve: DiskReserve | None = None
        self._ros_distro = ros_distro
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self.path.mkdir()
        except FileExistsError:
            raise RunExistsError(self.path) from None
        if reserve:
            try:
                self.reserve = DiskReserve(self.path)
            except OSError:
                self.remove()
                raise

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written any more."""
        return self.reserve is not None and self.reserve.spent is not None

    def name(self, number: int) -> str:
        """Return the name of a file of the run, the first of which is number 0."""
        return f'{self.path.name}_{number}.mcap'

    def sync(self) -> None:
        """Make its own name survive a power failure."""
        sync_folder(self.path.parent)

    def remove(self) -> None:
        """Remove it with all that is in it."""
        self.release()
        shutil.rmtree(self.path, ignore_errors=True)

    def release(self) -> None:
        """Let the end of the run have the space that was kept for it."""
        if self.reserve is not None:
            self.reserve.release()

    def metadata(self, files: Sequence[FileSummary]) -> dict[str, object]:
        """Return the metadata of a run of these files."""
        return bag_metadata(files, self._ros_distro)

    def write_metadata_yaml(self, files: Sequence[FileSummary]) -> None:
        """Write metadata.yaml for a run of these files."""
        replace_file(self.path / FILE_NAME, metadata_yaml(self.metadata(files)))

    def space_problem(self, least: int, ending: int) -> LogError | None:
        """
        Return what is wrong with the space on the disk.

        Parameters
        ----------
        least
            How much has to be free; 0 is no limit [bytes].
        ending
            How much the summary of the run takes beside what every end does [bytes].

        Raises
        ------
        OSError
            The disk does not tell.

        """
        if self.reserve is not None:
            self.reserve.hold(SIZE + ending)
            if self.reserve.spent is not None:
                return DiskFullError(self.path, str(self.reserve.spent))
        try:
            check_free_space(self.path, least)
        except LowSpaceError as problem:
            return problem
        return None
