"""SIGINT, SIGTERM and SIGHUP as one orderly request to stop, from a process's first moment on."""

from collections.abc import Callable
import os
import signal
import threading


class StopSignals:
    """
    Turn the three stop signals into calls of one function.

    The signals are blocked in every thread and taken by one that waits for nothing else. So no
    system call is interrupted, no KeyboardInterrupt is raised anywhere, ROS's context stays valid
    until the node has put its things in order, and the second SIGINT that `ros2 launch` lets a
    node have is harmless. Make it in the main thread before any other thread is started: threads
    inherit the mask.

    Until `on_stop` names a function nothing is open yet, and a signal ends the process at once
    with exit code 0.
    """

    def __init__(self) -> None:
        """Take the signals over."""
        signals = {signal.SIGINT, signal.SIGTERM}
        # nohup asks for a process that outlives its terminal. A shell's `&` ignores SIGINT too,
        # but there a user's `kill -INT` is meant.
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signals.add(signal.SIGHUP)
        # What is ignored never reaches sigwait.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        self._stop: Callable[[], object] = _leave
        threading.Thread(target=self._wait, args=(signals,), name='stop', daemon=True).start()

    def on_stop(self, stop: Callable[[], object]) -> None:
        """Name the function to call at each signal; it runs in a thread of its own."""
        self._stop = stop

    def _wait(self, signals: set[signal.Signals]) -> None:
        while True:
            signal.sigwait(signals)
            self._stop()


def _leave() -> None:
    os._exit(0)
