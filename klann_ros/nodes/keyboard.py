"""Keys of a process's terminal, while the process is in the foreground."""

import atexit
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os
import re
from select import select
import signal
import sys
import termios
from threading import Lock, Thread
from typing import Any

_KEY_NAMES = {
    b' ': 'space',
    # Terminals send the first, or in their application mode the second.
    **dict.fromkeys((b'\x1b[A', b'\x1bOA'), 'up'),
    **dict.fromkeys((b'\x1b[B', b'\x1bOB'), 'down'),
    **dict.fromkeys((b'\x1b[C', b'\x1bOC'), 'right'),
}
# A key's bytes: one, or an escape sequence, of at most MAX_SEQUENCE_LENGTH.
MAX_SEQUENCE_LENGTH = 32
_KEY = re.compile(
    rb'[^\x1b]|\x1b[^\x1b\[O]|\x1bO[^\x1b]|\x1b\[(?:[ -?]{30}|[ -?]{,29}[^\x1b -?])'
    # An escape always begins a sequence.
    rb'|\x1b[^\x1b]*(?=\x1b)'
)
# Period of checks for the foreground, and timeout of an incomplete key sequence [s].
_CHECK_PERIOD = 0.5
# Indices in termios' list of attributes.
_LOCAL_MODES = 3
_CHARACTERS = 6
_COOKED = termios.ICANON | termios.ECHO


def split_keys(data: bytes) -> tuple[list[str], bytes]:
    """Return the names of the known keys in a terminal's bytes, and the incomplete rest."""
    names = []
    end = 0
    while key := _KEY.match(data, end):
        if key[0] in _KEY_NAMES:
            names.append(_KEY_NAMES[key[0]])
        end = key.end()
    return names, data[end:]


class Keyboard:
    """
    Read keys one by one, without echo, and restore the terminal.

    A terminal is read and changed only while the process is in its foreground: a background job
    would be stopped (SIGTTIN). Pipes and files are not read. Ctrl-C and Ctrl-Z keep their meaning.
    `close` and `released` restore the terminal; after kill -9 the shell does, or `stty sane`.
    """

    def __init__(self) -> None:
        self._terminal = 0
        self._lock = Lock()
        self._closed = False
        # The attributes to restore; None while the terminal is unchanged.
        self._saved: list[Any] | None = None

    @property
    def is_available(self) -> bool:
        """Return whether there is a terminal."""
        # Without a standard input the number may be that of another file.
        return sys.stdin is not None and os.isatty(self._terminal)

    def start(self, on_key: Callable[[str], object], on_begin: Callable[[], object]) -> None:
        """Read keys in a thread, if there is a terminal; call on_begin in the foreground first."""
        if self.is_available:
            atexit.register(self.close)
            arguments = (on_key, on_begin)
            Thread(target=self._read, args=arguments, name='keyboard', daemon=True).start()

    def close(self) -> None:
        """Restore the terminal, and stop reading."""
        with self._lock:
            self._closed = True
            self._restore_terminal()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Restore the terminal until the context ends."""
        with self._lock:
            self._restore_terminal()
            yield

    def _read(self, on_key: Callable[[str], object], on_begin: Callable[[], object]) -> None:
        """Pass keys on while the process is in the foreground, until the keyboard is closed."""
        # Reading in the background is then an error, and does not stop the process.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTIN})
        has_begun = False
        incomplete = b''
        while True:
            with self._lock:
                if self._closed:
                    return
                in_foreground, data = self._poll()
                if in_foreground and not has_begun:
                    has_begun = True
                    on_begin()
                keys, incomplete = split_keys(incomplete + data)
                for key in keys:
                    on_key(key)
            ready, *_ = select([self._terminal] if in_foreground else [], [], [], _CHECK_PERIOD)
            if not ready:
                # A key that begins as others do, such as Escape, is ignored.
                incomplete = b''

    def _poll(self) -> tuple[bool, bytes]:
        """Return whether the process is in the foreground, and the typed bytes."""
        # The terminal may be gone, or another job's.
        with suppress(OSError, termios.error):
            if self._is_in_foreground():
                self._disable_line_mode()
                return True, os.read(self._terminal, 1024)
        return False, b''

    def _is_in_foreground(self) -> bool:
        return os.tcgetpgrp(self._terminal) == os.getpgrp()

    def _disable_line_mode(self) -> None:
        """Disable line mode and echo, also after a shell has set its own attributes."""
        attributes = termios.tcgetattr(self._terminal)
        if self._saved is not None and not attributes[_LOCAL_MODES] & _COOKED:
            return
        self._saved = attributes
        changed = [*attributes]
        changed[_LOCAL_MODES] &= ~_COOKED
        changed[_CHARACTERS] = [*attributes[_CHARACTERS]]
        # Reading returns at once.
        changed[_CHARACTERS][termios.VMIN] = changed[_CHARACTERS][termios.VTIME] = 0
        termios.tcsetattr(self._terminal, termios.TCSANOW, changed)

    def _restore_terminal(self) -> None:
        attributes = self._saved
        self._saved = None
        # In the background the terminal is another job's, with its own attributes.
        with suppress(OSError, termios.error):
            if attributes is not None and self._is_in_foreground():
                termios.tcsetattr(self._terminal, termios.TCSANOW, attributes)
