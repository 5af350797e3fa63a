"""Child processes, each with a group of its own, and the signals on which all of them end."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
import ctypes
import os
from pathlib import Path
import signal
import subprocess
import time

from source import ROOT

Command = Sequence[object]  # texts and paths
Process = subprocess.Popen[bytes]
Variables = Mapping[str, str]

# Timeouts of a process to end after SIGINT, then after SIGTERM [s].
GRACE = {signal.SIGINT: 12.0, signal.SIGTERM: 3.0}
_received: list[int] = []
_LIBC = ctypes.CDLL(None)
# The option of prctl for the signal that a process gets when its parent ends.
_PR_SET_PDEATHSIG = 1


class CommandError(Exception):
    """A fatal error of a command, printed without a traceback."""

    exit_code = 1


def listen() -> None:
    """
    Note Ctrl-C, SIGTERM and SIGHUP from now on; `pause` is where they end the command.

    A KeyboardInterrupt could fall between the start of a process and the line that remembers it.
    """
    nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda received, _frame: _received.append(received))
    if nohup:
        # Not SIG_IGN: children would inherit it, and their reaction to SIGHUP is tested.
        signal.signal(signal.SIGHUP, lambda _received, _frame: None)


def pause(seconds: float = 0.05) -> None:
    """Sleep for a moment; raise CommandError if a signal has come."""
    time.sleep(seconds)
    for number in _received:
        error = CommandError(f'stopped by {signal.Signals(number).name}')
        error.exit_code = 128 + number
        raise error


@contextmanager
def running(
    command: Command, variables: Variables, output: Path | None = None
) -> Iterator[Process]:
    """
    Run a process in the checkout, and end it with its group; it writes to a file or our output.

    A session of its own keeps the terminal's Ctrl-C away from it: this program decides the order
    in which things end. If this program is killed (kill -9), the process gets SIGTERM.
    """
    with output.open('wb') if output else nullcontext() as file:
        process = subprocess.Popen(
            list(map(str, command)),
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT if output else None,
            env=variables,
            cwd=ROOT,
            start_new_session=True,
            preexec_fn=_end_with_parent,  # noqa: PLW1509 - it calls one function of libc
        )
    try:
        yield process
    finally:
        end(process)


def _end_with_parent() -> None:
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def run(
    command: Command,
    variables: Variables,
    output: Path | None = None,
    timeout: float = 3600.0,
    on_pause: Callable[[], object] = int,
) -> int | None:
    """Run a process to its end; return its exit code, or None after `timeout` [s]."""
    with running(command, variables, output) as process:
        deadline = time.monotonic() + timeout
        while process.poll() is None and time.monotonic() < deadline:
            pause()
            on_pause()
        return process.returncode


def end(process: Process) -> int:
    """End a process and its group, politely first; return the exit code of the process."""
    for number, grace in GRACE.items():
        if process.poll() is None:
            os.killpg(process.pid, number)
            with suppress(subprocess.TimeoutExpired):
                process.wait(grace)
    # Nothing waits for the rest of a group without its leader.
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    return process.wait()


def last_lines(output: Path, count: int = 1) -> str:
    """Return the last lines of a process's output."""
    text = output.read_text(encoding='utf-8', errors='replace')
    return '\n'.join(text.strip().splitlines()[-count:])
