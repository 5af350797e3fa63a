"""Find runs, and review each of them in parallel."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
import hashlib
import os
from pathlib import Path
import re
import stat
from typing import Any

from klann_ros import __version__
from klann_ros.engines import parallel_map, TaskError
from klann_ros.log.bag_metadata import FILE_NAME
from klann_ros.log.errors import LogError
from klann_ros.log.read.run_files import is_log_name, natural, run_files, run_name
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review
from klann_ros.review.page.page import save
from klann_ros.review.reviewing import review_run
from klann_ros.robot import Robot
from klann_ros.sanitize.outputs import Output, OutputError
from klann_ros.sanitize.text import printable

from .expectations import Expectations
from .table import reviewed_row, Row, unreadable_row


@dataclass(frozen=True)
class FoundRun:
    """
    A run, or a path that is none.

    Attributes
    ----------
    path : str
        Its path.
    fault : str
        Why it cannot be one; '' for a run.

    """

    path: str
    fault: str = ''


def find_runs(paths: Iterable[str]) -> list[FoundRun]:
    """
    Return the runs at paths and in folders, each once, in the order of the paths and by names.

    A folder is one run if it has metadata.yaml, or if all its logs are numbered files of one name;
    else each log in it is a run, and so are those in the folders below. What cannot be looked
    into is in the list with its reason, as is an empty folder: its recorder may have died early. A
    link to a folder is followed once: in what it leads to, other links to folders are not.
    """
    found: dict[str, FoundRun] = {}
    for path in paths:
        for run in _runs(path, ()):
            found.setdefault(os.path.realpath(run.path) + run.fault, run)
    return list(found.values())


def _runs(
    path: str, above: tuple[tuple[int, int], ...], *, is_linked: bool = False
) -> Iterator[FoundRun]:
    try:
        status = Path(path).stat()
        if not stat.S_ISDIR(status.st_mode):
            yield FoundRun(path)
            return
        here = status.st_dev, status.st_ino
        if here in above:
            yield FoundRun(path, f'{printable(path)} leads back to a folder that it is in')
            return
        with os.scandir(path) as entries:
            names = sorted((entry.name for entry in entries), key=lambda name: natural(Path(name)))
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        yield FoundRun(path, f'{printable(path)} cannot be read: {reason}')
        return
    visible = [name for name in names if not name.startswith('.')]
    logs = [name for name in visible if is_log_name(Path(name))]
    if FILE_NAME in names or (logs and _are_one(logs)):
        yield FoundRun(path)
        return
    for name in visible:
        inner = str(Path(path) / name)
        if name in logs:
            yield FoundRun(inner)
        else:
            yield from _below(inner, (*above, here), is_linked=is_linked)
    if above and not names:
        yield FoundRun(path, f'{printable(path)} is an empty folder: there is no log in it')


def _below(
    path: str, above: tuple[tuple[int, int], ...], *, is_linked: bool
) -> Iterator[FoundRun]:
    """Yield the runs of an entry that is a folder."""
    try:
        is_folder = stat.S_ISDIR(Path(path).stat().st_mode)
    except FileNotFoundError:
        return
    except OSError as error:
        yield FoundRun(path, f'{printable(path)} cannot be read: {error.strerror}')
        return
    is_link = Path(path).is_symlink()
    if is_folder and is_link and is_linked:
        yield FoundRun(path, f'{printable(path)} is a link in a linked folder, not followed')
    elif is_folder:
        yield from _runs(path, above, is_linked=is_linked or is_link)


def _are_one(logs: Iterable[str]) -> bool:
    """Return whether files are numbered parts of one run, as recorders name them."""
    parts = [re.fullmatch(r'(.+)_\d+', run_name(Path(name))) for name in logs]
    return len({part and part[1] for part in parts}) == 1 and None not in parts


# Data of a page among many [bytes]: a thousand pages fit on a disk.
MAX_PAGE_DATA = 300e3


@dataclass(frozen=True)
class Task:
    """
    A run to judge.

    Attributes
    ----------
    run : FoundRun
        Its path.
    robot : Robot, optional
        The reference robot, instead of the one in the run.
    limits : Limits
        Limits of the checks.
    expectations : Expectations
        Its expectations.
    page : str
        Path of its page; '' for none.

    """

    run: FoundRun
    robot: Robot | None = None
    limits: Limits = field(default_factory=Limits)
    expectations: Expectations = field(default_factory=Expectations)
    page: str = ''

    @property
    def settings(self) -> str:
        """Return a hash of the settings."""
        legs = self.robot and self.robot.legs
        allowed = sorted(self.expectations.allow)
        settings = (
            __version__,
            self.limits,
            legs and [(leg.name, leg.linkage.numbers, leg.linkage.joint_names) for leg in legs],
            sorted(self.expectations.topics.items()),
            allowed,
            self.expectations.baseline,
        )
        return hashlib.sha256(repr(settings).encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Judged:
    """
    The result of a task.

    Attributes
    ----------
    row : Row
        Its row.
    page_fault : str
        Why its page could not be written; '' for none.

    """

    row: Row
    page_fault: str = ''


def judge_runs(
    tasks: Sequence[Task], *, engine: str = 'local', jobs: int | None = None, **options: Any
) -> Iterator[Row]:
    """
    Yield the rows of runs in the order of the tasks; options as `engines.parallel_map`.

    Raises
    ------
    EngineError
        The engine is not available.

    """
    waiting: dict[int, Row] = {}
    following = 0
    for number, judged in judge_unordered(tasks, engine=engine, jobs=jobs, **options):
        waiting[number] = judged.row
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def judge_unordered(
    tasks: Sequence[Task], **options: Any
) -> Generator[tuple[int, Judged], None, None]:
    """Yield the number and the result of each task, as they finish."""
    for number, answer in parallel_map(judge, tasks, **options):
        if isinstance(answer, TaskError):
            task = tasks[number]
            row = unreadable_row(
                task.run.path, answer.reason, **written(task.run), settings=task.settings
            )
            yield number, Judged(row)
        else:
            yield number, answer


def judge(task: Task) -> Judged:
    """Return the row of a run, and write its page if it has a path."""
    known = {**written(task.run), 'settings': task.settings}
    if task.run.fault:
        return Judged(unreadable_row(task.run.path, task.run.fault, **known))
    try:
        baseline = _baseline(task.expectations.baseline, task.robot, task.limits)
        rates = 'f4' if task.page else ''
        review = review_run(task.run.path, robot=task.robot, limits=task.limits, rates=rates)
    except (LogError, OSError, MemoryError) as error:
        reason = str(error) or 'there is not memory enough for it'
        return Judged(unreadable_row(task.run.path, reason, **known))
    findings = (*review.findings, *task.expectations.unmet(review, baseline))
    review = replace(review, findings=findings)
    row = reviewed_row(task.run.path, review, findings, task.expectations.allow, **known)
    return Judged(row, _page_fault(task.page, review))


def _page_fault(path: str, review: Review) -> str:
    if not path:
        return ''
    try:
        Output('--html', path).save(lambda file: save([review], None, file, MAX_PAGE_DATA))
    except OutputError as error:
        return str(error)
    return ''


def written(run: FoundRun) -> dict[str, int]:
    """Return size and time of modification of a run's files, if readable."""
    try:
        statuses = [path.stat() for path in run_files(run.path).paths]
    except (LogError, OSError):
        try:
            statuses = [Path(run.path).lstat()]
        except (OSError, ValueError):
            return {}
    return {
        'size': sum(status.st_size for status in statuses),
        'modified': max((status.st_mtime_ns for status in statuses), default=0),
    }


@lru_cache(maxsize=1)
def _baseline(path: str, robot: Robot | None, limits: Limits) -> Review | None:
    return review_run(path, robot=robot, limits=limits) if path else None
