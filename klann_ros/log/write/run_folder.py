"""The folder of a run that is being written: its files' names, metadata.yaml, and its space."""

from collections.abc import Sequence
import errno
from pathlib import Path
import re
import shutil

from klann_ros.log.bag_metadata import bag_metadata, FILE_NAME, FileSummary, metadata_yaml
from klann_ros.log.errors import DiskFullError, LogError, LowSpaceError, RunExistsError

from .disk_space import DiskReserve, SIZE
from .file_watch import Faults
from .open_folder import OpenFolder

# What a fault is about, beside metadata.yaml.
_PLACE = 'place'


class RunFolder:
    """
    A new folder.

    Parameters
    ----------
    path
        It, which must not exist; its parents are created.
    ros_distro
        The ROS distribution that metadata.yaml names.
    faults
        Is told what others do to it.
    reserve
        Whether to keep a little space free on the disk.

    Attributes
    ----------
    folder : OpenFolder
        It, held open.
    reserve : DiskReserve or None
        The space that is kept free.

    Raises
    ------
    RunExistsError
        There is something at the path already.
    OSError
        The disk said no.

    """

    def __init__(self, path: Path, ros_distro: str, faults: Faults, *, reserve: bool) -> None:
        path = path.absolute()
        self.reserve: DiskReserve | None = None
        self._ros_distro, self._name, self._faults = ros_distro, path.name, faults
        _make_parents(path.parent)
        self.folder = _made(path)
        if reserve:
            try:
                self.reserve = DiskReserve(path)
            except OSError:
                self.remove()
                raise

    @property
    def path(self) -> Path:
        """Return what it was called when that was last looked at; absolute."""
        return self.folder.path

    def make_anew(self) -> None:
        """
        Make the folder again, where it was, after somebody has removed it.

        Raises
        ------
        RunExistsError
            There is something else now.
        OSError
            The disk said no.

        """
        tells = self.folder.tells
        self.folder = _made(self.path)
        self.folder.tells = tells
        self.sync()

    def look(self) -> None:
        """Look what it is called now."""
        before, place = self.path, self.folder.place()
        if place is None:
            what = f'{before} was removed, or moved to where it cannot be seen'
            self._faults.note(_PLACE, what)
            return
        self.folder.path = place
        self._faults.mend(_PLACE)
        if place != before:
            self._faults.mention(
                f'{before} was renamed while it was recorded; the recording goes on in {place}'
            )

    @property
    def is_full(self) -> bool:
        """Return whether the disk is full, so that only the end may be written any more."""
        return self.reserve is not None and self.reserve.spent is not None

    def name(self, number: int) -> str:
        """Return the name of a file of the run, the first of which is number 0."""
        return f'{self._name}_{number}.mcap'

    def next_number(self, number: int) -> int:
        """Return the number that follows, and is above those of all files that there are."""
        pattern = re.compile(re.escape(self._name) + r'_([0-9]+)\.mcap')
        found = (pattern.fullmatch(name) for name in self.folder.names())
        return max(number, *(int(match[1]) for match in found if match), -1) + 1

    def sync(self) -> None:
        """Make its own name survive a power failure."""
        parent = OpenFolder(self.path.parent)
        parent.sync()
        parent.close()

    def remove(self) -> None:
        """Remove it with all that is in it, whatever it is called now."""
        self.release()
        place = self.folder.place()
        if place is not None:
            shutil.rmtree(place, ignore_errors=True)

    def release(self) -> None:
        """Let the end of the run have the space that was kept for it."""
        if self.reserve is not None:
            self.reserve.release()

    def metadata(self, files: Sequence[FileSummary]) -> dict[str, object]:
        """Return the metadata of a run of these files."""
        return bag_metadata(files, self._ros_distro)

    def write_metadata_yaml(self, files: Sequence[FileSummary]) -> None:
        """Write metadata.yaml for a run of these files."""
        self.folder.replace(FILE_NAME, metadata_yaml(self.metadata(files)))

    def rewrite_metadata_yaml(self, files: Sequence[FileSummary]) -> None:
        """Write it again; where that cannot be, it is a fault until it can."""
        try:
            self.write_metadata_yaml(files)
        except OSError as error:
            what = f'{self.path / FILE_NAME} cannot be written: {error.strerror}'
            self._faults.note(FILE_NAME, what)
        else:
            self._faults.mend(FILE_NAME)

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
        if least > 0 and (free := self.folder.free_space()) < least:
            return LowSpaceError(self.path, free, least)
        return None


def _make_parents(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        reason = 'it is no folder, so no run can be made in it'
        raise NotADirectoryError(errno.ENOTDIR, reason, error.filename) from None


def _made(path: Path) -> OpenFolder:
    try:
        path.mkdir()
    except FileExistsError:
        raise RunExistsError(path) from None
    return OpenFolder(path)
