"""Command lines whose complaints show what was given, and do nothing: it may be `review *`."""

import argparse
from typing import NoReturn

from .text import printable_line


def path(text: str) -> str:
    """
    Return a path that was given; an empty one is a variable that is not set, not this folder.

    Raises
    ------
    argparse.ArgumentTypeError
        It is empty.

    """
    if not text:
        raise argparse.ArgumentTypeError('it is empty; is a variable not set?')
    return text


class ArgumentParser(argparse.ArgumentParser):
    """A parser that refuses arguments of any letters in one line below its usage."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end the process with exit code 2."""
        super().error(printable_line(message))
