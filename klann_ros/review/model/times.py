"""Times of a run in nanoseconds, and the stretches in which a log has nothing to say."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
RowIndices = NDArray[np.intp]
Flags = NDArray[np.bool_]
# Differences of two times fit in 64 bits with a sign; this one is in the year 2116.
LAST_TIME = 2**62
Hole = tuple[int, int]
"""From when to when [ns]."""


def nanoseconds(times: NDArray[np.uint64]) -> Times:
    """Return times as numbers with a sign: a log may hold any 64 bits."""
    signed: Times = np.minimum(times, np.uint64(LAST_TIME)).astype(np.int64)
    return signed


def intervals(times: Times) -> Floats:
    """Return the times between messages, shape (n - 1,) [s]."""
    return np.diff(times) / 1e9


def median(values: Floats) -> float:
    """Return the median of numbers, none of them NaN; NumPy's takes long for what it looks at."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    both = np.partition(values, (middle - 1, middle))
    return float((both[middle - 1] + both[middle]) / 2.0)


def merged(holes: Iterable[Hole]) -> tuple[Hole, ...]:
    """Return the holes in the order of time [ns], those that overlap as one."""
    found: list[Hole] = []
    bounded = ([max(-LAST_TIME, min(time, LAST_TIME)) for time in hole] for hole in holes)
    for begin, end in sorted(bounded):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        elif begin <= end:
            found.append((begin, end))
    return tuple(found)


def overlap(begins: Times, ends: Times, holes: Sequence[Hole]) -> Flags:
    """Return which stretches from begins to ends, shape (n,) [ns], touch a hole; holes joined."""
    if not holes:
        return np.zeros(len(begins), dtype=bool)
    starts, stops = np.array(holes, dtype=np.int64).T
    # The first hole that ends at a stretch's begin or later is the only one that can matter.
    first = np.searchsorted(stops, begins)
    known = first < len(holes)
    touched: Flags = known & (starts[np.where(known, first, 0)] <= ends)
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
