"""
Workers on this machine: processes that are asked one item at a time, and watched.

A pool of the standard library is broken by the first worker that dies, and forgets who worked on
what; here a worker that is killed, or takes too long, costs no more than its own item.
"""

from collections.abc import Callable, Iterable, Iterator
import multiprocessing
from multiprocessing.connection import Connection, wait
import os
import signal
from time import monotonic
from typing import Any

from .answers import DIED, Failed, TRIES

# Not forked: this process may have threads, and a worker needs none of what it holds.
_SPAWN = multiprocessing.get_context('spawn')
# A worker is given so long to end by itself when all is done [s].
_FAREWELL = 2.0


def mapped_here(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
) -> Iterator[tuple[int, Any]]:
    """Yield as `mapped` does."""
    left = _Left(items)
    workers: list[_Worker] = []
    try:
        for _ in range(jobs or len(os.sched_getaffinity(0))):
            task = left.following()
            if task is None:
                break
            workers.append(_Worker(function, time_limit, task))
        while workers:
            soonest = min(worker.deadline for worker in workers)
            patience = None if soonest == float('inf') else max(0.0, soonest - monotonic())
            wait([worker.connection for worker in workers], patience)
            for worker in [worker for worker in workers if worker.is_done]:
                number, answer = worker.answer()
                if isinstance(answer, Failed) and left.again(worker.task, answer):
                    answer = None
                task = left.following()
                if task is None:
                    workers.remove(worker)
                    worker.end()
                else:
                    worker.ask(task)
                if answer is not None:
                    yield number, answer[0] if isinstance(answer, _Answered) else answer
    finally:
        for worker in workers:
            worker.kill()


class _Answered(tuple[Any]):
    """What a function answered, which may be anything."""

    __slots__ = ()


class _Left:
    """The items that are left, those to be tried again first."""

    def __init__(self, items: Iterable[Any]) -> None:
        self._items = enumerate(items)
        self._again: list[tuple[int, Any]] = []
        self._tries: dict[int, int] = {}

    def following(self) -> tuple[int, Any] | None:
        return self._again.pop() if self._again else next(self._items, None)

    def again(self, task: tuple[int, Any], failed: Failed) -> bool:
        """Return whether an item without an answer is tried once more."""
        if not isinstance(failed, _Died):
            return False
        tries = self._tries[task[0]] = self._tries.get(task[0], 1) + 1
        if tries > TRIES:
            return False
        self._again.append(task)
        return True


class _Died(Failed):
    """A worker that died, perhaps of something else than its item."""

    __slots__ = ()


class _Worker:
    """A process, and what it was asked last."""

    def __init__(
        self, function: Callable[[Any], Any], time_limit: float | None, task: tuple[int, Any]
    ) -> None:
        self._function, self._time_limit = function, time_limit
        self._process: Any = None
        self.connection: Connection
        self._start()
        self.ask(task)

    def _start(self) -> None:
        self.connection, theirs = _SPAWN.Pipe()
        self._process = _SPAWN.Process(
            target=_work, args=(theirs, self._function), daemon=True, name='klann_ros worker'
        )
        self._process.start()
        # So that its end of the pipe closes when it dies.
        theirs.close()

    def ask(self, task: tuple[int, Any]) -> None:
        """Give it an item; a new process where the old one is gone."""
        self.task = task
        try:
            self.connection.send(task[1])
        except OSError:
            self._restart()
            self.connection.send(task[1])
        limit = self._time_limit
        self.deadline = float('inf') if limit is None else monotonic() + limit

    @property
    def is_done(self) -> bool:
        """Return whether there is an answer, or none to be waited for."""
        return self.connection.poll() or monotonic() >= self.deadline

    def answer(self) -> tuple[int, Any]:
        """Return the item's number, and what came of it."""
        if not self.connection.poll():
            self._restart()
            return self.task[0], Failed(f'it took longer than {self._time_limit:g} s')
        try:
            return self.task[0], self.connection.recv()
        except (EOFError, OSError):
            self._restart()
            return self.task[0], _Died(DIED)

    def _restart(self) -> None:
        self.kill()
        self._start()

    def end(self) -> None:
        """Let it end: it has nothing more to do."""
        self.connection.close()
        self._process.join(_FAREWELL)
        self.kill()

    def kill(self) -> None:
        """End it whatever it does."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, function: Callable[[Any], Any]) -> None:
    """Answer items until nobody asks."""
    # Ctrl-C goes to all processes of a terminal: who asks decides what becomes of it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            item = connection.recv()
        except (EOFError, OSError):
            return
        answer: Any
        try:
            answer = _Answered((function(item),))
        except Exception as error:
            answer = Failed(f'{type(error).__name__}: {error}')
        try:
            connection.send(answer)
        except OSError:
            return
