"""
Worker processes on this machine, one task at a time each, with a deadline.

The standard library's pool breaks when a worker dies, and does not say which task it had. Here a
worker that is killed or exceeds the time limit costs only its own task.
"""

from collections.abc import Callable, Iterable, Iterator
import multiprocessing
from multiprocessing.connection import Connection, wait
import os
import signal
from time import monotonic
from typing import Any, NamedTuple

# Not forked: this process may have threads, and a worker needs none of its state.
_SPAWN = multiprocessing.get_context('spawn')
# Time for an idle worker to exit by itself [s].
_EXIT_TIMEOUT = 2.0
# A worker may die of something else than its task, so the task is tried again.
MAX_TRIES = 2
# The same text for every engine: its reports are compared byte for byte.
WORKER_DIED = f'its worker died while it worked on it, {MAX_TRIES} times'


class EngineError(Exception):
    """An unavailable engine; the text says why."""


class TaskError(NamedTuple):
    """
    The result of an item without an answer.

    Attributes
    ----------
    reason : str
        Why there is none.

    """

    reason: str


class _WorkerDiedError(TaskError):
    __slots__ = ()


class _Task(NamedTuple):
    number: int
    item: Any
    tries: int = 1


class _Answer(tuple[Any]):
    """A function's answer, which may itself be a TaskError or None."""

    __slots__ = ()


def process_map(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
) -> Iterator[tuple[int, Any]]:
    """Yield as `parallel_map` does."""
    new_tasks = (_Task(number, item) for number, item in enumerate(items))
    retries: list[_Task] = []
    workers: list[_Worker] = []
    try:
        for _ in range(jobs or len(os.sched_getaffinity(0))):
            if (task := next(new_tasks, None)) is None:
                break
            workers.append(_Worker(function, time_limit, task))
        while workers:
            deadline = min(worker.deadline for worker in workers)
            timeout = None if deadline == float('inf') else max(0.0, deadline - monotonic())
            wait([worker.connection for worker in workers], timeout)
            for worker in [worker for worker in workers if worker.is_done]:
                done, answer = worker.task, worker.receive()
                retry = isinstance(answer, _WorkerDiedError) and done.tries < MAX_TRIES
                if retry:
                    retries.append(done._replace(tries=done.tries + 1))
                if (task := retries.pop() if retries else next(new_tasks, None)) is None:
                    workers.remove(worker)
                    worker.stop()
                else:
                    worker.send(task)
                if not retry:
                    yield done.number, answer[0] if isinstance(answer, _Answer) else answer
    finally:
        for worker in workers:
            worker.kill()


class _Worker:
    """A process and its current task."""

    def __init__(
        self, function: Callable[[Any], Any], time_limit: float | None, task: _Task
    ) -> None:
        self._function, self._time_limit = function, time_limit
        self._process: Any = None
        self.connection: Connection
        self._start()
        self.send(task)

    def _start(self) -> None:
        self.connection, remote_end = _SPAWN.Pipe()
        self._process = _SPAWN.Process(
            target=_work, args=(remote_end, self._function), daemon=True, name='klann_ros worker'
        )
        self._process.start()
        # The worker then holds the only copy: the pipe closes when it dies.
        remote_end.close()

    def send(self, task: _Task) -> None:
        """Send a task; to a new process if the old one has died."""
        self.task = task
        try:
            self.connection.send(task.item)
        except OSError:
            self._restart()
            self.connection.send(task.item)
        limit = self._time_limit
        self.deadline = float('inf') if limit is None else monotonic() + limit

    @property
    def is_done(self) -> bool:
        """Return whether there is an answer, or the deadline has passed."""
        return self.connection.poll() or monotonic() >= self.deadline

    def receive(self) -> Any:
        """Return the task's answer or error."""
        if not self.connection.poll():
            self._restart()
            return TaskError(f'it took longer than {self._time_limit:g} s')
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            self._restart()
            return _WorkerDiedError(WORKER_DIED)

    def _restart(self) -> None:
        self.kill()
        self._start()

    def stop(self) -> None:
        """Let an idle process exit."""
        self.connection.close()
        self._process.join(_EXIT_TIMEOUT)
        self.kill()

    def kill(self) -> None:
        """Kill the process, busy or not."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, function: Callable[[Any], Any]) -> None:
    """Answer tasks until the pipe closes."""
    # Ctrl-C reaches all processes of a terminal; only the parent handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            item = connection.recv()
        except (EOFError, OSError):
            return
        answer: Any
        try:
            answer = _Answer((function(item),))
        except Exception as error:
            answer = TaskError(f'{type(error).__name__}: {error}')
        try:
            connection.send(answer)
        except OSError:
            return
