"""
Processes that are forked from one which has imported everything, but begun nothing.

To import takes most of what it costs to start a node or a tool, and the suite starts hundreds.
What is forked is a process of its own like any other: its own signals, files, memory and DDS.
What it imports on its way it tells at its end, and the next one finds it there already. Whoever
claims something of the start itself starts a Python of its own.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
import gc
from importlib import import_module
import inspect
import json
import os
from pathlib import Path
import re
import resource
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from typing import TextIO

import klann_ros
from patience import PATIENCE

# The processes run the very package that the tests import, installed or not.
PACKAGE = str(Path(klann_ros.__file__).resolve().parents[1])
# What nodes and tools need before they know what they are to do.
MODULES = (
    'klann_ros.executables',
    'klann_ros.log.recover_command',
    'klann_ros.nodes.crank.node',
    'klann_ros.nodes.player.node',
    'klann_ros.nodes.recorder.node',
    'klann_ros.nodes.solver.node',
    'klann_ros.review.command',
)
# What they may import later without beginning anything: ours, the types of messages, drawing,
# computing.
LEARNT = re.compile(
    r'(klann_ros|lark|rosidl_\w+|\w+_(msgs|interfaces|srvs)|matplotlib|pandas|PIL'
    r'|numpy|scipy|numba|mujoco)(\.|$)'
)
# Instead of an executable: a script, or -c and a text; and its arguments.
PYTHON = 'python'
_STATUS = struct.Struct('i')


class ForkedProcess:
    """
    A process of the server's, as `subprocess.Popen` shows one.

    Attributes
    ----------
    pid : int
        Its number.
    returncode : int or None
        As of Popen.
    stdout : file
        What it writes there, as text.

    """

    def __init__(self, pid: int, stdout: TextIO, status: int) -> None:
        self.pid, self.stdout, self._status = pid, stdout, status
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return its exit code if it has ended."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; return the exit code."""
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout or 0.0)
            (status,) = _STATUS.unpack(os.read(self._status, _STATUS.size))
            os.close(self._status)
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, None]:
        """Read what it writes until it has ended."""
        if self.stdout.closed:
            return '', None
        end = None if timeout is None else time.monotonic() + timeout
        pieces = []
        while True:
            left = None if end is None else max(0.0, end - time.monotonic())
            if not select.select([self.stdout], [], [], left)[0]:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout or 0.0)
            piece = os.read(self.stdout.fileno(), 65536)
            if not piece:
                break
            pieces.append(piece)
        self.wait(None if end is None else max(0.0, end - time.monotonic()))
        self.stdout.close()
        return b''.join(pieces).decode(), None

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """The process that is forked; it ends with the one that has started it."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        environment = {
            **os.environ,
            'PYTHONPATH': os.pathsep.join([PACKAGE, str(Path(__file__).parent)]),
        }
        code = f'import fork_server; fork_server.serve({theirs.fileno()})'
        self._process = subprocess.Popen(
            [sys.executable, '-c', code], pass_fds=[theirs.fileno()], env=environment
        )
        theirs.close()

    def start(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        cwd: Path,
        environment: Mapping[str, str],
        stderr: int,
        stdout: int | None = None,
        stdin: int | None = None,
        memory: int = resource.RLIM_INFINITY,
    ) -> ForkedProcess:
        """
        Start an executable of the package, with so much memory [bytes].

        Without a `stdout` there is a pipe, and without a `stdin` nothing to be read.
        """
        nothing = os.open(os.devnull, os.O_RDWR)
        ours, theirs = os.pipe() if stdout is None else (os.dup(nothing), os.dup(stdout))
        status, told = os.pipe()
        asked = [name, [*arguments], str(cwd), dict(environment), memory]
        given = [theirs, stderr, told, nothing if stdin is None else stdin]
        try:
            socket.send_fds(self._socket, [json.dumps(asked).encode()], given)
        finally:
            for descriptor in (theirs, told, nothing):
                os.close(descriptor)
        (pid,) = _STATUS.unpack(self._socket.recv(_STATUS.size))
        return ForkedProcess(pid, os.fdopen(ours, 'r'), status)


@cache
def server() -> ForkServer:
    """Return the one of this process, started when it is asked for."""
    return ForkServer()


def called(
    name: str,
    *arguments: object,
    environment: Mapping[str, str] = os.environ,
    stdout: int | None = None,
    memory: int = resource.RLIM_INFINITY,
    patience: float = PATIENCE,
) -> subprocess.CompletedProcess[str]:
    """Run a tool, or a script by PYTHON, to its end, as `subprocess.run` does."""
    with tempfile.TemporaryFile('w+') as errors:
        process = server().start(
            name,
            [*map(str, arguments)],
            cwd=Path.cwd(),
            environment=environment,
            stderr=errors.fileno(),
            stdout=stdout,
            memory=memory,
        )
        try:
            said, _ = process.communicate(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        errors.seek(0)
        return subprocess.CompletedProcess([name], process.wait(), said, errors.read())


def serve(number: int) -> None:
    """Fork whenever asked, and tell how each of these processes ended."""
    _learn(MODULES)
    asking = socket.socket(fileno=number)
    lessons, teaching = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    children: dict[int, int] = {}
    with _wakened_by_children() as wakeup:
        while True:
            ready, _, _ = select.select([asking, lessons, wakeup], [], [])
            if wakeup in ready:
                os.read(wakeup, 4096)
                _tell_of_the_ended(children)
            if lessons in ready:
                _learn(json.loads(lessons.recv(1 << 20)))
            if asking in ready:
                text, fds, _, _ = socket.recv_fds(asking, 1 << 20, 4)
                if not text:
                    return
                ours = [number, lessons.fileno(), wakeup, *children.values()]
                pid = _forked(text, fds, ours, teaching)
                children[pid] = fds[2]
                for fd in (*fds[:2], fds[3]):
                    os.close(fd)
                asking.send(_STATUS.pack(pid))


def _learn(names: Sequence[str]) -> None:
    """Import modules, and whatever else is the same for all that is forked from now on."""
    for name in names:
        with suppress(ImportError):
            import_module(name)
    # The first message of a logger looks through all modules for the one that it is from.
    inspect.getmodule(inspect.currentframe())
    gc.freeze()


@contextmanager
def _wakened_by_children() -> Iterator[int]:
    """Yield what can be read when a child has ended."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(writer)
    # Ctrl-C in the terminal of the tests is theirs.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield reader


