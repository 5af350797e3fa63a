"""
Ctrl-C, SIGTERM and SIGHUP, answered at chosen places only.

A KeyboardInterrupt can fall between the start of a process and the line that remembers it. Here a
signal is noted, and whoever waits asks for it, so that every child is known when it has to end.
"""

import signal
import time
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_received: list[int] = []


class StoppedError(Exception):
    """Somebody asked this command to end."""

    def __init__(self, number: int) -> None:
        super().__init__(f'stopped by {signal.Signals(number).name}')
        self.exit_code = 128 + number


def listen() -> None:
    """Note the signals from now on, in place of dying of them."""
    for number in SIGNALS:
        # nohup asks for a command that outlives its terminal.
        if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
            continue
        signal.signal(number, _note)


def check() -> None:
    """Raise StoppedError if a signal has come."""
    if _received:
        raise StoppedError(_received[0])


def pause(seconds: float = 0.05) -> None:
    """Sleep for a moment, then check."""
    time.sleep(seconds)
    check()


def _note(number: int, _frame: FrameType | None) -> None:
    _received.append(number)
