"""The runs in a folder, their reviews and calibrations, made on request by another process."""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
import os
from pathlib import Path
import sys
import tempfile
import time

from klann_ros.log.errors import LogError
from klann_ros.review import Row, rows_from_table
from klann_ros.sanitize.text import printable

# Maximum number of runs on the page, the newest.
MAX_RUNS = 500
# Entries of the folder, and files of a run, that are looked at.
_MAX_ENTRIES = 20_000
_MAX_FILES = 100
# A review of a very long run takes a minute [s].
REVIEW_TIMEOUT = 600.0
# Pages in the cache.
_MAX_PAGES = 32
# Runs that a process judges, so that the first verdicts come soon.
_BATCH_SIZE = 10
# A run that changed later than this is being recorded, and judged when it is complete [s].
_SETTLING_TIME = 5.0
# At low priority: the legs come first.
_RUN = 'import os, sys; os.nice(10); from klann_ros import executables; sys.exit(executables.{}())'
# The programs, and what each makes of a run.
PROGRAMS = {'review': 'review', 'calibrate': 'calibration'}


@dataclass(frozen=True)
class ListedRun:
    """A run in the folder."""

    name: str
    path: Path
    # Time of the last change [ns since the epoch].
    time: int

    @property
    def is_changing(self) -> bool:
        """Return whether the run is probably being recorded."""
        return time.time_ns() - self.time < _SETTLING_TIME * 1e9


@dataclass
class Page:
    """The review or the calibration of a run, pending or complete."""

    file: Path
    # The reason for a failure; '' without one.
    failure: str = ''
    done: asyncio.Event = field(default_factory=asyncio.Event)


def runs_in(folder: str | Path) -> list[ListedRun]:
    """
    Return the runs that are directly in a folder, the newest first.

    Links are ignored: they may lead out of it. Names of runs are only compared, never opened.
    """
    runs: list[ListedRun] = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in islice(entries, _MAX_ENTRIES):
            with suppress(OSError):
                if _is_run(entry):
                    time = entry.stat(follow_symlinks=False).st_mtime_ns
                    runs.append(ListedRun(entry.name, Path(entry.path), time))
    runs.sort(key=lambda run: (-run.time, run.name))
    return runs[:MAX_RUNS]


def _is_run(entry: 'os.DirEntry[str]') -> bool:
    if entry.is_file(follow_symlinks=False):
        return entry.name.endswith('.mcap')
    if not entry.is_dir(follow_symlinks=False):
        return False
    with os.scandir(entry.path) as files:
        names = [file.name for file in islice(files, _MAX_FILES)]
    return any(name.endswith(('.mcap', '.db3')) or name == 'metadata.yaml' for name in names)


class Reviews:
    """
    Reviews and calibrations of the runs in a folder, as pages; one is made at a time.

    `command` replaces both programs; RUN --html FILE is appended.
    """

    def __init__(self, folder: str, command: Sequence[str] = ()) -> None:
        self._folder = folder
        self._command = command
        self._pages: dict[tuple[str, str, int], Page] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        # The rows of judged runs by name and time of change; None for one that has no row.
        self._rows: dict[tuple[str, int], Row | None] = {}
        self._judging: asyncio.Task[None] | None = None
        # One review is made at a time.
        self._turn = asyncio.Semaphore(1)
        # Made for the first page.
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    def close(self) -> None:
        """Delete the pages, and cancel pending reviews."""
        for task in self._tasks:
            task.cancel()
        if self._temporary is not None:
            self._temporary.cleanup()

    async def runs(self) -> list[ListedRun]:
        """Return the runs in the folder, read in a thread: the disk may be slow."""
        return await asyncio.to_thread(runs_in, self._folder)

    def judged_rows(self, runs: Sequence[ListedRun]) -> dict[str, Row | None]:
        """
        Return the rows of runs by their names, as far as they are judged.

        The missing ones are judged beside the page; a run that is being recorded is not.
        """
        keys = {(run.name, run.time) for run in runs}
        self._rows = {key: row for key, row in self._rows.items() if key in keys}
        missing = []
        for run in runs:
            if (run.name, run.time) not in self._rows and not run.is_changing:
                missing.append(run)
        if missing and (self._judging is None or self._judging.done()):
            self._judging = asyncio.create_task(self._judge(missing[:_BATCH_SIZE]))
            self._tasks.add(self._judging)
            self._judging.add_done_callback(self._tasks.discard)
        return {name: row for (name, _), row in self._rows.items()}

    async def _judge(self, runs: Sequence[ListedRun]) -> None:
        """Judge runs by `review --each`."""
        async with self._turn:
            table = self._temporary_folder() / 'runs.csv'
            table.unlink(missing_ok=True)
            # An absolute path is never mistaken for an option.
            paths = [str(run.path.absolute()) for run in runs]
            options = ['--each', '--jobs', '1', '--table', str(table)]
            with suppress(OSError, asyncio.TimeoutError):
                await self._run('review', *options, *paths)
            rows = await asyncio.to_thread(_read_rows, table)
            for run, path in zip(runs, paths, strict=True):
                self._rows[run.name, run.time] = rows.get(Path(path).resolve())

    def _temporary_folder(self) -> Path:
        if self._temporary is None:
            self._temporary = tempfile.TemporaryDirectory(prefix='klann_ros-view-')
        return Path(self._temporary.name)

    async def page(self, name: str, program: str = 'review') -> Page | None:
        """Return the page of a run by a program, started if new; None without such a run."""
        run = next((run for run in await self.runs() if run.name == name), None)
        if run is None:
            return None
        key = program, run.name, run.time
        if key not in self._pages:
            finished = [old for old, page in self._pages.items() if page.done.is_set()]
            for old in finished[: max(0, len(self._pages) - _MAX_PAGES + 1)]:
                self._pages.pop(old).file.unlink(missing_ok=True)
            file = self._temporary_folder() / f'{program}-{len(self._pages)}-{run.time}.html'
            self._pages[key] = Page(file)
            task = asyncio.create_task(self._make_page(run, self._pages[key], program))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        return self._pages[key]

    async def _make_page(self, run: ListedRun, page: Page, program: str) -> None:
        async with self._turn:
            try:
                page.failure = await self._write_page(run, page.file, program)
            except OSError as error:
                reason = printable(error.strerror)
                page.failure = f'the {PROGRAMS[program]} cannot be made: {reason}'
            page.done.set()

    async def _write_page(self, run: ListedRun, file: Path, program: str) -> str:
        """Write a page by a program; return the reason for a failure, '' without one."""
        try:
            exit_code, errors = await self._run(
                program, str(run.path.absolute()), '--html', str(file)
            )
        except asyncio.TimeoutError:
            return f'the {PROGRAMS[program]} took too long'
        if exit_code in {0, 1} and file.is_file():
            return ''
        lines = errors.decode(errors='replace').strip().splitlines() or ['no reason was given']
        return printable(lines[-1])

    async def _run(self, program: str, *arguments: str) -> tuple[int | None, bytes]:
        """Run a program; return its exit code and what it wrote to stderr."""
        process = await asyncio.create_subprocess_exec(
            *(self._command or (sys.executable, '-c', _RUN.format(program))),
            *arguments,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            _, errors = await asyncio.wait_for(process.communicate(), REVIEW_TIMEOUT)
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        return process.returncode, errors


def _read_rows(table: Path) -> dict[Path, Row]:
    """Return the rows of a table by their runs, whose paths may lead over links; or none."""
    try:
        return {Path(row.run).resolve(): row for row in rows_from_table(str(table))}
    except (OSError, LogError):
        return {}
