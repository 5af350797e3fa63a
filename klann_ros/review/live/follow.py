"""A run that is being recorded, judged as it grows."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
import re
from time import monotonic, sleep

from klann_ros.log.errors import NotALogError
from klann_ros.log.mcap.growing import GrowingFile, NamedRecord
from klann_ros.log.read.run_files import natural
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    PAUSE_RECORD,
    recorded_pause,
    solver_parameters,
    SOLVER_RECORD,
)
from klann_ros.log.write.durable_file import is_being_written
from klann_ros.review.model.limits import Limits
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .judge import LiveJudge, STEP

# Period of reading [s].
PERIOD = 0.2
# Time for the next file of a split run to appear [s].
SPLIT = 2.0
# Stall of the recorder that is reported [s].
QUIET = 5.0
_SUFFIX = '.mcap'
# What clocks may say, as a time to people [ns].
_LAST_TIME = 253_402_300_799 * 10**9

Say = Callable[[str], object]


def follow(path: str, limits: Limits, *, found: Say, said: Say) -> None:
    """
    Print the findings of a run during the recording, until it is closed or abandoned.

    Parameters
    ----------
    path : str
        The run, or a file of one; it need not be there yet.
    limits : Limits
        Limits of the checks.
    found, said : callable
        Called with a line for each new finding, and for each change of state.

    Raises
    ------
    NotALogError
        It is no run of MCAP files.
    OSError
        It cannot be read.

    """
    judging = _FollowJudge(limits, found)
    for record in _FileFollower(Path(path), said).records():
        judging.take(record)
    judging.ask()


class _FollowJudge:
    """Asks the judge by the clock of the log, that is as fast as the run can be read."""

    def __init__(self, limits: Limits, found: Say) -> None:
        self._judge, self._found = LiveJudge(limits), found
        self._waiting: list[Message] = []
        self._last = self._due = 0

    def take(self, record: Message | NamedRecord) -> None:
        if not isinstance(record, Message):
            name, content = record
            with suppress(ValueError):
                if name == SOLVER_RECORD:
                    self._judge.set_solver(solver_parameters(content))
                elif name == PAUSE_RECORD:
                    self._judge.excuse(recorded_pause(content))
            return
        self._waiting.append(record)
        self._last = max(self._last, min(record.log_time, _LAST_TIME))
        self._due = self._due or self._last + _STEP
        # Where nothing is, nothing need be judged.
        if self._last >= self._due:
            self.ask()

    def ask(self) -> None:
        self._judge.add_all(self._waiting)
        self._waiting.clear()
        self._due = self._last + _STEP
        for finding in self._judge.findings(self._last):
            if finding.is_new:
                time = datetime.fromtimestamp(min(finding.time, _LAST_TIME) / 1e9, timezone.utc)
                shown = f'{time:%Y-%m-%dT%H:%M:%S}.{time.microsecond // 1000:03}Z'
                severity, of = finding.severity.name, f'{printable(finding.leg)}: '
                text = f'{of if finding.leg else ""}{finding.text}'
                self._found(f'{shown} {severity} {finding.check}: {text}')


_STEP = round(STEP * 1e9)


class _FileFollower:
    """Reads the files of a run one after the other, each as it grows."""

    def __init__(self, path: Path, said: Say) -> None:
        self._path, self._said = path, said
        self._growth = monotonic()
        self._is_quiet = False

    def records(self) -> Iterator[Message | NamedRecord]:
        place: Path | None = self._first()
        while place is not None:
            file = GrowingFile(place)
            self._said(f'following {printable(place)}')
            try:
                yield from self._all_of(file)
            finally:
                file.close()
            place = self._after(file)

    def _first(self) -> Path:
        """Return the first file of the run, when it is there."""
        is_reported = False
        while True:
            path = self._path
            if path.is_dir():
                files = sorted(path.glob(f'*{_SUFFIX}'), key=natural)
                files = [file for file in files if not file.name.startswith('.')]
                if files:
                    return files[0]
                if any(path.glob('*.db3*')):
                    raise NotALogError(path, 'only runs of MCAP files can be followed')
            elif path.exists() or path.is_symlink():
                if path.suffix != _SUFFIX:
                    raise NotALogError(path, 'only runs of MCAP files can be followed')
                return path
            if not is_reported:
                self._said(f'waiting for {printable(path)}')
                is_reported = True
            sleep(PERIOD)

    def _all_of(self, file: GrowingFile) -> Iterator[Message | NamedRecord]:
        """Yield the records of a file until it is finished, damaged or abandoned."""
        was_written = False
        while True:
            # Checked before reading: later records are read once more.
            is_written = _is_written(file.path)
            was_written = was_written or is_written
            for record in file.read():
                self._growth, self._is_quiet = monotonic(), False
                yield record
            if file.is_finished:
                return
            if file.problem:
                self._said(f'{printable(file.path.name)} cannot be read on: {file.problem}')
                return
            if file.is_gone:
                self._said(f'{printable(file.path.name)} was removed')
                return
            if was_written and not is_written:
                self._said(
                    f'{printable(file.path.name)} is unfinished, and its recorder has stopped'
                )
                return
            self._report_stall()
            sleep(PERIOD)

    def _report_stall(self) -> None:
        if not self._is_quiet and monotonic() - self._growth > QUIET:
            self._is_quiet = True
            self._said(f'nothing new for {QUIET:g} s; Ctrl-C ends it')

    def _after(self, file: GrowingFile) -> Path | None:
        """Return the file that follows in a run that was split, None if there is none."""
        numbered = re.fullmatch(r'(.*)_([0-9]{1,9})', file.path.stem)
        if numbered is None or not self._path.is_dir():
            return None
        end = monotonic() + SPLIT
        while True:
            # Numbers may be left out where somebody has put files of his own.
            later = [
                path
                for path in file.path.parent.glob(f'*_*{_SUFFIX}')
                if path.stem.rpartition('_')[0] == numbered[1]
                and natural(path) > natural(file.path)
            ]
            if later:
                return min(later, key=natural)
            if monotonic() > end:
                return None
            sleep(PERIOD)


def _is_written(path: Path) -> bool:
    """Return whether a recorder of this project has a file in hand."""
    try:
        with open_regular(path) as file:
            return is_being_written(file)
    except OSError:
        return False
