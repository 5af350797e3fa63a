"""Find runs, review each of them in parallel, and hold them against expectations."""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
import hashlib
from math import inf, isfinite
import os
from pathlib import Path
import re
import stat
from typing import Any

from klann_ros import __version__
from klann_ros.cli import Output, OutputError
from klann_ros.engines import parallel_map, TaskError
from klann_ros.log import FILE_NAME, is_log_name, natural_key, run_files, run_name
from klann_ros.log.errors import LogError
from klann_ros.review.model.compare import compare
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.topics import TopicFigures
from klann_ros.review.page import save
from klann_ros.review.report.annotations import annotate
from klann_ros.review.reviewing import review_run
from klann_ros.robot import Robot
from klann_ros.sanitize.files import with_home
from klann_ros.sanitize.text import did_you_mean, printable, printable_line
from klann_ros.sanitize.yaml_text import content_of_file

from .rows import reviewed_row, Row, UNREADABLE


@dataclass(frozen=True)
class FoundRun:
    """A run, or a path that is none."""

    path: str
    fault: str = ''  #: why it cannot be one; '' for a run


def find_runs(paths: Iterable[str]) -> list[FoundRun]:
    """
    Return the runs at paths and in folders, each once, in the order of the paths and by names.

    A folder is one run if it has metadata.yaml, or if all its logs are numbered files of one name;
    else each log in it is a run, and so are those in the folders below. What cannot be looked
    into is in the list with its reason, as is an empty folder: its recorder may have died early. A
    link to a folder is followed once: in what it leads to, other links to folders are not.
    """
    runs: dict[str, FoundRun] = {}
    for path in paths:
        for run in _runs(Path(path), ()):
            runs.setdefault(os.path.realpath(run.path) + run.fault, run)
    return list(runs.values())


def _runs(
    path: Path, parents: tuple[tuple[int, int], ...], *, is_linked: bool = False
) -> Iterator[FoundRun]:
    """Yield the runs at a path; `parents` are device and inode of the folders that it is in."""
    try:
        status = path.stat()
        is_folder = stat.S_ISDIR(status.st_mode)
        entries = sorted(path.iterdir(), key=natural_key) if is_folder else []
    except (OSError, ValueError) as error:
        # A link in a folder may lead nowhere.
        if not parents or not isinstance(error, FileNotFoundError):
            reason = getattr(error, 'strerror', None) or error
            yield FoundRun(str(path), f'{printable(path)} cannot be read: {reason}')
        return
    if is_folder:
        inode = (status.st_dev, status.st_ino)
        yield from _runs_in_folder(path, entries, parents, inode, is_linked=is_linked)
    elif not parents:
        yield FoundRun(str(path))


def _runs_in_folder(
    folder: Path,
    entries: Sequence[Path],
    parents: tuple[tuple[int, int], ...],
    inode: tuple[int, int],
    *,
    is_linked: bool,
) -> Iterator[FoundRun]:
    is_link = bool(parents) and folder.is_symlink()
    fault = ''
    if is_link and is_linked:
        fault = 'is a link in a linked folder, not followed'
    elif inode in parents:
        fault = 'leads back to a folder that it is in'
    elif parents and not entries:
        fault = 'is an empty folder: there is no log in it'
    if fault or _is_run(entries):
        yield FoundRun(str(folder), fault and f'{printable(folder)} {fault}')
        return
    for entry in entries:
        if is_log_name(entry) and not entry.name.startswith('.'):
            yield FoundRun(str(entry))
        elif not entry.name.startswith('.'):
            yield from _runs(entry, (*parents, inode), is_linked=is_linked or is_link)


def _is_run(entries: Sequence[Path]) -> bool:
    """Return whether a folder is one run: by its metadata, or as recorders number its files."""
    if any(entry.name == FILE_NAME for entry in entries):
        return True
    logs = [entry for entry in entries if is_log_name(entry) and not entry.name.startswith('.')]
    numbered = [re.fullmatch(r'(.+)_\d+', run_name(log)) for log in logs]
    names = {match and match[1] for match in numbered}
    return len(names) == 1 and None not in names


