"""`review`: what happened in a run, and whether it can be trusted."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import os
from pathlib import Path
import sys
import tempfile

from klann_ros.cli import (
    ArgumentParser,
    check_new_folder,
    command_words,
    NOT_READ,
    output_files,
    path,
    save_all,
    UsageError,
)
from klann_ros.log import LOG_HELP
from klann_ros.log.errors import LogError
from klann_ros.review.live.follow import follow
from klann_ros.review.model.compare import compare
from klann_ros.review.model.limits import Limits, limits_from_file, NAMES
from klann_ros.robot import preset_names, robot_of, RobotFileError
from klann_ros.sanitize.text import printable
from klann_ros.web import open_browser
from tqdm import tqdm

from .fleet import command as each
from .page import save
from .report import text
from .report.annotations import annotate
from .report.data import save_csv, save_json
from .reviewing import Progress, review_run

# Delay of the progress bar [s].
_PROGRESS_DELAY = 1.0


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a progress bar on stderr, if that is a terminal; yield the function that moves it."""
    form = '{desc}: {percentage:3.0f} %|{bar}| {remaining}'
    options = {'bar_format': form, 'delay': _PROGRESS_DELAY, 'leave': False, 'disable': None}
    with tqdm(total=1.0, file=sys.stderr, **options) as bar:

        def report(step: str, part: float) -> None:
            if part < bar.n:
                bar.reset()
            bar.set_description_str(step, refresh=False)
            bar.update(part - bar.n)

        yield report


REVIEW_ERRORS = dict.fromkeys((LogError, OSError, RobotFileError), NOT_READ)
DESCRIPTION = """\
Review a run: the motion of the leg, lost messages, and whether every pose is right.

Every pose is solved again from its crank angle, by the geometry in the run: a solver's parameters,
or else leg_description or robot_description.
With LOG2, the differences of the two runs are reported as well.
Exit code: 0 nothing found, 1 findings (or a difference), 2 not a readable log, 3 a FILE, which is
checked at the start, or the report itself cannot be written.

With --follow, findings are printed during the recording; the report follows when it is closed, or
at Ctrl-C.

Many runs, a row a run: review --each LOG...; see review --each --help."""
EPILOG = f"""\
FILE of --limits is YAML, a line a limit: {', '.join(NAMES)}."""


def main(argv: Sequence[str] | None = None) -> int:
    """Review a run, or many; return the exit code."""
    words = command_words() if argv is None else list(argv)
    if each.OPTION in words[: words.index('--') if '--' in words else None]:
        return each.main(words)
    return _parser().run(_review, REVIEW_ERRORS, words)


def _review(options: argparse.Namespace) -> int:
    if options.log2 and (options.follow or options.annotate):
        raise UsageError(f'{"--follow" if options.follow else "--annotate"} takes one run')
    if options.open and not options.html:
        # It stays: the browser may read it after this process.
        folder = tempfile.mkdtemp(prefix='klann_ros-review-')
        options.html = str(Path(folder, f'{Path(options.log).name or "run"}.html'))
    inputs = options.log, options.log2, options.geometry, options.limits
    files = output_files(options, ('json', 'html', 'csv'), inputs)
    if options.annotate:
        check_new_folder('--annotate', options.annotate, inputs)
    robot = robot_of(options.geometry) if options.geometry is not None else None
    limits = limits_from_file(options.limits) if options.limits is not None else Limits()
    if options.follow:
        _follow(options.log, limits)
    # A chart shows seven digits.
    rates = 'f8' if options.csv else 'f4' if options.html else ''
    reviews = []
    for log in filter(None, (options.log, options.log2)):
        with progress() as report:
            review = review_run(
                log,
                robot=robot,
                limits=limits,
                rates=rates,
                keep_solved=bool(options.annotate),
                progress=report,
            )
        reviews.append(review)
    comparison = compare(*reviews) if len(reviews) == 2 else None
    colour = _wants_colour()
    print(
        '\n\n'.join(
            text.report(review, colour=colour, details=options.details) for review in reviews
        )
    )
    if comparison is not None:
        print(f'\n{text.differences(comparison, colour=colour)}')
    if options.annotate:
        annotate(reviews[0], options.annotate)
        _print_state(f'the annotated run is the folder {printable(options.annotate)}')
    save_all(
        files,
        {
            '--json': partial(save_json, reviews[0], comparison),
            '--html': partial(save, reviews, comparison),
            '--csv': partial(save_csv, reviews[0]),
        },
    )
    if options.open and not open_browser((page := Path(options.html).absolute()).as_uri()):
        _print_state(f'no browser here; the page is {printable(page)}')
    healthy = all(review.is_healthy for review in reviews)
    return 0 if healthy and not (comparison and comparison.differences) else 1


def _follow(path: str, limits: Limits) -> None:
    try:
        # Past the buffer of the report.
        print_finding = partial(print, file=sys.__stdout__ or sys.stdout, flush=True)
        follow(path, limits, on_finding=print_finding, on_status=_print_state)
    # A closed pipe (`| head -1`) ends it, too.
    except (KeyboardInterrupt, BrokenPipeError):
        _print_state('stopped following; the report of the run so far')


def _print_state(text: str) -> None:
    print(f'review: {text}', file=sys.stderr, flush=True)


def _wants_colour() -> bool:
    """Return whether stdout is a terminal with colours (https://no-color.org)."""
    # sys.stdout may be a buffer.
    out = sys.__stdout__
    has_colours = sys.platform != 'win32' or 'WT_SESSION' in os.environ  # Windows Terminal
    return out is not None and out.isatty() and has_colours and not os.environ.get('NO_COLOR')


def _parser() -> ArgumentParser:
    parser = ArgumentParser('review', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('log', metavar='LOG', type=path, help=LOG_HELP)
    add('log2', metavar='LOG2', nargs='?', type=path, help='another run to compare it with')
    following = 'LOG is being recorded, or will be: print findings immediately, then review it'
    add('--follow', action='store_true', help=following)
    exact = 'also print how exact the poses are: residuals, errors, 99 %% of the delays'
    add('--details', action='store_true', help=exact)
    add('--json', metavar='FILE', help='the report for machines')
    add('--html', metavar='FILE', help='the page: the leg animated, and charts')
    add('--open', action='store_true', help='open the page in a browser')
    add('--csv', metavar='FILE', help='a row a pose, for spreadsheets and pandas')
    sources = 'a parameter file, a file of lengths, a linkage'
    annotated = (
        'a copy of the run, a new folder, with the findings and the right answers beside it'
    )
    add('--annotate', metavar='OUT', type=path, help=annotated)
    geometry = f'hold the run against this leg: {sources}, or one of {", ".join(preset_names())}'
    add('--geometry', metavar='FILE', help=geometry)
    add('--limits', metavar='FILE', help='other limits of the checks')
    return parser
