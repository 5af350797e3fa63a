"""SIGINT, SIGTERM and SIGHUP as one orderly request to stop, from the start of a process."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
import ctypes
from functools import partial
import math
import os
import signal
import sys
import threading
import time

# Ctrl-Z and Ctrl-\ keep their effect, after the terminal was restored.
_TERMINAL_SIGNALS = {signal.SIGTSTP, signal.SIGQUIT}
# The end of a process takes this time at most; a signal shortens it after the second time, as
# `ros2 launch` may send two in a row [s].
END_TIMEOUT = 3.0
END_GRACE = 1.0
# The notification of a POSIX timer by a thread.
_SIGEV_THREAD = 2


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
        self._stop: Callable[[], object] = partial(os._exit, 0)
        self._released: Callable[[], AbstractContextManager[None]] = nullcontext
        self._is_ending = False
        self._restores = threading.Event()
        self._thread = threading.Thread(
            target=self._wait, args=(signals,), name='stop', daemon=True
        )
        self._thread.start()

    def on_stop(self, stop: Callable[[], object]) -> None:
        """Set the function to call at each signal, in a thread."""
        self._stop = stop

    def on_suspend(self, released: Callable[[], AbstractContextManager[None]]) -> None:
        """Set the function that returns a context with the restored terminal."""
        self._released = released

    def limit_end(self, code: int) -> None:
        """
        End the process with an exit code within END_TIMEOUT; sooner if it ends by itself.

        To be called once, when only the middleware and the interpreter are still to be shut down:
        Fast DDS may wait forever for its own lock while it removes a participant, with Python's
        lock held. So neither the timeout nor the signals need a lock of Python's.
        """
        for stream in (sys.stdout, sys.stderr):
            # A closed stream is None.
            with suppress(AttributeError, OSError, ValueError):
                stream.flush()
        _exit_after(END_TIMEOUT, code)
        self._is_ending = True
        signal.pthread_kill(self._thread.ident or 0, signal.SIGTERM)
        self._restores.wait()

    def _wait(self, signals: set[signal.Signals]) -> None:
        while True:
            number = signal.sigwait(signals)
            if self._is_ending:
                while signal.sigpending() & signals:
                    signal.sigwait(signals)
                self._restore_after(END_GRACE, signals)
                return
            if number in _TERMINAL_SIGNALS:
                with self._released():
                    _deliver(number)
            else:
                self._stop()

    def _restore_after(self, delay: float, signals: set[signal.Signals]) -> None:
        """Let blocked signals have their default actions in this thread after a delay [s]."""
        library = ctypes.CDLL(None)
        blocked = (ctypes.c_ulong * 16)()
        library.sigfillset(blocked)
        times = (ctypes.c_long * 2)(*_timespec(delay))
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
        self._restores.set()
        # Its mask holds during the call only, and ends without a lock of Python's.
        library.pselect(0, None, None, None, times, blocked)


def _deliver(number: int) -> None:
    """Deliver a signal to the process; return when the process is continued."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
    signal.pthread_kill(threading.get_ident(), number)
    signal.pthread_sigmask(signal.SIG_BLOCK, {number})


class _Notification(ctypes.Structure):
    """`struct sigevent` of Linux: the call of a function by a thread of the timer's own."""

    _fields_ = [
        ('argument', ctypes.c_void_p),
        ('signal', ctypes.c_int),
        ('method', ctypes.c_int),
        ('function', ctypes.c_void_p),
        ('attributes', ctypes.c_void_p),
        ('padding', ctypes.c_char * 32),
    ]


def _exit_after(delay: float, code: int) -> None:
    """Exit with a code after a delay [s]; without timers that call functions, by SIGALRM."""
    library = ctypes.CDLL(None)
    if not hasattr(library, 'timer_create'):
        signal.setitimer(signal.ITIMER_REAL, delay)
        return
    leave = ctypes.cast(library['_exit'], ctypes.c_void_p).value
    notification = _Notification(code, 0, _SIGEV_THREAD, leave)
    timer = ctypes.c_void_p()
    # Period and delay, in seconds and nanoseconds.
    times = (ctypes.c_long * 4)(0, 0, *_timespec(delay))
    library.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(notification), ctypes.byref(timer))
    library.timer_settime(timer, 0, times, None)


def _timespec(duration: float) -> tuple[int, int]:
    """Return a duration [s] in whole seconds and nanoseconds."""
    fraction, seconds = math.modf(duration)
    return int(seconds), round(1e9 * fraction)
