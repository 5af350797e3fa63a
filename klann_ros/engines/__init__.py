"""
Map a pure function over many items: in processes of this machine, or on a cluster by Ray.

>>> from klann_ros.engines import parallel_map
>>> [answer for _, answer in sorted(parallel_map(abs, [-1, 2, -3], jobs=1))]
[1, 2, 3]

Answers come as they are completed, each with the number of its item. Failures are isolated: an
item without an answer yields a `TaskError` with the reason.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from .local import EngineError, process_map, TaskError
from .ray import ray_map

__all__ = ['ENGINES', 'EngineError', 'TaskError', 'parallel_map']

Item = TypeVar('Item')
Answer = TypeVar('Answer')
ENGINES = ('local', 'ray')


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
    if engine not in ENGINES:
        raise EngineError(f'there is no engine {engine!r}: {" or ".join(ENGINES)}')
    if jobs is not None and jobs < 1:
        raise ValueError(f'jobs = {jobs} is refused: it must be 1 or more')
    if engine == 'ray':
        return ray_map(function, items, jobs, time_limit, address)
    return process_map(function, items, jobs, time_limit)
