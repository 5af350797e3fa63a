"""
Map a pure function over many items: in processes of this machine, or on a cluster by Ray.

>>> from klann_ros.engines import parallel_map
>>> [answer for _, answer in sorted(parallel_map(abs, [-1, 2, -3], jobs=1))]
[1, 2, 3]

Answers come as they are completed, each with the number of its item. Failures are isolated: an
item without an answer yields a `TaskError` with the reason.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from itertools import islice
import logging
import multiprocessing
from multiprocessing.connection import Connection, wait
import os
import signal
import sys
from time import monotonic
from typing import Any, NamedTuple, TypeVar
import warnings

from klann_ros.missing_package import install_command

__all__ = ['ENGINES', 'EngineError', 'TaskError', 'check_engine', 'parallel_map']

Item = TypeVar('Item')
Answer = TypeVar('Answer')
_Function = Callable[[Any], Any]
_Answers = Iterator[tuple[int, Any]]
ENGINES = ('local', 'ray')
# Not forked from this process, which may have threads, but from one that has only imported. Where
# libraries do not bear a fork (macOS), or there is none (Windows), each worker imports.
if sys.platform == 'linux':
    _CONTEXT = multiprocessing.get_context('forkserver')
    _CPU_COUNT = len(os.sched_getaffinity(0))
else:
    _CONTEXT = multiprocessing.get_context('spawn')
    _CPU_COUNT = os.cpu_count() or 1
# Time for an idle worker to exit by itself [s].
_EXIT_TIMEOUT = 2.0
# A worker may die of something else than its task, so the task is tried again.
MAX_TRIES = 2
# The same text for every engine: its reports are compared byte for byte.
WORKER_DIED = f'its worker died while it worked on it, {MAX_TRIES} times'


class EngineError(Exception):
    """An unavailable engine; the text says why."""


class TaskError(NamedTuple):
    """The result of an item without an answer, and its reason."""

    reason: str


def parallel_map(
    function: Callable[[Item], Answer],
    items: Iterable[Item],
    *,
    engine: str = 'local',
    jobs: int | None = None,
    time_limit: float | None = None,
    address: str | None = None,
) -> Iterator[tuple[int, Answer | TaskError]]:
    """
    Yield the number of each item and the function's answer, in order of completion.

    Parameters
    ----------
    function : callable
        Of one item; pure, and in a module that workers can import.
    items : iterable
        Consumed as workers become free.
    engine : str
        'local' or 'ray'.
    jobs : int, optional
        Number of workers, >= 1; by default the CPUs of the machine or of the cluster.
    time_limit : float, optional
        Limit for each item; beyond it there is no answer [s].
    address : str, optional
        Of a Ray cluster; by default the variable RAY_ADDRESS, or else a Ray on this machine.

    Raises
    ------
    EngineError
        The engine does not exist, is not installed, or cannot be reached.
    ValueError
        `jobs` is less than 1.

    """
    check_engine(engine)
    if jobs is not None and jobs < 1:
        raise ValueError(f'jobs = {jobs} is refused: it must be 1 or more')
    if engine == 'ray':
        return _ray_map(function, items, jobs, time_limit, address)
    return _process_map(function, items, jobs, time_limit)


def check_engine(engine: str) -> None:
    """Raise an EngineError if there is no such engine, or if it is not installed."""
    if engine not in ENGINES:
        raise EngineError(f'there is no engine {engine!r}: {" or ".join(ENGINES)}')
    if engine == 'ray' and find_spec('ray') is None:
        raise EngineError(f'the engine ray needs Ray: {install_command("ray", "cluster")}')


# Worker processes on this machine, one task at a time each, with a deadline. The pool of the
# standard library breaks when a worker dies, and does not know its task.


class _WorkerDiedError(TaskError):
    __slots__ = ()


class _Task(NamedTuple):
    number: int
    item: Any
    tries: int = 1


def _process_map(
    function: _Function, items: Iterable[Any], jobs: int | None, time_limit: float | None
) -> _Answers:
    """Yield the numbered answers of worker processes; the task of a dead worker is retried."""
    new_tasks = (_Task(number, item) for number, item in enumerate(items))
    retries: list[_Task] = []
    workers: list[_Worker] = []
    if sys.platform == 'linux':
        _CONTEXT.set_forkserver_preload([getattr(function, 'func', function).__module__])
    try:
        for _ in range(jobs or _CPU_COUNT):
            task = next(new_tasks, None)
            if task is None:
                break
            workers.append(_Worker(function, time_limit, task))
        while workers:
            deadline = min(worker.deadline for worker in workers)
            timeout = None if deadline == float('inf') else max(0.0, deadline - monotonic())
            wait([worker.connection for worker in workers], timeout)
            for worker in [worker for worker in workers if worker.is_done]:
                finished = worker.task
                answer = worker.receive()
                must_retry = isinstance(answer, _WorkerDiedError) and finished.tries < MAX_TRIES
                if must_retry:
                    retries.append(finished._replace(tries=finished.tries + 1))
                task = retries.pop() if retries else next(new_tasks, None)
                if task is None:
                    workers.remove(worker)
                    worker.stop()
                else:
                    worker.send(task)
                if not must_retry:
                    yield finished.number, answer
    finally:
        for worker in workers:
            worker.kill()


class _Worker:
    """A process and its current task."""

    def __init__(self, function: _Function, time_limit: float | None, task: _Task) -> None:
        self._function = function
        self._time_limit = time_limit
        self._start()
        self.send(task)

    def _start(self) -> None:
        """Start the process of the worker, with a pipe to it."""
        self.connection, remote_end = _CONTEXT.Pipe()
        arguments = (remote_end, self._function)
        self._process = _CONTEXT.Process(
            target=_answer_tasks, args=arguments, daemon=True, name='klann_ros worker'
        )
        # A worker ignores Ctrl-C, which reaches all processes of a terminal; but during its
        # imports it would end with a traceback, as on Windows, where it inherits no mask.
        if sys.platform == 'win32':
            self._process.start()
        else:
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                self._process.start()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
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
        return self._has_answer or monotonic() >= self.deadline

    @property
    def _has_answer(self) -> bool:
        """Return whether there is an answer, or the end of the pipe."""
        try:
            return self.connection.poll()
        except BrokenPipeError:  # Windows, of a dead worker
            return True

    def receive(self) -> Any:
        """Return the task's answer or error."""
        if not self._has_answer:
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


