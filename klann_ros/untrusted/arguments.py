"""Command lines whose complaints show what was given, and do nothing: it may be `review *`."""

import argparse
from typing import NoReturn

from .text import printable_line


class ArgumentParser(argparse.ArgumentParser):
    """A parser that refuses arguments of any letters in one line below its usage."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end the process with exit code 2."""
        super().error(printable_line(message))