CHECK = 'expected'
BASELINE = 'baseline'
_KEYS = ('topics', 'allow', 'baseline')
_TOPIC_KEYS = ('min_rate', 'max_gap', 'max_lost')


class ExpectationsFileError(LogError):
    """A file without valid expectations; the text gives the reason."""


@dataclass(frozen=True)
class ExpectedTopic:
    """Expectations of a topic."""

    min_rate: float = 0.0  #: of the mean [Hz]
    max_gap: float = inf  #: [s]
    max_lost: float = 1.0  #: share of its messages, 0 to 1


@dataclass(frozen=True)
class Expectations:
    """Expectations of every run."""

    topics: Mapping[str, ExpectedTopic] = field(default_factory=dict)  #: the required topics
    allow: frozenset[str] = frozenset()  #: checks whose findings do not count
    baseline: str = ''  #: a run from which no other may differ beyond the limits; '' for none

    def unmet(self, review: Review, baseline: Review | None) -> Iterator[Finding]:
        """Yield the unmet expectations of a reviewed run."""
        topics = {topic.name: topic for topic in review.topics}
        for name, expected in self.topics.items():
            for text in _unmet(topics.get(name), expected):
                severity = Severity.WARNING if name in topics else Severity.ERROR
                meaning = 'the run does not meet the expectations (--expect)'
                yield Finding(CHECK, severity, f'{printable(name)} {text}', meaning)
        for difference in compare(baseline, review).differences if baseline is not None else ():
            meaning = 'it differs from the baseline, the first run in the text'
            leg = difference.leg
            yield Finding(BASELINE, Severity.WARNING, difference.text, meaning, leg=leg)


def _unmet(topic: TopicFigures | None, expected: ExpectedTopic) -> Iterator[str]:
    if topic is None:
        yield 'is missing'
        return
    # One message has no rate.
    rate = topic.rate if isfinite(topic.rate) else 0.0
    if rate < expected.min_rate:
        yield f'has {rate:.4g} Hz, at least {expected.min_rate:g} Hz are expected'
    if topic.longest_gap > expected.max_gap:
        yield f'has a gap of {topic.longest_gap:.4g} s, at most {expected.max_gap:g} s are allowed'
    lost = topic.lost or 0
    share = lost / (lost + topic.count) if lost else 0.0
    if share > expected.max_lost:
        yield f'lost {share:.3%} of its messages, at most {expected.max_lost:.3%} are allowed'


def expectations_from_file(path: str) -> Expectations:
    """
    Return the expectations in a YAML file; a relative baseline is looked for beside the file.

    Raises
    ------
    ExpectationsFileError
        The file cannot be read, or holds none.

    """
    parse = partial(_expectations, folder=Path(path).parent)
    return content_of_file(path, parse, 'expectations', ExpectationsFileError)


def _expectations(content: Any, folder: Path) -> Expectations:
    _must(isinstance(content, Mapping), f'it must be a mapping of {", ".join(_KEYS)}')
    _only(content, _KEYS)
    topics = content.get('topics')
    allow = content.get('allow')
    baseline = content.get('baseline')
    example = '"/joint_states: {min_rate: 190}"'
    _must(isinstance(topics, Mapping | None), f'topics must be a mapping, such as {example}')
    are_names = isinstance(allow, list | None) and all(isinstance(n, str) for n in allow or ())
    _must(are_names, 'allow must be a list of checks, such as [latency, gap]')
    _must(isinstance(baseline, str | None), 'baseline must be the path of a run')
    return Expectations(
        {str(name): _topic(name, limits) for name, limits in (topics or {}).items()},
        frozenset(allow or ()),
        str(folder / with_home(baseline)) if baseline else '',
    )