def _answer_tasks(connection: Connection, function: _Function) -> None:
    """Answer tasks until the pipe closes."""
    # Ctrl-C reaches all processes of a terminal; only the parent handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter('ignore')  # as each worker would print it, in Python's form
    with suppress(EOFError, OSError):
        while True:
            connection.send(_call(function, connection.recv()))


def _call(function: _Function, item: Any) -> Any:
    try:
        return function(item)
    except Exception as error:
        return TaskError(f'{type(error).__name__}: {error}')


# Workers of a Ray cluster, or of a Ray on this machine.


def _ray_map(
    function: _Function,
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
    address: str | None,
) -> _Answers:
    """Yield the numbered answers of Ray's workers, started here unless there is a cluster."""
    # No usage statistics to its makers.
    os.environ.setdefault('RAY_USAGE_STATS_ENABLED', '0')
    import ray  # noqa: PLC0415 - it is optional

    address = address or os.environ.get('RAY_ADDRESS') or None
    options: dict[str, Any] = {'log_to_driver': False, 'logging_level': logging.ERROR}
    if not address:
        # Workers import from the paths of this process.
        path = {'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
        options |= {'num_cpus': jobs, 'include_dashboard': False}
        options['runtime_env'] = {'env_vars': path}
    must_start = not ray.is_initialized()
    if must_start:
        try:
            ray.init(address=address, **options)
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            reason = str(error).splitlines()[0]
            raise EngineError(
                f'Ray cannot be reached at {address or "this machine"}: {reason}'
            ) from error
    try:
        yield from _ray_answers(ray, function, items, jobs, time_limit)
    finally:
        if must_start:
            ray.shutdown()


def _ray_answers(
    ray: Any, function: _Function, items: Iterable[Any], jobs: int | None, time_limit: float | None
) -> _Answers:
    """Yield the answers of a running Ray as they come, or a TaskError for a task that failed."""
    remote = ray.remote(max_retries=MAX_TRIES - 1)(_call)
    shared = ray.put(function)
    workers = jobs or max(1, int(ray.cluster_resources().get('CPU', 1)))
    tasks = enumerate(items)
    running: dict[Any, int] = {}
    while True:
        for number, item in islice(tasks, workers - len(running)):
            running[remote.remote(shared, item)] = number
        if not running:
            return
        done, _ = ray.wait(list(running), timeout=time_limit)
        if not done:
            # No task ended within the limit: the oldest has exceeded it.
            oldest = next(iter(running))
            ray.cancel(oldest, force=True)
            yield running.pop(oldest), TaskError(f'it took longer than {time_limit:g} s')
        for reference in done:
            number = running.pop(reference)
            try:
                yield number, ray.get(reference)
            except ray.exceptions.RayError as error:
                reason = WORKER_DIED
                if type(error).__name__ != 'WorkerCrashedError':
                    # The last line of Ray's text is the original error.
                    last = str(error).strip().splitlines()[-1]
                    reason = f'{type(error).__name__}: {last}'
                yield number, TaskError(reason)
