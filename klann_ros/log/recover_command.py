"""The command ``recover``: a readable run out of a damaged one."""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import sys

from klann_ros.cli import ArgumentParser, path, print_error
from klann_ros.sanitize.text import counted, MAX_LINE_LENGTH, printable, printable_line

from .errors import LogError, NotALogError
from .read.run_files import LOG_HELP, run_name
from .recovery import recover, Recovery

NOTHING_LOST = 0
NOT_WRITTEN = 1
NOTHING_READ = 2
SOMETHING_LOST = 3
INTERRUPTED = 130
RECOVER_ERRORS = {NotALogError: NOTHING_READ, LogError: NOT_WRITTEN, OSError: NOT_WRITTEN}

_EPILOG = """
exit code: 0 nothing was discarded (a run that was only not closed included), 3 something was,
2 nothing could be read, 1 the new run could not be written. LOG is never changed.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with these arguments, or those of the process; return its exit code."""
    try:
        return _parser().run(_recover_and_report, RECOVER_ERRORS, argv)
    except KeyboardInterrupt:
        print_error('recover', 'interrupted, nothing was written')
        return INTERRUPTED


def _recover_and_report(options: argparse.Namespace) -> int:
    output = options.output or default_output(Path(options.log))
    recovery = recover(options.log, output)
    _print_report(recovery, output)
    return SOMETHING_LOST if recovery.lost else NOTHING_LOST


def default_output(log: Path) -> Path:
    """Return where a log is recovered to: beside it, with ``_recovered`` behind its name."""
    # A path that goes in a circle is no log, which is said later.
    place = Path(os.path.realpath(log))
    name = place.name if place.is_dir() else run_name(place)
    return place.with_name(f'{name}_recovered')


def _parser() -> ArgumentParser:
    parser = ArgumentParser('recover', 'Make a readable run out of a damaged one.', _EPILOG)
    parser.add_argument('log', metavar='LOG', type=path, help=LOG_HELP)
    parser.add_argument(
        '-o',
        '--output',
        metavar='OUT',
        type=Path,
        help='the folder of the new run, which must not exist (default: LOG_recovered)',
    )
    return parser


def _print_report(recovery: Recovery, output: Path) -> None:
    for note in recovery.remarks:
        print(f'note: {printable_line(note)}')
    for loss in recovery.lost:
        print(f'lost: {printable_line(loss)}')
    for topic, count in sorted(recovery.counts.items()):
        print(f'kept: {counted(count, "message")} of {printable(topic)}')
    totals = [
        f'{counted(recovery.messages, "message")} in all',
        counted(recovery.attachments, 'attachment'),
        counted(recovery.metadata, 'metadata record'),
    ]
    print(f'kept: {", ".join(totals)}')
    print(f'written: {printable(output, MAX_LINE_LENGTH)}')


if __name__ == '__main__':
    sys.exit(main())
