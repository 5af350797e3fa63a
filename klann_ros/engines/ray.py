"""Workers of a Ray cluster, or of a Ray on this machine."""

from collections.abc import Callable, Iterable, Iterator
import logging
import os
import sys
from typing import Any

from .answers import DIED, EngineError, Failed, TRIES


def mapped_by_ray(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    jobs: int | None,
    time_limit: float | None,
    address: str | None,
) -> Iterator[tuple[int, Any]]:
    """Yield as `mapped` does."""
    # It would tell its makers that it is used.
    os.environ.setdefault('RAY_USAGE_STATS_ENABLED', '0')
    try:
        import ray  # noqa: PLC0415 - it is optional
    except ImportError as error:
        raise EngineError("the engine ray needs Ray: pip install 'klann_ros[cluster]'") from error
    where = address or os.environ.get('RAY_ADDRESS') or None
    own: dict[str, Any] = {} if where else _alone(jobs)
    begun = not ray.is_initialized()
    if begun:
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
        if begun:
            ray.shutdown()


def _alone(jobs: int | None) -> dict[str, Any]:
    """Return the settings of a Ray of our own, whose workers import what this process does."""
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
    remote = ray.remote(max_retries=TRIES - 1)(_answer)
    shared = ray.put(function)
    at_once = jobs or max(1, int(ray.cluster_resources().get('CPU', 1)))
    tasks = enumerate(items)
    asked: dict[Any, int] = {}
    while True:
        while len(asked) < at_once and (task := next(tasks, None)) is not None:
            asked[remote.remote(shared, task[1])] = task[0]
        if not asked:
            return
        done, _ = ray.wait(list(asked), timeout=time_limit)
        if not done:
            # Nothing ended for so long: the oldest has had its time.
            oldest = next(iter(asked))
            ray.cancel(oldest, force=True)
            yield asked.pop(oldest), Failed(f'it took longer than {time_limit:g} s')
        for reference in done:
            number = asked.pop(reference)
            try:
                yield number, ray.get(reference)
            except ray.exceptions.RayError as error:
                yield number, Failed(_in_words(error))


def _in_words(error: Exception) -> str:
    if type(error).__name__ == 'WorkerCrashedError':
        return DIED
    # Ray's text begins with where it was, and ends with what it was.
    return f'{type(error).__name__}: {str(error).strip().splitlines()[-1]}'


def _answer(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except Exception as error:
        return Failed(f'{type(error).__name__}: {error}')
