"""SIGINT, SIGTERM and SIGHUP as one orderly request to stop, from a process's first moment on."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
import os
import signal
import threading

# Ctrl-Z and Ctrl-\ go on doing what they do, after the terminal has been given back.
_OF_THE_TERMINAL = {signal.SIGTSTP, signal.SIGQUIT}


class StopSignals:
    r"""
    Turn the three stop signals into calls of one function.

    The signals are blocked in every thread and taken by one that waits for nothing else. So no
    system call is interrupted, no KeyboardInterrupt is raised anywhere, ROS's context stays valid
    until the node has put its things in order, and the second SIGINT that `ros2 launch` lets a
    node have is harmless. Make it in the main thread before any other thread is started: threads
    inherit the mask.

    Until `on_stop` names a function nothing is open yet, and a signal ends the process at once
    with exit code 0.

    Parameters
    ----------
    uses_terminal
        Whether the process changes its terminal, and must give it back before Ctrl-Z stops it or
        Ctrl-\ ends it: see `on_suspend`.

    """

    def __init__(self, *, uses_terminal: bool = False) -> None:
        signals = {signal.SIGINT, signal.SIGTERM}
        # nohup asks for a process that outlives its terminal. A shell's `&` ignores SIGINT too,
        # but there a user's `kill -INT` is meant.
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signals.add(signal.SIGHUP)
        if uses_terminal:
            signals |= _OF_THE_TERMINAL
        # An ignored signal never reaches sigwait.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        self._stop: Callable[[], object] = _leave
        self._released: Callable[[], AbstractContextManager[None]] = nullcontext
        threading.Thread(target=self._wait, args=(signals,), name='stop', daemon=True).start()

    def on_stop(self, stop: Callable[[], object]) -> None:
        """Name the function to call at each signal; it runs in a thread of its own."""
        self._stop = stop

    def on_suspend(self, released: Callable[[], AbstractContextManager[None]]) -> None:
        """Name what returns a context in which the terminal is as it was."""
        self._released = released

    def _wait(self, signals: set[signal.Signals]) -> None:
        while True:
            number = signal.sigwait(signals)
            if number in _OF_THE_TERMINAL:
                with self._released():
                    _deliver(number)
            else:
                self._stop()


def _deliver(number: int) -> None:
    """Let a signal do to the process what it does; return when that has been continued."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
    signal.pthread_kill(threading.get_ident(), number)
    signal.pthread_sigmask(signal.SIG_BLOCK, {number})


def _leave() -> None:
    os._exit(0)
