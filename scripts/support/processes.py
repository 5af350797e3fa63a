"""Child processes: each the leader of a group, ended with all of its own children."""

from collections.abc import Mapping, Sequence
import contextlib
import os
from pathlib import Path
import signal
import subprocess
import time

import stop

Process = subprocess.Popen[bytes]

# How long a process may take to end: by itself after SIGINT, then after SIGTERM.
GRACE = {signal.SIGINT: 8.0, signal.SIGTERM: 3.0}
# Linux's prctl; where there is none it is done without.
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36


def start(
    arguments: Sequence[str | Path], output: Path, env: Mapping[str, str], cwd: Path
) -> Process:
    """
    Start a process without input; it and its children write to the file `output`.

    A session of its own keeps the terminal's Ctrl-C away from it: this program decides the order
    in which things end.
    """
    with output.open('ab') as file:
        return subprocess.Popen(
            [str(argument) for argument in arguments],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=dict(env),
            cwd=cwd,
            start_new_session=True,
            # No thread here can hold a lock that the child would wait for.
            preexec_fn=_prepare_child,  # noqa: PLW1509
        )


def run(
    arguments: Sequence[str | Path],
    output: Path,
    env: Mapping[str, str],
    cwd: Path,
    timeout: float = 3600.0,
) -> int | None:
    """Run a process to its end; return its exit code, or None after `timeout` [s]."""
    process = start(arguments, output, env, cwd)
    try:
        return wait(process, timeout)
    finally:
        end(process)


def wait(process: Process, timeout: float) -> int | None:
    """Wait for the end of a process; return its exit code, or None after `timeout` [s]."""
    deadline = time.monotonic() + timeout
    while (code := process.poll()) is None and time.monotonic() < deadline:
        stop.pause()
    return code


def end(process: Process) -> int:
    """End a process and its group, politely first; return the exit code of the process."""
    for number, grace in GRACE.items():
        if process.poll() is None:
            _signal_group(process.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(grace)
    # What is left of the group when its leader has gone has nobody to wait for it.
    _signal_group(process.pid, signal.SIGKILL)
    return process.wait()


def adopt_orphans() -> None:
    """Become the parent of every descendant that outlives its own parent (Linux)."""
    _prctl(PR_SET_CHILD_SUBREAPER, 1)


def end_orphans() -> None:
    """End what a child left behind, such as a node whose test was killed."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        deadline = time.monotonic() + 2.0
        for child in _children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, number)
        while _children() and time.monotonic() < deadline:
            time.sleep(0.05)


def _prepare_child() -> None:
    # nohup is for this command; a child has no terminal, and what it does on SIGHUP is tested.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    # Of our own kill -9 we cannot tell the children; the kernel does.
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _prctl(option: int, value: int) -> None:
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import ctypes  # noqa: PLC0415 - not every Python is built with it

        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _signal_group(group: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


def _children() -> list[int]:
    """Return the children of this process that still run, and forget those that have ended."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    me = str(os.getpid())
    children = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        with contextlib.suppress(OSError):
            # pid (command) state ppid ...; the command may hold spaces and brackets.
            if stat.read_text().rpartition(')')[2].split()[1] == me:
                children.append(int(stat.parent.name))
    return children
