"""Times, series over time, pairs of equal stamps, and simulated time."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray, IntArray
from klann_ros.log import LAST_TIME
import numpy as np

Interval = tuple[int, int]
"""Begin and end [ns]."""


def time_steps(times: IntArray) -> FloatArray:
    """Return the times between messages, shape (n - 1,) [s]."""
    return np.diff(times) / 1e9


def median(values: FloatArray) -> float:
    """Return the median of at least one number, none NaN, faster than np.median."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    partitioned = np.partition(values, (middle - 1, middle))
    return float((partitioned[middle - 1] + partitioned[middle]) / 2.0)


def merge_intervals(intervals: Iterable[Interval]) -> tuple[Interval, ...]:
    """Return sorted intervals [ns], overlapping ones merged."""
    merged: list[Interval] = []
    bounded = [(_bounded(begin), _bounded(end)) for begin, end in intervals]
    for begin, end in sorted(bounded):
        if merged and begin <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], end)
        elif begin <= end:
            merged.append((begin, end))
    return tuple(merged)


def _bounded(time: int) -> int:
    return max(-LAST_TIME, min(time, LAST_TIME))


def overlaps(begins: IntArray, ends: IntArray, intervals: Sequence[Interval]) -> BoolArray:
    """Return whether [begin, end], shape (n,) [ns], touches one of the merged intervals."""
    if not intervals:
        return np.zeros(len(begins), dtype=bool)
    starts, stops = np.array(intervals, dtype=np.int64).T
    # Only the first interval that ends at the begin or later can overlap.
    first = np.searchsorted(stops, begins)
    exists = first < len(intervals)
    return np.asarray(exists & (starts[np.where(exists, first, 0)] <= ends))


def covered_time(begins: IntArray, ends: IntArray, intervals: Sequence[Interval]) -> IntArray:
    """Return the time of [begin, end], shape (n,) [ns], that merged intervals cover."""
    if not intervals:
        return np.zeros(len(begins), dtype=np.int64)
    starts, stops = np.array(intervals, dtype=np.int64).T
    before = np.concatenate([[0], np.cumsum(stops - starts)])

    def until(times: IntArray) -> IntArray:
        count = np.searchsorted(starts, times, side='right')
        remaining = np.maximum(stops[np.maximum(count, 1) - 1] - times, 0)
        return np.asarray(before[count] - np.where(count > 0, remaining, 0))

    return until(ends) - until(begins)


@dataclass(frozen=True, eq=False)
class Series:
    """
    Values of messages in the order of their log times, shape (n, k).

    The stamps are those of the headers, or their substitute: they match answers with inputs, and
    may have another clock than the log times.
    """

    times: IntArray  # [ns]
    stamps: IntArray  # [ns]
    values: FloatArray

    def __post_init__(self) -> None:
        for array in (self.times, self.stamps, self.values):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.times)

    def rows(self, rows: slice | BoolArray) -> 'Series':
        """Return some of the rows."""
        return Series(self.times[rows], self.stamps[rows], self.values[rows])

    def finite(self) -> 'Series':
        """Return the rows whose numbers are all finite."""
        is_finite: BoolArray = np.isfinite(self.values).all(axis=1)  # type: ignore[assignment]
        return self if is_finite.all() else self.rows(is_finite)

    def since(self, time: int) -> 'Series':
        """Return the rows logged at a time or later."""
        return self.rows(slice(int(np.searchsorted(self.times, time)), None))


def no_series(width: int) -> Series:
    """Return a series without any row."""
    nothing = np.empty(0, dtype=np.int64)
    return Series(nothing, nothing.copy(), np.empty((0, width)))


def merged(parts: Sequence[Series], width: int) -> Series:
    """Return several series of a width as one, by the log times."""
    if not parts:
        return no_series(width)
    series = parts[0]
    if len(parts) > 1:
        series = Series(
            np.concatenate([part.times for part in parts]),
            np.concatenate([part.stamps for part in parts]),
            np.concatenate([part.values for part in parts]),
        )
    if (np.diff(series.times) < 0).any():
        order = np.argsort(series.times, kind='stable')
        series = Series(series.times[order], series.stamps[order], series.values[order])
    return series


class SeriesPool:
    """Makes series of equal arrays of times share them, which saves memory."""

    def __init__(self) -> None:
        self._arrays: dict[tuple[int, int, int], list[IntArray]] = {}

    def share(self, times: IntArray) -> IntArray:
        """Return an array with these times."""
        if not len(times):
            return times
        key = (len(times), int(times[0]), int(times[-1]))
        similar = self._arrays.setdefault(key, [])
        for shared_times in similar:
            if np.array_equal(shared_times, times):
                return shared_times
        similar.append(times)
        return times

    def series(self, parts: Sequence[Series], width: int) -> Series:
        """Return several series of a width as one, by its log times."""
        series = merged(parts, width)
        return Series(self.share(series.times), self.share(series.stamps), series.values)


