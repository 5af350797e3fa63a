"""Follow a run during the recording, and judge it."""

from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
import re
from time import monotonic, sleep

from klann_ros.log import (
    GrowingFile,
    is_being_written,
    MAX_ROS_TIME,
    Message,
    NamedRecord,
    natural_key,
    run_parameters,
)
from klann_ros.log.errors import NotALogError
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import located
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable

from .judge import LiveJudge, STEP

# Period of reading, time for the next file of a split run to appear, and stall of the recorder
# that is reported [s].
PERIOD = 0.2
SPLIT = 2.0
STALL = 5.0
_SUFFIX = '.mcap'
_STEP = round(STEP * 1e9)
Report = Callable[[str], object]


def follow(path: str, limits: Limits, *, on_finding: Report, on_status: Report) -> None:
    """
    Report the findings of a run during the recording, until it is closed or abandoned.

    The run need not be there yet. `on_finding` gets a line for each new finding, `on_status`
    one for each change of state. Raises a NotALogError if it is no run of MCAP files, and an
    OSError if it cannot be read.
    """
    # By the clock of the log, as fast as the run can be read.
    judge = LiveJudge(limits)
    waiting: list[Message] = []
    last_time = 0
    due = 0
    for record in _FileFollower(Path(path), on_status).records():
        if isinstance(record, Message):
            # The report at the end names an impossible time.
            if record.log_time > MAX_ROS_TIME:
                record = replace(record, log_time=last_time)  # noqa: PLW2901
            waiting.append(record)
            last_time = max(last_time, record.log_time)
            due = due or last_time + _STEP
        else:
            _note(judge, record)
        if due and last_time >= due:
            _report(judge, waiting, last_time, on_finding)
            due = last_time + _STEP
    _report(judge, waiting, last_time, on_finding)


def _note(judge: LiveJudge, record: NamedRecord) -> None:
    """Give a record of the recorder to the judge; an invalid one is ignored."""
    name, content = record
    with suppress(ValueError):
        if name == run_parameters.SOLVER_RECORD:
            judge.set_solver(run_parameters.solver_parameters(content))
        elif name == run_parameters.PAUSE_RECORD:
            judge.excuse(run_parameters.recorded_pause(content))


def _report(judge: LiveJudge, waiting: list[Message], now: int, on_finding: Report) -> None:
    """Judge the waiting messages, and report the new findings."""
    judge.add_all(waiting)
    waiting.clear()
    for finding in judge.findings(now):
        if finding.is_new:
            time = datetime.fromtimestamp(finding.time / 1e9, timezone.utc)
            stamp = f'{time:%Y-%m-%dT%H:%M:%S}.{time.microsecond // 1000:03}Z'
            text = located(finding.leg, finding.text)
            on_finding(f'{stamp} {finding.severity.name} {finding.check}: {text}')


class _FileFollower:
    """Reads the files of a run one after the other, each as it grows."""

    def __init__(self, path: Path, on_status: Report) -> None:
        self._path = path
        self._on_status = on_status
        self._growth = monotonic()
        self._is_stalled = False

    def records(self) -> Iterator[Message | NamedRecord]:
        path: Path | None = self._first()
        while path is not None:
            self._on_status(f'following {printable(path)}')
            with closing(GrowingFile(path)) as file:
                yield from self._all_of(file)
            path = self._next(path)

    def _first(self) -> Path:
        """Return the first file of the run, as soon as it is there."""
        path = self._path
        is_reported = False
        while True:
            if path.is_dir():
                files = sorted(path.glob(f'*{_SUFFIX}'), key=natural_key)
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
                self._on_status(f'waiting for {printable(path)}')
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
                self._growth = monotonic()
                self._is_stalled = False
                yield record
            if file.is_finished:
                return
            end = ''
            if file.problem:
                end = f'cannot be read on: {file.problem}'
            elif file.is_gone:
                end = 'was removed'
            elif was_written and not is_written:
                end = 'is unfinished, and its recorder has stopped'
            if end:
                self._on_status(f'{printable(file.path.name)} {end}')
                return
            if not self._is_stalled and monotonic() - self._growth > STALL:
                self._is_stalled = True
                self._on_status(f'nothing new for {STALL:g} s; Ctrl-C ends it')
            sleep(PERIOD)

    def _next(self, path: Path) -> Path | None:
        """Return the next file of a split run; None for none."""
        numbered = re.fullmatch(r'(.*)_([0-9]{1,9})', path.stem)
        if numbered is None or not self._path.is_dir():
            return None
        end = monotonic() + SPLIT
        while True:
            # Numbers may be missing.
            later_files = []
            for file in path.parent.glob(f'*_*{_SUFFIX}'):
                is_of_run = file.stem.rpartition('_')[0] == numbered[1]
                if is_of_run and natural_key(file) > natural_key(path):
                    later_files.append(file)
            if later_files:
                return min(later_files, key=natural_key)
            if monotonic() > end:
                return None
            sleep(PERIOD)


def _is_written(path: Path) -> bool:
    """Return whether a recorder of this project has the file open."""
    try:
        with open_regular(path) as file:
            return is_being_written(file)
    except OSError:
        return False