def _topic(name: Any, content: Any) -> ExpectedTopic:
    if content is None:
        return ExpectedTopic()
    _must(isinstance(content, Mapping), f'{name} must be a mapping of {", ".join(_TOPIC_KEYS)}')
    _only(content, _TOPIC_KEYS)
    limits = {}
    for key, limit in content.items():
        max_limit = 1.0 if key == 'max_lost' else inf
        is_number = isinstance(limit, int | float) and not isinstance(limit, bool)
        if not (is_number and 0 <= limit <= max_limit):
            requirement = 'a share, 0 to 1' if key == 'max_lost' else 'a number >= 0'
            raise ValueError(f'{name} {key} = {limit!r} is refused: it must be {requirement}')
        limits[key] = float(limit)
    return ExpectedTopic(**limits)


def _must(condition: bool, text: str) -> None:
    if not condition:
        raise ValueError(text)


def _only(content: Mapping[Any, Any], keys: tuple[str, ...]) -> None:
    for key in content:
        if key not in keys:
            raise ValueError(f'{key}: there is {", ".join(keys)}{did_you_mean(key, keys)}')


# Data of a page among many [bytes]: a thousand pages fit on a disk.
MAX_PAGE_DATA = 300e3


@dataclass(frozen=True)
class Task:
    """A run to judge."""

    run: FoundRun
    robot: Robot | None = None  #: the reference robot, instead of the one in the run
    limits: Limits = field(default_factory=Limits)
    expectations: Expectations = field(default_factory=Expectations)
    page: str = ''  #: path of its page; '' for none
    annotated: str = ''  #: path of its annotated copy; '' for none

    @property
    def settings(self) -> str:
        """Return a hash of the settings."""
        legs = self.robot and self.robot.legs
        expected = self.expectations
        settings = (
            __version__,
            self.limits,
            legs and [(leg.name, leg.linkage.numbers, leg.linkage.joint_names) for leg in legs],
            sorted(expected.topics.items()),
            sorted(expected.allow),
            expected.baseline,
        )
        return hashlib.sha256(repr(settings).encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Judged:
    """The result of a task."""

    row: Row
    faults: tuple[str, ...] = ()  # why its page or its copy could not be written


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
            yield number, _unreadable(tasks[number], answer.reason)
        else:
            yield number, answer


def _unreadable(task: Task, reason: object) -> Judged:
    run = printable(task.run.path)
    # The row has the path already.
    text = printable_line(reason).removeprefix(f'{run} ')
    files: dict[str, Any] = written(task.run)
    return Judged(Row(run, UNREADABLE, text, settings=task.settings, **files))


def judge(task: Task) -> Judged:
    """Return the row of a run, and write its outputs."""
    if task.run.fault:
        return _unreadable(task, task.run.fault)
    # Before the review: a run that is written to meanwhile has to be judged again.
    files = written(task.run)
    try:
        baseline = _baseline(task.expectations.baseline, task.robot, task.limits)
        review = review_run(
            task.run.path,
            robot=task.robot,
            limits=task.limits,
            rates='f4' if task.page else '',
            keep_solved=bool(task.annotated),
        )
    except (LogError, OSError, MemoryError) as error:
        return _unreadable(task, str(error) or 'there is not memory enough for it')
    findings = (*review.findings, *task.expectations.unmet(review, baseline))
    review = replace(review, findings=findings)
    allowed_checks = task.expectations.allow
    row = reviewed_row(task.run.path, review, allowed_checks, settings=task.settings, **files)
    return Judged(row, tuple(_write_outputs(task, review)))


def _write_outputs(task: Task, review: Review) -> Iterator[str]:
    """Write the page and the annotated copy of a run; yield the faults."""
    page = partial(save, [review], None, max_bytes=MAX_PAGE_DATA)
    writers: dict[str, Callable[[], None]] = {
        task.page: lambda: Output('--html', task.page).save(page),
        task.annotated: lambda: annotate(review, task.annotated),
    }
    for path, write in writers.items():
        try:
            if path:
                write()
        except OutputError as error:  # noqa: PERF203, RUF100 - of each output
            yield str(error)


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
