"""`review`: what happened in a run, and whether it can be trusted."""

import argparse
from collections.abc import Sequence
import sys

from klann_ros import __version__
from klann_ros.log.errors import LogError
from klann_ros.log.reader import open_log

from .checks import findings
from .figures import leg_figures, resolve
from .leg_file import leg_from_file
from .loading import load
from .picture import NoPictureError, save_picture
from .recording import Recording
from .text import report

DESCRIPTION = """\
Review a run: how the leg moved, what was lost, and whether every pose is right.

Every pose is solved again from its crank angle, by the geometry that the run tells.
Exit code: 0 nothing found, 1 findings, 2 not a readable log."""


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
    with open_log(options.log) as log:
        recording = load(log, given)
    judged, resolved = recording.judged(), None
    if recording.leg is not None and len(judged.poses):
        resolved = resolve(judged, recording.leg)
    found = findings(recording, resolved)
    print(report(recording, leg_figures(recording, resolved), found))
    if options.picture:
        _picture(recording, options.picture)
    return 1 if found else 0


def _picture(recording: Recording, path: str) -> None:
    if recording.leg is None:
        raise NoPictureError('a picture needs a geometry, and the run tells none: --geometry FILE')
    save_picture(recording, recording.leg, path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='review',
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    parser.add_argument('log', metavar='LOG', help='a run folder or an .mcap file')
    parser.add_argument(
        '--geometry',
        metavar='FILE',
        help='hold the run against this leg: a parameter file, a file of lengths, or a linkage',
    )
    parser.add_argument(
        '--picture', metavar='FILE', help='draw the leg and the path of its foot (.png, .svg)'
    )
    return parser
