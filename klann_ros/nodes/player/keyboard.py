"""Keys of the terminal that a process was started on, while it is in the foreground there."""

import atexit
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os
from select import select
import signal
import sys
import termios
from threading import Lock, Thread
from typing import Any

ESCAPE = 0x1B
KEYS = {
    b' ': 'space',
    # Terminals send the first, or in their application mode the second.
    **dict.fromkeys((b'\x1b[A', b'\x1bOA'), 'up'),
    **dict.fromkeys((b'\x1b[B', b'\x1bOB'), 'down'),
    **dict.fromkeys((b'\x1b[C', b'\x1bOC'), 'right'),
}
# No sequence that a terminal sends is longer.
LONGEST = 32
# How often it is looked whether the process is in the foreground, and how long a part of a key's
# sequence waits for the rest [s].
PERIOD = 0.5
# Of the list that termios has of a terminal's attributes.
LOCAL_MODES, CHARACTERS = 3, 6
COOKED = termios.ICANON | termios.ECHO


class KeyParser:
    """Make names of keys out of what a terminal sends, in whatever pieces it comes."""

    def __init__(self) -> None:
        self._begun = b''

    def feed(self, data: bytes) -> list[str]:
        """Return the keys that are complete; what is no key of ours is left out whole."""
        keys = []
        for byte in data:
            # An escape begins anew, whatever came before.
            self._begun = bytes([byte]) if byte == ESCAPE else self._begun + bytes([byte])
            if not self._is_incomplete():
                keys += [KEYS[self._begun]] if self._begun in KEYS else []
                self._begun = b''
        return keys

    def forget(self) -> None:
        """Take what has begun for the key Escape, of which nothing more comes."""
        self._begun = b''

    def _is_incomplete(self) -> bool:
        """Return whether it is the beginning of a sequence: ESC O or ESC [, and its parameters."""
        if self._begun in (b'\x1b', b'\x1bO', b'\x1b['):
            return True
        is_long = self._begun.startswith(b'\x1b[') and len(self._begun) < LONGEST
        return is_long and 0x20 <= self._begun[-1] < 0x40


class Keyboard:
    """
    Read keys one by one, without echo, and leave the terminal as it was.

    Only a terminal in whose foreground the process is, is read and changed: a job in the
    background would be stopped for it (SIGTTIN), and a pipe, a file or nothing is not for us.
    Ctrl-C and Ctrl-Z remain what they are. What a process's end and its suspension leave behind
    is up to `close` and `released`; after kill -9 the shell has to see to it, or `stty sane`.
    """

    def __init__(self) -> None:
        self._terminal = 0
        self._lock = Lock()
        self._closed = False
        # The attributes to give back; None while the terminal is as it was.
        self._saved: list[Any] | None = None

    def start(self, on_key: Callable[[str], object], on_begin: Callable[[], object]) -> None:
        """
        Read keys in a thread of its own, if there is a terminal.

        Parameters
        ----------
        on_key
            Is given the name of each key, one of those in KEYS.
        on_begin
            Is called when keys are read for the first time.

        """
        # Without a standard input the number may be that of another file.
        if sys.stdin is not None and os.isatty(self._terminal):
            atexit.register(self.close)
            arguments = (on_key, on_begin)
            Thread(target=self._read, args=arguments, name='keyboard', daemon=True).start()

    def close(self) -> None:
        """Give the terminal back, and read no more."""
        with self._lock:
            self._closed = True
            self._release()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Give the terminal back until the context ends."""
        with self._lock:
            self._release()
            yield

    def _read(self, on_key: Callable[[str], object], on_begin: Callable[[], object]) -> None:
        # To read in the background is then an error, and does not stop the process.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTIN})
        parser = KeyParser()
        has_begun = False
        while True:
            with self._lock:
                if self._closed:
                    return
                is_ours, data = self._poll()
                if is_ours and not has_begun:
                    has_begun = True
                    on_begin()
                for key in parser.feed(data):
                    on_key(key)
            ready, *_ = select([self._terminal] if is_ours else [], [], [], PERIOD)
            if not ready:
                parser.forget()

    def _poll(self) -> tuple[bool, bytes]:
        """Return whether the terminal is ours, and what was typed on it."""
        # It may be gone, or another's by now: then it is looked at again later.
        with suppress(OSError, termios.error):
            if self._is_in_foreground():
                self._take()
                return True, os.read(self._terminal, 1024)
        return False, b''

    def _is_in_foreground(self) -> bool:
        return os.tcgetpgrp(self._terminal) == os.getpgrp()

    def _take(self) -> None:
        """Have keys come one by one; also again, after a shell has set its own attributes."""
        attributes = termios.tcgetattr(self._terminal)
        if self._saved is not None and not attributes[LOCAL_MODES] & COOKED:
            return
        self._saved = attributes
        changed = [*attributes]
        changed[LOCAL_MODES] &= ~COOKED
        changed[CHARACTERS] = [*attributes[CHARACTERS]]
        # To read returns at once, with what there is.
        changed[CHARACTERS][termios.VMIN] = changed[CHARACTERS][termios.VTIME] = 0
        termios.tcsetattr(self._terminal, termios.TCSANOW, changed)

    def _release(self) -> None:
        saved, self._saved = self._saved, None
        # In the background it is another's, who has set what he needs.
        with suppress(OSError, termios.error):
            if saved is not None and self._is_in_foreground():
                termios.tcsetattr(self._terminal, termios.TCSANOW, saved)
