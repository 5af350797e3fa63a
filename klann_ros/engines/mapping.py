"""The one door to all engines."""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from .answers import EngineError, Failed
from .local import mapped_here
from .ray import mapped_by_ray

Item = TypeVar('Item')
Answer = TypeVar('Answer')
ENGINES = ('local', 'ray')


def mapped(
    function: Callable[[Item], Answer],
    items: Iterable[Item],
    *,
    engine: str = 'local',
    jobs: int | None = None,
    time_limit: float | None = None,
    address: str | None = None,
) -> Iterator[tuple[int, Answer | Failed]]:
    """
    Yield the number of each item and what a function answers, as they are done.

    Parameters
    ----------
    function : callable
        Of one item; pure, and of a module that workers can import.
    items : iterable
        Are taken as workers become free.
    engine : str
        'local' or 'ray'.
    jobs : int, optional
        How many are worked on at once, >= 1; otherwise what the machine, or the cluster, has.
    time_limit : float, optional
        What takes longer has no answer [s].
    address : str, optional
        Of a Ray cluster; otherwise that of the variable RAY_ADDRESS, or a Ray of its own.

    Raises
    ------
    EngineError
        There is no such engine, it is not installed, or cannot be reached.
    ValueError
        `jobs` is less than 1.

    """
    if engine not in ENGINES:
        raise EngineError(f'there is no engine {engine!r}: {" or ".join(ENGINES)}')
    if jobs is not None and jobs < 1:
        raise ValueError(f'jobs = {jobs} is refused: it must be 1 or more')
    if engine == 'ray':
        return mapped_by_ray(function, items, jobs, time_limit, address)
    return mapped_here(function, items, jobs, time_limit)
