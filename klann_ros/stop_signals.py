"""SIGINT, SIGTERM and SIGHUP as one orderly request to stop, from the start of a process."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
import os
import signal
import threading

# Ctrl-Z and Ctrl-\ keep their effect, after the terminal was restored.
_TERMINAL_SIGNALS = {signal.SIGTSTP, signal.SIGQUIT}


class StopSignals:
    """
    Turn the three stop signals into calls of one function.

    The signals are blocked in every thread and taken by a waiting one. So no system call is
    interrupted, no KeyboardInterrupt is raised, ROS's context stays valid during the node's
    shutdown, and the second SIGINT of `ros2 launch` is harmless. Made in the main thread before
    any other thread, which inherits the mask. Before `on_stop` a signal ends the process at once
    with exit code 0.

    A process that `uses_terminal` restores it at Ctrl-Z and at SIGQUIT too: see `on_suspend`.
    """

    def __init__(self, *, uses_terminal: bool = False) -> None:
        signals = {signal.SIGINT, signal.SIGTERM}
        # A process under nohup outlives its terminal. A shell's `&` ignores SIGINT too, but must
        # not disable a user's `kill -INT`.
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signals.add(signal.SIGHUP)
        if uses_terminal:
            signals |= _TERMINAL_SIGNALS
        # An ignored signal never reaches sigwait.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        self._stop: Callable[[], object] = _leave
        self._released: Callable[[], AbstractContextManager[None]] = nullcontext
        threading.Thread(target=self._wait, args=(signals,), name='stop', daemon=True).start()

    def on_stop(self, stop: Callable[[], object]) -> None:
        """Set the function to call at each signal, in a thread."""
        self._stop = stop

    def on_suspend(self, released: Callable[[], AbstractContextManager[None]]) -> None:
        """Set the function that returns a context with the restored terminal."""
        self._released = released

    def _wait(self, signals: set[signal.Signals]) -> None:
        while True:
            number = signal.sigwait(signals)
            if number in _TERMINAL_SIGNALS:
                with self._released():
                    _deliver(number)
            else:
                self._stop()


def _deliver(number: int) -> None:
    """Deliver a signal to the process; return when the process is continued."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
    signal.pthread_kill(threading.get_ident(), number)
    signal.pthread_sigmask(signal.SIG_BLOCK, {number})


def _leave() -> None:
    os._exit(0)
