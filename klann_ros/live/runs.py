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

    async def page(self, name: str, program: str = 'review') -> Page | None:
        """Return the page of a run by a program, started if new; None without such a run."""
        run = next((run for run in await self.runs() if run.name == name), None)
        if run is None:
            return None
        key = program, run.name, run.time
        if key not in self._pages:
            self._forget_old()
            if self._temporary is None:
                self._temporary = tempfile.TemporaryDirectory(prefix='klann_ros-view-')
            file = Path(self._temporary.name, f'{program}-{len(self._pages)}-{run.time}.html')
            self._pages[key] = Page(file)
            task = asyncio.create_task(self._make_page(run, self._pages[key], program))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        return self._pages[key]

    def _forget_old(self) -> None:
        finished = [key for key, page in self._pages.items() if page.done.is_set()]
        for key in finished[: max(0, len(self._pages) - _MAX_PAGES + 1)]:
            self._pages.pop(key).file.unlink(missing_ok=True)

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
        process = await asyncio.create_subprocess_exec(
            *(self._command or (sys.executable, '-c', _RUN.format(program))),
            # An absolute path is never mistaken for an option.
            str(run.path.absolute()),
            '--html',
            str(file),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            _, errors = await asyncio.wait_for(process.communicate(), REVIEW_TIMEOUT)
        except asyncio.TimeoutError:
            return f'the {PROGRAMS[program]} took too long'
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        if process.returncode in {0, 1} and file.is_file():
            return ''
        lines = errors.decode(errors='replace').strip().splitlines() or ['no reason was given']
        return printable(lines[-1])
