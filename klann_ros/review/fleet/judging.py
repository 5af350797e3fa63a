"""A run to its row: a pure function, mapped over all by whichever engine."""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
import hashlib
from pathlib import Path
from typing import Any

from klann_ros import __version__
from klann_ros.engines import parallel_map, TaskError
from klann_ros.log.errors import LogError
from klann_ros.log.read.run_files import run_files
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review
from klann_ros.review.page.page import save
from klann_ros.review.report.outputs import Output, OutputError
from klann_ros.review.reviewing import review_run
from klann_ros.robot import Robot

from .expectations import Expectations
from .row import reviewed_row, Row, unreadable_row
from .runs import FoundRun

# The numbers of a page among many [bytes]: a thousand of them are to fit on a disk.
PAGE_MOST = 300e3


@dataclass(frozen=True)
class Task:
    """
    A run that is to be judged.

    Attributes
    ----------
    run : FoundRun
        Where it is.
    robot : Robot, optional
        What it is held against, instead of what it tells.
    limits : Limits
        What is still all right.
    expectations : Expectations
        What it must hold beyond.
    page : str
        Where its own page goes; '' for none.

    """

    run: FoundRun
    robot: Robot | None = None
    limits: Limits = field(default_factory=Limits)
    expectations: Expectations = field(default_factory=Expectations)
    page: str = ''

    @property
    def settings(self) -> str:
        """Return a fingerprint of what the run is held against."""
        legs = self.robot and self.robot.legs
        allowed = sorted(self.expectations.allow)
        told = (
            __version__,
            self.limits,
            legs and [(leg.name, leg.linkage.numbers, leg.linkage.joint_names) for leg in legs],
            sorted(self.expectations.topics.items()),
            allowed,
            self.expectations.baseline,
        )
        return hashlib.sha256(repr(told).encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Judged:
    """
    What came of a task.

    Attributes
    ----------
    row : Row
        Its row.
    page_fault : str
        Why its page could not be written; '' if it was, or was not asked for.

    """

    row: Row
    page_fault: str = ''


def judge_each(
    tasks: Sequence[Task], *, engine: str = 'local', jobs: int | None = None, **options: Any
) -> Iterator[Row]:
    """
    Yield the rows of runs in the order of the tasks; options as `engines.parallel_map`.

    Raises
    ------
    EngineError
        The engine cannot be had.

    """
    waiting: dict[int, Row] = {}
    following = 0
    for number, judged in judged_each(tasks, engine=engine, jobs=jobs, **options):
        waiting[number] = judged.row
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def judged_each(
    tasks: Sequence[Task], **options: Any
) -> Generator[tuple[int, Judged], None, None]:
    """Yield the number of each task and what came of it, as they are done."""
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
    """Return the row of a run, whatever is wrong with it; write its page if that is asked for."""
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
        Output('--html', path).save(lambda file: save([review], None, file, PAGE_MOST))
    except OutputError as error:
        return str(error)
    return ''


def written(run: FoundRun) -> dict[str, int]:
    """Return size and modified of a run's files, as far as they can be looked at."""
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