def pairs(first: IntArray, second: IntArray) -> tuple[IndexArray, IndexArray]:
    """
    Return the pairs of rows with equal stamps, in the order of the second.

    Under a simulated clock many rows share a stamp: then the k-th row belongs to the k-th. If the
    counts of a stamp differ, none of its rows is paired.
    """
    if len(first) == len(second) and (first == second).all() and is_monotonic(first):
        rows = np.arange(len(first), dtype=np.intp)
        return rows, rows
    first_rows = np.argsort(first, kind='stable')
    second_rows = np.argsort(second, kind='stable')
    first_stamps = first[first_rows]
    second_stamps = second[second_rows]
    first_rows = first_rows[_have_equal_counts(first_stamps, first_stamps, second_stamps)]
    second_rows = second_rows[_have_equal_counts(second_stamps, first_stamps, second_stamps)]
    order = np.argsort(second_rows, kind='stable')
    return first_rows[order], second_rows[order]


def _have_equal_counts(stamps: IntArray, first: IntArray, second: IntArray) -> BoolArray:
    """Return whether each stamp is as often among the first as among the second, both sorted."""
    return np.asarray(_counts(stamps, first) == _counts(stamps, second))


def alone(stamps: IntArray) -> IndexArray:
    """Return the rows with a unique stamp."""
    if is_monotonic(stamps):
        return np.arange(len(stamps))
    _, rows, counts = np.unique(stamps, return_index=True, return_counts=True)
    return np.sort(rows[counts == 1])


def match_stamps(stamps: IntArray, single: IntArray) -> tuple[IndexArray, IndexArray]:
    """Return the rows with a stamp in the unique stamps `single`, and its index there."""
    if not len(single):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    # Usually sorted; intersect1d needs five times the memory.
    order = None if is_monotonic(single) else np.argsort(single, kind='stable')
    ordered = single if order is None else single[order]
    indices = np.searchsorted(ordered, stamps)
    np.minimum(indices, len(ordered) - 1, out=indices)
    matched = np.flatnonzero(ordered[indices] == stamps)
    return matched, indices[matched] if order is None else order[indices[matched]]


def isin(stamps: IntArray, among: IntArray) -> BoolArray:
    """Return whether each stamp is in `among`, as np.isin."""
    is_among = np.zeros(len(stamps), dtype=bool)
    matched, _ = match_stamps(stamps, among if is_monotonic(among) else np.unique(among))
    is_among[matched] = True
    return is_among


class StampCounts(NamedTuple):
    """Number of occurrences of k stamps."""

    stamps: IntArray  # the unique stamps of the first, sorted
    of_first: IndexArray  # index of each of the first in `stamps`
    first: IndexArray  # count of each in the first
    second: IndexArray  # count of each in the second


def count_stamps(first: IntArray, second: IntArray) -> StampCounts:
    """Count each stamp of the first in both arrays."""
    stamps, of_first, counts = np.unique(first, return_inverse=True, return_counts=True)
    return StampCounts(stamps, of_first, counts, _counts(stamps, np.sort(second)))


def _counts(stamps: IntArray, ordered: IntArray) -> IndexArray:
    """Return how often each stamp is among sorted ones."""
    ends = np.searchsorted(ordered, stamps, side='right')
    return np.asarray(ends - np.searchsorted(ordered, stamps, side='left'))


def is_monotonic(stamps: IntArray) -> bool:
    """Return whether each stamp is later than the one before."""
    return bool((np.diff(stamps) > 0).all())


CLOCK = '/clock'
# Log times are simulated if they agree with /clock in the median [s].
_CLOCK_TOLERANCE = 0.5
# A paused simulation: largest rate of simulated time, shortest duration [s].
_MAX_PAUSE_RATE = 0.1
_MIN_PAUSE = 0.05


def is_time_of_log(clock: Series) -> bool:
    """Return whether log times are simulated (`ros2 bag record --use-sim-time`)."""
    return bool(len(clock)) and abs(median((clock.times - clock.stamps) / 1e9)) < _CLOCK_TOLERANCE


def is_simulated(series: Series, clock: Series) -> bool:
    """Return whether the stamps of a series are nearer to /clock than to the log times."""
    if not (len(series) and len(clock)) or is_time_of_log(clock):
        return False
    return abs(median(offsets(series, clock))) < abs(median((series.stamps - series.times) / 1e9))


def offsets(series: Series, clock: Series) -> FloatArray:
    """Return the offsets of the stamps to /clock at their log times [s]."""
    start = int(clock.times[0])
    start_stamp = int(clock.stamps[0])
    log_times = (clock.times - start) / 1e9
    clock_times = (clock.stamps - start_stamp) / 1e9
    simulated = np.interp((series.times - start) / 1e9, log_times, clock_times)
    return np.asarray((series.stamps - start_stamp) / 1e9 - simulated)


def resolution(clock: Series) -> float:
    """Return the step of simulated log times [s]; 0 for others."""
    if len(clock) < 2 or not is_time_of_log(clock):
        return 0.0
    return median(np.diff(clock.stamps) / 1e9)


def pauses(clock: Series) -> Iterator[Interval]:
    """Yield the pauses of simulated time, log times [ns]."""
    steps = time_steps(clock.times)
    simulated_steps = time_steps(clock.stamps)
    is_slow = (steps > _MIN_PAUSE) & (simulated_steps < _MAX_PAUSE_RATE * steps)
    for row in np.flatnonzero((simulated_steps <= 0.0) | is_slow).tolist():
        yield int(clock.times[row]), int(clock.times[row + 1])
