"""The numbered files of a run, and what is done when somebody takes one of them away."""

from collections.abc import Callable, Sequence
from contextlib import suppress

from klann_ros.log.bag_metadata import FILE_NAME, metadata_record, RECORD_NAME
from klann_ros.log.errors import RunExistsError, RunLostError
from klann_ros.sanitize.text import counted, verb

from .file_watch import Faults, Harm
from .ledger import FinishedFile, WrittenFiles
from .mcap_file import McapFile
from .run_folder import RunFolder

# What a fault is about.
_FOLDER, _FILES = 'folder', 'files'


class FileSeries:
    """
    The files of a run, one of which is being written.

    Parameters
    ----------
    folder
        Where they are.
    open_file
        Makes a file, given an open folder, a name and a reserve.
    begin
        Writes what every file begins with.
    faults
        Is told what others do to them.

    Attributes
    ----------
    current : McapFile
        The one in progress, or the last one that was.
    files : WrittenFiles
        All of them; any thread may ask.

    Raises
    ------
    OSError
        The disk said no.

    """

    def __init__(
        self,
        folder: RunFolder,
        open_file: Callable[..., McapFile],
        begin: Callable[[McapFile], None],
        faults: Faults,
    ) -> None:
        self._folder, self._open_file, self._begin, self._faults = folder, open_file, begin, faults
        self._number = self._looks = 0
        self.current = self._open(0)
        self.files = WrittenFiles(self.current)
        self._folder.write_metadata_yaml(self.files.summaries())
        self._folder.sync()

    @property
    def is_open(self) -> bool:
        """Return whether there is a file in progress."""
        return self.files.current is not None

    @property
    def next_name(self) -> str:
        """Return the name of the file that follows."""
        number = self._number + 1
        with suppress(OSError):
            number = self._folder.next_number(self._number)
        return self._folder.name(number)

    def split(self) -> None:
        """Finish the file and go on in a new one; without that there is none in progress."""
        self._finish()
        self._follow()
        self._write_metadata_yaml()

    def look(self) -> None:
        """
        Look whether folder and files are as they were left, and go on where that is possible.

        Of the finished files one is looked at each time, in turn.

        Raises
        ------
        RunLostError
            The file in progress is gone, and no other can be made.

        """
        harm = self.current.watch.look()
        if harm is not None:
            self._replace(harm)
        elif appended := self.current.watch.take_appended():
            self._faults.mention(
                f'somebody else has appended {counted(appended, "byte")} to '
                f'{self.current.name}; that is cut off again, and nothing of the run is lost'
            )
        self._folder.look()
        finished = self.files.finished
        if finished:
            self._looks += 1
            self._look_at(finished[self._looks % len(finished)])
        if self._faults.has(FILE_NAME):
            self._write_metadata_yaml()

    def close(self) -> None:
        """Finish the file in progress, and look at all for the last time."""
        try:
            if self.is_open and self.current.failure is None:
                self.look()
            if self.is_open:
                self._finish()
        finally:
            self._look_at_last()
            self.current.close()
            self._folder.look()
            self._look_at(*self.files.finished)
            self._write_metadata_yaml()

    def _look_at_last(self) -> None:
        """Look at a file that could not be finished."""
        with suppress(OSError):
            if self.is_open and (harm := self.current.watch.look()) is not None:
                self._faults.note(_FILES, self._lose_current(harm))

    def _finish(self) -> None:
        self._write_end()
        harm = self.current.watch.look()
        if harm is None:
            self.files = self.files.with_current_finished()
        else:
            self._faults.note(_FILES, self._lose_current(harm))
        self.current.close()

    def _write_end(self) -> None:
        metadata = self._folder.metadata(self.files.summaries())
        self.current.add_metadata(RECORD_NAME, metadata_record(metadata))
        self.current.finish()

    def _replace(self, harm: Harm) -> None:
        """Go on in a new file, as the one in progress is gone."""
        if harm is Harm.MOVED:
            with suppress(OSError):
                self._write_end()  # so that whoever has it now has it whole
        what = self._lose_current(harm)
        self.current.close()
        try:
            self._follow()
        except RunExistsError as error:
            raise RunLostError(f'{what}; {error}') from None
        except OSError as error:
            raise RunLostError(f'{what}; no other can be made: {error.strerror}') from error
        self._faults.note(_FILES, what, f'the recording goes on in {self.current.name}')
        self._write_metadata_yaml()

    def _lose_current(self, harm: Harm) -> str:
        """Take the file in progress out of the run; return what is to be said of it."""
        what = self._description(harm)
        self.files = self.files.without_current()
        return what

    def _description(self, harm: Harm) -> str:
        file, place = self.current, self.current.watch.place()
        number = file.message_count
        count = counted(number, 'message')
        if harm is Harm.REMOVED:
            return f'{file.name} was removed while it was recorded, with {count} in it'
        if harm is Harm.MOVED:
            where = 'a file of another name' if place is None else str(place)
            return (
                f'{file.name} was moved or replaced while it was recorded: its {count} went to '
                f'{where}, and {verb(number, "is", "are")} not in the run'
            )
        path, count_as = self._folder.path / file.name, verb(number, 'counts as', 'count as')
        return (
            f'{file.name} was cut off or overwritten while it was recorded: its {count} '
            f'{count_as} lost; `recover {path}` saves what is left'
        )

    def _follow(self) -> None:
        """Begin the next file."""
        try:
            following = self._open_next()
        except FileNotFoundError:
            self._make_folder_anew()
            following = self._open_next()
        self.current = following
        self.files = self.files.with_current(following)
        self._begin(following)

    def _make_folder_anew(self) -> None:
        self._folder.make_anew()
        finished = self.files.finished
        self.files = self.files.without(*finished)
        what = f'{self._folder.path} was removed while it was recorded'
        if finished:
            what = f'{what}, with {_total(finished)} in the files that were finished'
        self._faults.note(_FOLDER, what, 'it was made anew')

    def _open_next(self) -> McapFile:
        number = self._folder.next_number(self._number)
        file = self._open(number)
        self._number = number
        return file

    def _open(self, number: int) -> McapFile:
        name = self._folder.name(number)
        return self._open_file(self._folder.folder, name, reserve=self._folder.reserve)

    def _look_at(self, *files: FinishedFile) -> None:
        """Look at finished files, and take those out of the run that are gone."""
        lost = [file for file in files if not file.seal.is_intact(self._folder.folder)]
        if not lost:
            return
        self.files = self.files.without(*lost)
        self._faults.note(_FILES, _farewell(lost))
        self._write_metadata_yaml()

    def _write_metadata_yaml(self) -> None:
        self._folder.rewrite_metadata_yaml(self.files.summaries())


def _farewell(lost: Sequence[FinishedFile]) -> str:
    names = ', '.join(file.seal.name for file in lost[:3])
    others = f' and {len(lost) - 3} more' if len(lost) > 3 else ''
    return (
        f'of the files that were finished {names}{others} went, or were spoilt, with '
        f'{_total(lost)}'
    )


def _total(files: Sequence[FinishedFile]) -> str:
    return counted(sum(file.summary.message_count for file in files), 'message')
