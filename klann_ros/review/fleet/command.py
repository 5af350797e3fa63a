"""`review --each`: many runs, one row each."""

import argparse
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import re
import signal
import sys

from klann_ros.cli import (
    ArgumentParser,
    check_new_folder,
    COUNT,
    NOT_READ,
    NOT_WRITTEN,
    output_files,
    OutputError,
    path,
    print_error,
    save_all,
    SECONDS,
)
from klann_ros.engines import check_engine, EngineError, ENGINES
from klann_ros.log import open_log
from klann_ros.log.errors import LogError
from klann_ros.review.model.limits import Limits, limits_from_file
from klann_ros.robot import robot_of, RobotFileError
from klann_ros.sanitize.text import counted, printable
from tqdm import tqdm

from .index import save_index
from .judging import (
    Expectations,
    expectations_from_file,
    find_runs,
    FoundRun,
    judge_unordered,
    Task,
    written,
)
from .rows import (
    check_table,
    FINDINGS,
    OK,
    Row,
    rows_from_table,
    save_junit,
    save_table,
    TableError,
    UNREADABLE,
)

OPTION = '--each'
INTERRUPTED = 130
# Runs listed in the terminal.
_MAX_LINES = 50
DESCRIPTION = """\
Review many runs, each alone and in parallel: a row a run.

Folders are searched for runs. A run that cannot be read is a row with its reason and never stops
the rest. The rows are the same, byte for byte, with every engine and any number of jobs.
Exit code: the worst of the runs': 0 nothing found, 1 findings, 2 one is not readable (or no run is
there); 3 an output cannot be written."""


def main(argv: Sequence[str]) -> int:
    """Review many runs; return the exit code."""
    errors = dict.fromkeys((EngineError, LogError, OSError, RobotFileError), NOT_READ)
    return _parser().run(_each, errors, argv)


def _each(options: argparse.Namespace) -> int:
    check_engine(options.engine)
    if options.table:
        check_table(options.table)
    elif options.resume:
        raise TableError('--resume goes on with a table: give --table as well')
    runs = find_runs(options.logs)
    if not runs:
        raise LogError(f'there is no run in {", ".join(map(printable, options.logs))}')
    expectations = Expectations() if options.expect is None else _expectations(options.expect)
    inputs = [*(run.path for run in runs), options.geometry, options.limits, options.expect]
    inputs.append(expectations.baseline)
    files = output_files(options, ('table', 'junit', 'html'), inputs)
    robot = robot_of(options.geometry) if options.geometry is not None else None
    limits = limits_from_file(options.limits) if options.limits is not None else Limits()
    # Folders are made last: nothing is left behind by a refused file.
    pages = _pages(options.html, runs)
    annotated = _annotated(options, runs)
    tasks = []
    for run, page, copy in zip(runs, pages, annotated, strict=True):
        tasks.append(Task(run, robot, limits, expectations, page, copy))
    rows = _resumed(tasks, options.table) if options.resume else {}
    is_whole, faults = _judge(tasks, rows, options)
    finished = [rows[number] for number in sorted(rows)]
    print(_report(finished, len(runs)))
    links = {row.run: pages[n] for n, row in rows.items() if row.verdict != UNREADABLE}
    savers = {
        '--table': partial(save_table, options.table or '', finished),
        '--junit': partial(save_junit, finished),
        '--html': partial(save_index, finished, options.html or '', links),
    }
    try:
        save_all(files, savers)
    except OutputError as error:
        faults += error.args
    for fault in faults[:_MAX_LINES]:
        print_error('review', fault)
    if not is_whole:
        return INTERRUPTED
    return NOT_WRITTEN if faults else max(row.exit_code for row in finished)


def _expectations(file: str) -> Expectations:
    expectations = expectations_from_file(file)
    if expectations.baseline:
        # Otherwise every row would fail for this reason.
        open_log(expectations.baseline).close()
    return expectations


def _judge(
    tasks: Sequence[Task], rows: dict[int, Row], options: argparse.Namespace
) -> tuple[bool, list[str]]:
    """Add the missing rows; return whether all are there, and the faults of pages."""
    missing = [number for number in range(len(tasks)) if number not in rows]
    faults: list[str] = []
    judged = judge_unordered(
        [tasks[number] for number in missing],
        engine=options.engine,
        jobs=options.jobs,
        time_limit=options.time_limit,
        address=options.ray_address,
    )
    with tqdm(
        judged,
        total=len(missing),
        unit='run',
        delay=1.0,
        leave=False,
        file=sys.stderr,
        disable=None,
    ) as bar:
        try:
            for number, judgement in bar:
                rows[missing[number]] = judgement.row
                faults += judgement.faults
        except KeyboardInterrupt:
            # Finished rows are written; a second Ctrl-C must not interrupt that.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            judged.close()
            print(
                f'review: interrupted after {counted(len(rows), "run")} of {len(tasks)}; '
                '--resume goes on with the table',
                file=sys.stderr,
            )
            return False, faults
    return True, faults


