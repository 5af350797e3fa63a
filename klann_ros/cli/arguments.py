"""
The command line of every executable: help, version, completion, and refusals in one line.

A refusal shows an argument, and runs nothing of it: the argument may be a file name of `review *`.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
import errno
from importlib import import_module
from importlib.util import find_spec
from math import nan
import os
import re
import sys
import textwrap
from typing import Any, NoReturn

from klann_ros import __version__
from klann_ros.sanitize.quantity import read_quantity
from klann_ros.sanitize.text import printable, printable_line

NOT_READ, NOT_WRITTEN = 2, 3
"""Exit codes: an input is refused; an output cannot be written."""


def path(text: str) -> str:
    """Return a path from the command line; an empty or too long one is an ArgumentTypeError."""
    if not text:
        raise argparse.ArgumentTypeError('it is empty; is a variable not set?')
    try:
        os.lstat(text)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise argparse.ArgumentTypeError(f'{error.strerror}: {printable(text)}') from None
    except ValueError:
        # A null byte is refused where the file is opened.
        pass
    return text


def number_type(
    allows: Callable[[float], bool],
    allowed: str,
    kind: Callable[[str], float] = float,
    unit: str = '1',
) -> Callable[[str], Any]:
    """
    Return the type of an option for a number; another text is an ArgumentTypeError.

    The number may have a unit, such as 60rpm, which is converted into the option's.
    """

    def parse(text: str) -> float:
        try:
            number = kind(text)
        except ValueError:
            # Without a unit it is none, as 1,000; NaN fails every comparison.
            quantity = read_quantity(text, unit) if text[-1:].isalpha() else None
            number = nan if quantity is None else quantity
        if not allows(number):
            raise argparse.ArgumentTypeError(f'{printable(text)} is refused: it must be {allowed}')
        return number

    return parse


COUNT = number_type(lambda n: 1 <= n < 2**53, 'a whole number, 1 or more', int)
SECONDS = number_type(lambda s: 0.0 < s < 1e9, 'a number of seconds > 0 (and < 1e9)', unit='s')


class UsageError(Exception):
    """Arguments that contradict each other; the text says which."""


class OutputError(Exception):
    """Outputs that cannot be written; each argument names one and the reason."""


def print_error(program: str, error: object) -> None:
    """Print an error of a program in one line."""
    print(f'{program}: {printable_line(error)}', file=sys.stderr)


def check_installed(*packages: str) -> None:
    """Raise a ModuleNotFoundError for a package that is missing, before anything is made."""
    for package in packages:
        if find_spec(package) is None:
            raise ModuleNotFoundError(f'there is no {package}', name=package)


def command_words() -> list[str]:
    """Return the arguments of this process, or those that a shell wants to have completed."""
    return os.environ.get('COMP_LINE', '').split()[1:] or sys.argv[1:]


class _HelpFormatter(argparse.HelpFormatter):
    """Keep the lines of a description as they are, but fold those wider than the terminal."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        folded = []
        for line in text.splitlines():
            margin = line[: len(line) - len(line.lstrip())]
            folded_line = textwrap.fill(
                line,
                width,
                initial_indent=indent,
                subsequent_indent=f'{indent}{margin}  ' if margin else indent,
                break_long_words=False,
                break_on_hyphens=False,
            )
            folded.append(folded_line)
        return '\n'.join(folded)


class ArgumentParser(argparse.ArgumentParser):
    """
    A parser with `--version` and completion by argcomplete, whose refusals are one line.

    Line breaks of description and epilog are kept.
    """

    _is_completed = False

    def __init__(self, prog: str, description: str, epilog: str = '') -> None:
        super().__init__(
            prog=prog, description=description, epilog=epilog, formatter_class=_HelpFormatter
        )
        # A negative number may have a unit.
        self._negative_number_matcher = re.compile(r'-\.?\d')
        self.add_argument('--version', action='version', version=f'%(prog)s {__version__}')

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        """Parse as argparse does; answer the shell instead if it asks for completions."""
        # It parses the typed words by this very function.
        if '_ARGCOMPLETE' in os.environ and not self._is_completed:
            self._is_completed = True
            # For a shell that completes, which has it, and for nothing else.
            with suppress(ModuleNotFoundError):
                import_module('argcomplete').autocomplete(self)
        return super().parse_known_args(*args, **kwargs)

    def run(
        self,
        command: Callable[[argparse.Namespace], int],
        errors: Mapping[Any, int],
        argv: Sequence[str] | None = None,
    ) -> int:
        """
        Run a command with the parsed arguments; return its exit code.

        `errors` are printed in one line; their exit codes are by type, the first match counts. An
        OutputError is one of them, a UsageError ends as a refused argument. Without sufficient
        memory nothing was read.
        """
        options = self.parse_args(argv)
        codes: dict[Any, int] = {OutputError: NOT_WRITTEN, **errors}
        try:
            return command(options)
        except UsageError as error:
            self.error(str(error))
        except tuple(codes) as error:
            for line in error.args if isinstance(error, OutputError) else [error]:
                print_error(self.prog, line)
            return next(code for kind, code in codes.items() if isinstance(error, kind))
        except MemoryError:
            print_error(self.prog, 'the memory is not sufficient')
            return NOT_READ

    def error(self, message: str) -> NoReturn:
        """Print the usage and a line with the error, and end with exit code 2."""
        super().error(printable_line(message))
