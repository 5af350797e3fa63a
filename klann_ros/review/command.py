"""`review`: what happened in a run, and whether it can be trusted."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import os
from pathlib import Path
import sys
import tempfile

from klann_ros.log.errors import LogError
from klann_ros.log.read.run_files import LOG_HELP
from klann_ros.review.live.follow import follow
from klann_ros.review.model.compare import compare
from klann_ros.review.model.limits import Limits, limits_from_file, NAMES
from klann_ros.review.model.review import Review
from klann_ros.review.page import page
from klann_ros.review.report.picture import picture_format, save_picture
from klann_ros.robot import Robot, robot_of, RobotFileError
from klann_ros.robot.file import preset_names
from klann_ros.sanitize.arguments import (
    ArgumentParser,
    command_words,
    NOT_READ,
    path,
    UsageError,
)
from klann_ros.sanitize.outputs import outputs, save_all
from klann_ros.sanitize.text import printable
from klann_ros.web.browser import is_opened
from tqdm import tqdm

from .fleet import command as each
from .report import json_report, pose_table, text
from .reviewing import Progress, review_run

# Delay of the progress bar [s].
_PROGRESS_DELAY = 1.0


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a progress bar on stderr, if that is a terminal; yield the function that moves it."""
    form = '{desc}: {percentage:3.0f} %|{bar}| {remaining}'
    with tqdm(
        total=1.0,
        bar_format=form,
        delay=_PROGRESS_DELAY,
        leave=False,
        file=sys.stderr,
        disable=None,
    ) as bar:

        def report(what: str, part: float) -> None:
            if part < bar.n:
                bar.reset()
            bar.set_description_str(what, refresh=False)
            bar.update(part - bar.n)

        yield report


ERROR_CODES = dict.fromkeys((LogError, OSError, RobotFileError), NOT_READ)
DESCRIPTION = """\
Review a run: how the leg moved, what was lost, and whether every pose is right.

Every pose is solved again from its crank angle, by the geometry that the run tells: a solver's
parameters, or robot_description.
With LOG2, say in what the two runs differ as well.
Exit code: 0 nothing found, 1 findings (or a difference), 2 not a readable log, 3 what was asked
for cannot be written: a FILE, which is found out at the start, or the report itself.

With --follow, tell what is found while the run is recorded; the report follows when it is closed,
or at Ctrl-C.

Many runs, a row a run: review --each LOG...; review --each --help tells how."""
EPILOG = f"""\
FILE of --limits is YAML, a line a limit: {', '.join(NAMES)}."""


def main(argv: Sequence[str] | None = None) -> int:
    """Review a run, or many; return the exit code."""
    given = command_words() if argv is None else list(argv)
    if each.OPTION in given[: given.index('--') if '--' in given else None]:
        return each.main(given)
    return _parser().run(_review, ERROR_CODES, given)


def _review(options: argparse.Namespace) -> int:
    if options.follow and options.log2:
        raise UsageError('--follow takes one run')
    if options.open and not options.html:
        options.html = _temporary_page(options.log)
    inputs = options.log, options.log2, options.geometry, options.limits
    files = outputs(options, ('json', 'html', 'csv', 'picture'), inputs)
    form = picture_format(options.picture) if options.picture else ''
    robot = robot_of(options.geometry) if options.geometry is not None else None
    limits = limits_from_file(options.limits) if options.limits is not None else Limits()
    if options.follow:
        _follow(options.log, limits)
    reviews = [
        _review_one(path, options, robot, limits) for path in (options.log, options.log2) if path
    ]
    comparison = compare(*reviews) if len(reviews) == 2 else None
    colour = _wants_colour()
    print('\n\n'.join(text.report(review, colour=colour) for review in reviews))
    if comparison is not None:
        print(f'\n{text.differences(comparison, colour=colour)}')
    save_all(
        files,
        {
            '--json': partial(json_report.save, reviews[0], comparison),
            '--html': partial(page.save, reviews, comparison),
            '--csv': partial(pose_table.save_csv, reviews[0]),
            '--picture': partial(save_picture, reviews[0], form),
        },
    )
    if options.open:
        _open(options.html)
    healthy = all(review.is_healthy for review in reviews)
    return 0 if healthy and not (comparison and comparison.differences) else 1


def _follow(path: str, limits: Limits) -> None:
    """Print findings of a run during the recording, until its end or Ctrl-C."""
    try:
        follow(
            path,
            limits,
            found=_print_now,
            said=lambda text: print(f'review: {text}', file=sys.stderr, flush=True),
        )
    # A closed pipe (`| head -1`) ends it, too.
    except (KeyboardInterrupt, BrokenPipeError):
        print(
            'review: stopped following; the report of the run so far', file=sys.stderr, flush=True
        )


def _print_now(line: str) -> None:
    """Print a line immediately, past the buffer of the report."""
    out = sys.__stdout__ or sys.stdout
    print(line, file=out, flush=True)


def _review_one(
    path: str,
    options: argparse.Namespace,
    robot: Robot | None,
    limits: Limits,
) -> Review:
    # A chart shows seven digits.
    rates = 'f8' if options.csv else 'f4' if options.html else ''
    with progress() as report:
        return review_run(path, robot=robot, limits=limits, rates=rates, progress=report)


def _temporary_page(log: str) -> str:
    """Return a temporary path for the page."""
    # It stays: the browser may read it after this process.
    folder = tempfile.mkdtemp(prefix='klann_ros-review-')
    return str(Path(folder, f'{Path(log).name or "run"}.html'))


def _open(html: str) -> None:
    place = Path(html).absolute()
    if not is_opened(place.as_uri()):
        print(f'review: no browser here; the page is {printable(place)}', file=sys.stderr)


def _wants_colour() -> bool:
    """Return whether stdout is a terminal with colours (https://no-color.org)."""
    # sys.stdout may be a buffer.
    out = sys.__stdout__
    return out is not None and out.isatty() and not os.environ.get('NO_COLOR')


def _parser() -> ArgumentParser:
    parser = ArgumentParser('review', DESCRIPTION, EPILOG)
    parser.add_argument('log', metavar='LOG', type=path, help=LOG_HELP)
    parser.add_argument(
        'log2', metavar='LOG2', nargs='?', type=path, help='another run to compare it with'
    )
    parser.add_argument(
        '--follow',
        action='store_true',
        help='LOG is being recorded, or will be: tell findings as they come, then review it',
    )
    parser.add_argument('--json', metavar='FILE', help='the report for machines')
    parser.add_argument('--html', metavar='FILE', help='the page: the leg animated, and charts')
    parser.add_argument('--open', action='store_true', help='open the page in a browser')
    parser.add_argument('--csv', metavar='FILE', help='a row a pose, for spreadsheets and pandas')
    parser.add_argument(
        '--geometry',
        metavar='FILE',
        help=(
            'hold the run against this leg: a parameter file, a file of lengths, a linkage, or '
            f'one of {", ".join(preset_names())}'
        ),
    )
    parser.add_argument('--limits', metavar='FILE', help='other limits of the checks')
    parser.add_argument(
        '--picture', metavar='FILE', help='draw the leg and the path of its foot (.png, .svg)'
    )
    return parser
