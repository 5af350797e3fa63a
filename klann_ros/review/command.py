"""`review`: what happened in a run, and whether it can be trusted."""

import argparse
from collections.abc import Sequence
import os
import sys

from klann_ros import __version__
from klann_ros.kinematics.leg_types import Leg
from klann_ros.log.errors import LogError

from .comparing import compare, Comparison
from .leg_file import leg_from_file
from .limits import Limits, limits_from_file, NAMES
from .picture import NoPictureError, save_picture
from .progress import progress
from .report import csv_file, json_report, text
from .report.html_page import page
from .reviewed import Review
from .reviewing import review_run

DESCRIPTION = """\
Review a run: how the leg moved, what was lost, and whether every pose is right.

Every pose is solved again from its crank angle, by the geometry that the run tells.
With LOG2, say in what the two runs differ as well.
Exit code: 0 nothing found, 1 findings (or a difference), 2 not a readable log."""
EPILOG = f"""\
FILE of --limits is YAML, a line a limit: {', '.join(NAMES)}."""


def main(argv: Sequence[str] | None = None) -> int:
    """Review a run; return the exit code."""
    options = _parser().parse_args(argv)
    try:
        return _review(options)
    except (LogError, NoPictureError, OSError) as error:
        print(f'review: {error}', file=sys.stderr)
        return 2


def _review(options: argparse.Namespace) -> int:
    given = leg_from_file(options.geometry) if options.geometry else None
    limits = limits_from_file(options.limits) if options.limits else Limits()
    reviews = [_one(path, options, given, limits) for path in (options.log, options.log2) if path]
    comparison = compare(*reviews) if len(reviews) == 2 else None
    colour = _wants_colour()
    print('\n\n'.join(text.report(review, colour=colour) for review in reviews))
    if comparison is not None:
        print(f'\n{text.differences(comparison, colour=colour)}')
    _save(options, reviews, comparison)
    healthy = all(review.is_healthy for review in reviews)
    return 0 if healthy and not (comparison and comparison.differences) else 1


def _one(path: str, options: argparse.Namespace, given: Leg | None, limits: Limits) -> Review:
    # A chart shows seven digits.
    rates = 'f8' if options.csv else 'f4' if options.html else ''
    with progress() as tell:
        return review_run(path, given=given, limits=limits, rates=rates, progress=tell)


def _save(
    options: argparse.Namespace, reviews: Sequence[Review], comparison: Comparison | None
) -> None:
    first = reviews[0]
    if options.json:
        json_report.save(first, comparison, options.json)
    if options.html:
        page.save(reviews, comparison, options.html)
    if options.csv:
        csv_file.save(first, options.csv)
    if options.picture:
        save_picture(first, options.picture)


def _wants_colour() -> bool:
    """Return whether the report goes to a terminal that shows colours (https://no-color.org)."""
    # The report may be caught on its way, to be written when the exit code is known.
    out = sys.__stdout__
    return out is not None and out.isatty() and not os.environ.get('NO_COLOR')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='review',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    parser.add_argument('log', metavar='LOG', help='a run folder or an .mcap file')
    parser.add_argument('log2', metavar='LOG2', nargs='?', help='another run to compare it with')
    parser.add_argument('--json', metavar='FILE', help='the report for machines')
    parser.add_argument('--html', metavar='FILE', help='the page: the leg animated, and charts')
    parser.add_argument('--csv', metavar='FILE', help='a row a pose, for spreadsheets and pandas')
    parser.add_argument(
        '--geometry',
        metavar='FILE',
        help='hold the run against this leg: a parameter file, a file of lengths, or a linkage',
    )
    parser.add_argument('--limits', metavar='FILE', help='other limits of the checks')
    parser.add_argument(
        '--picture', metavar='FILE', help='draw the leg and the path of its foot (.png, .svg)'
    )
    return parser
