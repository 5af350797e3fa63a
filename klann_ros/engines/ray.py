"""Workers of a Ray cluster, or of a Ray on this machine."""

from collections.abc import Callable, Iterable, Iterator
import logging
import os
import sys
from typing import Any

from .local import EngineError, MAX_TRIES, TaskError, WORKER_DIED


def ray_map(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
    address: str | None,
) -> Iterator[tuple[int, Any]]:
    """Yield as `parallel_map` does."""
    # No usage statistics to its makers.
    os.environ.setdefault('RAY_USAGE_STATS_ENABLED', '0')
    try:
        import ray  # noqa: PLC0415 - it is optional
    except ImportError as error:
        raise EngineError("the engine ray needs Ray: pip install 'klann_ros[cluster]'") from error
    where = address or os.environ.get('RAY_ADDRESS') or None
    own: dict[str, Any] = {} if where else _local_settings(jobs)
    started = not ray.is_initialized()
    if started:
        try:
            ray.init(address=where, log_to_driver=False, logging_level=logging.ERROR, **own)
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            reason = str(error).splitlines()[0]
            raise EngineError(
                f'Ray cannot be reached at {where or "this machine"}: {reason}'
            ) from error
    try:
        yield from _answers(ray, function, items, jobs, time_limit)
    finally:
        if started:
            ray.shutdown()


def _local_settings(jobs: int | None) -> dict[str, Any]:
    """Return the settings of a Ray on this machine, whose workers import from our paths."""
    path = os.pathsep.join(filter(None, sys.path))
    return {
        'num_cpus': jobs,
        'include_dashboard': False,
        'runtime_env': {'env_vars': {'PYTHONPATH': path}},
    }


def _answers(
    ray: Any,
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
) -> Iterator[tuple[int, Any]]:
    remote = ray.remote(max_retries=MAX_TRIES - 1)(_answer)
    shared = ray.put(function)
    workers = jobs or max(1, int(ray.cluster_resources().get('CPU', 1)))
    tasks = enumerate(items)
    running: dict[Any, int] = {}
    while True:
        while len(running) < workers and (task := next(tasks, None)) is not None:
            running[remote.remote(shared, task[1])] = task[0]
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
                yield number, TaskError(_reason(error))


def _reason(error: Exception) -> str:
    if type(error).__name__ == 'WorkerCrashedError':
        return WORKER_DIED
    # The last line of Ray's text is the original error.
    return f'{type(error).__name__}: {str(error).strip().splitlines()[-1]}'


def _answer(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except Exception as error:
        return TaskError(f'{type(error).__name__}: {error}')