def _resumed(tasks: Sequence[Task], table: str) -> dict[int, Row]:
    """Return the valid rows of a table, by the numbers of their tasks."""
    if not Path(table).exists():
        return {}
    rows_of_runs = {row.run: row for row in rows_from_table(table) if row.verdict != UNREADABLE}
    rows = {}
    for number, task in enumerate(tasks):
        row = rows_of_runs.get(printable(task.run.path))
        if row is not None and _is_valid(row, task):
            rows[number] = row
    return rows


def _is_valid(row: Row, task: Task) -> bool:
    """Return whether run, settings and outputs are those of a row."""
    files = {'size': row.size, 'modified': row.modified}
    is_same = row.settings == task.settings and written(task.run) == files
    return is_same and all(Path(path).exists() for path in (task.page, task.annotated) if path)


def _pages(index: str | None, runs: Sequence[FoundRun]) -> list[str]:
    if not index:
        return [''] * len(runs)
    return _paths(Path(index).with_name(f'{Path(index).stem}_runs'), runs, '.html')


def _annotated(options: argparse.Namespace, runs: Sequence[FoundRun]) -> list[str]:
    """Return the path of each annotated copy; a resumed command goes on in its folder."""
    if not options.annotate:
        return [''] * len(runs)
    if not options.resume:
        check_new_folder('--annotate', options.annotate, [*options.logs])
    return _paths(Path(options.annotate), runs, '')


def _paths(folder: Path, runs: Sequence[FoundRun], suffix: str) -> list[str]:
    """Return a path in a folder for each run, '' for an unreadable one."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        reason = 'it is no folder' if folder.exists() else error.strerror
        raise OutputError(f'{printable(folder)} cannot be made: {reason}') from error
    digits = len(str(len(runs)))
    paths = []
    for number, run in enumerate(runs, 1):
        # A name that is safe for file systems and URLs.
        name = re.sub(r'[^A-Za-z0-9.-]+', '_', Path(run.path).name)[:80].strip('.') or 'run'
        file_name = f'{number:0{digits}}_{name}{suffix}'
        paths.append('' if run.fault else str(folder / file_name))
    return paths


def _report(rows: Sequence[Row], asked: int) -> str:
    verdicts = Counter(row.verdict for row in rows)
    counts = (
        f'{verdicts[OK]} ok, {verdicts[FINDINGS]} with findings, {verdicts[UNREADABLE]} unreadable'
    )
    lines = [f'{counted(len(rows), "run")} of {asked}: {counts}']
    faulty = [row for row in rows if row.reason]
    faulty.sort(key=lambda row: -row.exit_code)
    lines += [f'{row.verdict:<10}  {row.run}: {row.reason}' for row in faulty[:_MAX_LINES]]
    if len(faulty) > _MAX_LINES:
        lines.append(f'... and {len(faulty) - _MAX_LINES} more: --table has them all')
    return '\n'.join(lines)


def _parser() -> ArgumentParser:
    parser = ArgumentParser('review --each', DESCRIPTION)
    add = parser.add_argument
    add(OPTION, action='store_true', required=True, help=argparse.SUPPRESS)
    add('logs', metavar='LOG', nargs='+', type=path, help='a run, or a folder with runs in it')
    add('--expect', metavar='FILE', help='topics, allowed findings and a baseline, as YAML')
    add('--table', metavar='FILE', help='a row a run (.csv, .parquet)')
    add('--junit', metavar='FILE', help='a test case a run, as XML for CI')
    add('--html', metavar='FILE', help="an index page, which leads to each run's own")
    copies = 'a new folder: a copy of each run with its findings and right answers'
    add('--annotate', metavar='FOLDER', type=path, help=copies)
    add('--geometry', metavar='FILE', help='hold all runs against this leg, as for one run')
    add('--limits', metavar='FILE', help='other limits of the checks, as for one run')
    add('--engine', choices=ENGINES, default='local', help='who works on it (local)')
    add('--jobs', metavar='N', type=COUNT, help='how many at once (as many as there are CPUs)')
    add('--ray-address', metavar='ADDRESS', help='a Ray cluster (the variable RAY_ADDRESS)')
    add(
        '--time-limit',
        metavar='S',
        type=SECONDS,
        default=3600.0,
        help='a run that takes longer is given up [s] (3600)',
    )
    add('--resume', action='store_true', help='go on: what --table has is not reviewed again')
    return parser
