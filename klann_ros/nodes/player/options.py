"""The command line of `player_node`."""

import argparse
from collections.abc import Callable, Sequence
from math import inf, nan

from klann_ros.log.playing.timeline import RATES
from klann_ros.log.reading.run_files import LOG_HELP
from klann_ros.nodes.process import arguments, command_line
from klann_ros.untrusted.arguments import path

DESCRIPTION = """\
Play a run back onto its topics: the recorded bytes, with the recorded quality of service.
Play under a namespace or remap, so that a replay does not meet the live topics:
  player_node runs/x --ros-args -r __ns:=/replay"""
EPILOG = """\
While it plays:
  services ~/pause, ~/resume, and ~/step, which plays exactly the next message of a paused log
  parameter rate: 2 is twice as fast; parameter position: set it to go there [s]
  keys, in the foreground of a terminal, as ros2 bag play has them:
    space           pause and resume
    right arrow     play exactly the next message of a paused log
    up, down arrow  10 % faster, slower
Latched topics offer at each start what they offered there in the log. A loop, or going back, is a
jump back in time: give --clock to let nodes with use_sim_time follow."""
CLOCK_RATES = (1e-3, 1e4)


def options_of(argv: Sequence[str]) -> argparse.Namespace:
    """Return the options; their names of topics are full names."""
    options = arguments(_parser(), argv)
    if options.topics is not None:
        options.topics = {_full(name) for name in options.topics}
    options.remap = dict(options.remap)
    return options


def _parser() -> argparse.ArgumentParser:
    parser = command_line('player_node', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('log', metavar='LOG', type=path, help=LOG_HELP)
    add('--rate', type=_within(*RATES), default=1.0, metavar='R', help='2 is twice as fast')
    add('--loop', action='store_true', help='play again and again')
    add('--start-offset', type=_not_negative, default=0.0, metavar='S', help='leave out S seconds')
    add('--duration', type=_positive, default=inf, metavar='S', help='play S seconds of the log')
    add(
        '--delay',
        type=_not_negative,
        default=0.5,
        metavar='S',
        help='wait S seconds first, so that subscribers find the publishers (default: 0.5)',
    )
    add('--topics', nargs='+', metavar='T', help='play these topics only')
    add(
        '--remap',
        nargs='+',
        type=_renaming,
        default=[],
        metavar='OLD:=NEW',
        help='publish OLD as NEW',
    )
    add(
        '--clock',
        type=_within(*CLOCK_RATES),
        metavar='HZ',
        help="publish the log's time on /clock, so often a second; a recorded /clock is left out",
    )
    add('--start-paused', action='store_true', help='wait for ~/resume, ~/step or a key')
    add('--disable-keyboard-controls', action='store_true', help='leave the terminal alone')
    return parser


def _positive(text: str) -> float:
    return _checked(text, lambda number: 0.0 < number <= inf, 'a number > 0')


def _not_negative(text: str) -> float:
    return _checked(text, lambda number: 0.0 <= number < inf, 'a number >= 0')


def _within(least: float, most: float) -> Callable[[str], float]:
    def number(text: str) -> float:
        return _checked(text, lambda n: least <= n <= most, f'within {least:g} .. {most:g}')

    return number


def _checked(text: str, allows: Callable[[float], bool], what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = nan  # which fails every comparison
    if not allows(number):
        raise argparse.ArgumentTypeError(f'{text} is refused: it must be {what}')
    return number


def _renaming(text: str) -> tuple[str, str]:
    old, given, new = text.partition(':=')
    if not (old and given and new):
        raise argparse.ArgumentTypeError(f'{text} is refused: write OLD:=NEW')
    return _full(old), _full(new)


def _full(name: str) -> str:
    return name if name.startswith('/') else f'/{name}'