def _tell_of_the_ended(children: dict[int, int]) -> None:
    with suppress(ChildProcessError):
        while True:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            told = children.pop(pid)
            with suppress(OSError):
                os.write(told, _STATUS.pack(status))
            os.close(told)


def _forked(
    text: bytes, fds: Sequence[int], others: Sequence[int], teaching: socket.socket
) -> int:
    pid = os.fork()
    if pid:
        return pid
    code, known = 1, set(sys.modules)
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        name, arguments, cwd, environment, memory = json.loads(text)
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        for fd, place in ((fds[3], 0), (fds[0], 1), (fds[1], 2)):
            os.dup2(fd, place)
        for fd in {*fds, *others}:
            os.close(fd)
        os.chdir(cwd)
        os.environ.clear()
        os.environ.update(environment)
        # The server's own have found out what they write to, which is something else now.
        encoding = os.environ.get('PYTHONIOENCODING')
        sys.stdin = os.fdopen(0, encoding=encoding, closefd=False)
        sys.stdout = os.fdopen(1, 'w', encoding=encoding, closefd=False)
        sys.stderr = os.fdopen(
            2, 'w', 1, encoding=encoding, errors='backslashreplace', closefd=False
        )
        sys.argv = ['-c', *arguments]
        code = _run(name)
        new = [name for name in sys.modules if name not in known and LEARNT.match(name)]
        if new:
            teaching.send(json.dumps(new).encode())
    finally:
        # No further: what stands above is the server's.
        os._exit(code)


def _run(name: str) -> int:
    """Run an executable, or a script, and end as an interpreter does."""
    from klann_ros import executables

    try:
        return _run_script() if name == PYTHON else int(getattr(executables, name)())
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            return 1
        return int(end.code or 0)
    except BaseException:
        sys.excepthook(*sys.exc_info())
        return 1
    finally:
        for file in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                file.flush()


def _run_script() -> int:
    del sys.argv[0]
    if sys.argv[0] == '-c':
        text = compile(sys.argv.pop(1), '<string>', 'exec')
        exec(text, {'__name__': '__main__'})  # noqa: S102 - a test's own
    else:
        places = os.environ.get('PYTHONPATH', '').split(os.pathsep)
        sys.path[:0] = [str(Path(sys.argv[0]).parent), *filter(None, places)]
        runpy.run_path(sys.argv[0], run_name='__main__')
    return 0
