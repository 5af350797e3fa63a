"""Where a log has nothing for reasons of its own: a pause of the recorder, or damage."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress

from klann_ros.log.run_parameters import pause_of
import numpy as np
from numpy.typing import NDArray

from .layouts import Times
from .pieces import LAST_TIME

Hole = tuple[int, int]


def pauses(records: Iterable[Mapping[str, str]]) -> Iterator[Hole]:
    """Yield from when to when the recorder paused [ns], as its records say."""
    for record in records:
        with suppress(ValueError):
            pause = pause_of(record)
            yield pause.begin, pause.end


def joined(holes: Iterable[Hole]) -> tuple[Hole, ...]:
    """Return the holes in the order of time [ns], those that overlap as one."""
    found: list[Hole] = []
    bounded = ([max(-LAST_TIME, min(time, LAST_TIME)) for time in hole] for hole in holes)
    for begin, end in sorted(bounded):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        elif begin <= end:
            found.append((begin, end))
    return tuple(found)


def overlap(begins: Times, ends: Times, holes: Sequence[Hole]) -> NDArray[np.bool_]:
    """Return which stretches from begins to ends, shape (n,) [ns], touch a hole; holes joined."""
    if not holes:
        return np.zeros(len(begins), dtype=bool)
    starts, stops = np.array(holes, dtype=np.int64).T
    # The first hole that ends at a stretch's begin or later is the only one that can matter.
    first = np.searchsorted(stops, begins)
    known = first < len(holes)
    touched: NDArray[np.bool_] = known & (starts[np.where(known, first, 0)] <= ends)
    return touched


def covered(begins: Times, ends: Times, holes: Sequence[Hole]) -> Times:
    """Return how much of stretches from begins to ends, shape (n,) [ns], is in holes; joined."""
    if not holes:
        return np.zeros(len(begins), dtype=np.int64)
    starts, stops = np.array(holes, dtype=np.int64).T
    before = np.concatenate([[0], np.cumsum(stops - starts)])

    def until(times: Times) -> Times:
        count = np.searchsorted(starts, times, side='right')
        rest = np.maximum(stops[np.maximum(count, 1) - 1] - times, 0)
        found: Times = before[count] - np.where(count > 0, rest, 0)
        return found

    return until(ends) - until(begins)
