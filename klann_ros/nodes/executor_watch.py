"""An executor's wait in a thread of its own, so that another loop can do without."""

from collections.abc import Callable
from threading import Semaphore, Thread
from typing import Any, TYPE_CHECKING

from rclpy import executors

if TYPE_CHECKING:
    from typing_extensions import Self


class ExecutorWatch:
    """
    Wait as an executor does, and hand ready entities to another thread, one at a time.

    The executor's own `wait_for_ready_callbacks` waits, as in a MultiThreadedExecutor. It does
    not go on before what it found was run, so that nothing runs while it looks.

    Parameters
    ----------
    executor : rclpy.executors.Executor
        No other thread spins it meanwhile.
    wake : callable
        Is called whenever `is_ready` becomes true, by the thread that waits.
    condition : callable
        Is asked whenever the executor wakes up, so also when entities come or go; where it holds,
        `is_ready` becomes true with nothing to run.

    Attributes
    ----------
    is_ready : bool
        Whether `run` has something to do.

    """

    def __init__(
        self, executor: Any, wake: Callable[[], object], condition: Callable[[], bool]
    ) -> None:
        self.is_ready = False
        self._executor = executor
        self._wake = wake
        self._condition = condition
        self._stopped = False
        self._task: Any = None
        self._go_on = Semaphore(0)
        self._thread = Thread(target=self._watch, name='watch', daemon=True)

    def __enter__(self) -> 'Self':
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End; run the ready entities first, since the executor does not find them again."""
        self._stopped = True
        self._go_on.release()
        self._executor.wake()
        self._thread.join()
        if kind is None and not isinstance(self._task, Exception):
            self.run()

    def run(self) -> None:
        """
        Run a ready callback, if there is one, and raise its exception.

        Raises
        ------
        ShutdownException, ExternalShutdownException
            The executor, or the context, was shut down.

        """
        if not self.is_ready:
            return
        task, self._task, self.is_ready = self._task, None, False
        if isinstance(task, Exception):
            raise task
        if task is not None:
            task()
            task.result()
        self._go_on.release()

    def _watch(self) -> None:
        while not self._stopped:
            try:
                self._task, *_ = self._executor.wait_for_ready_callbacks(
                    None, None, self._stop_or_condition
                )
            except executors.ConditionReachedException:
                self._task = None
            except Exception as error:  # it is the other thread's
                self._task = error
            self.is_ready = True
            self._wake()
            self._go_on.acquire()

    def _stop_or_condition(self) -> bool:
        return self._stopped or self._condition()


def is_possible(executor: Any) -> bool:
    """Return whether rclpy has the internals that are used here."""
    return hasattr(executor, 'wait_for_ready_callbacks') and hasattr(
        executors, 'ConditionReachedException'
    )
