"""Build series of numbers block by block."""

from typing import Any

from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.review.model.times import Series
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

_INITIAL_ROWS = 1024


class GrowingArray:
    """An array that grows by rows of `width` numbers, 0 for rows that are numbers themselves."""

    def __init__(self, kind: DTypeLike, width: int = 0) -> None:
        self._columns = (width,) if width else ()
        self._rows: NDArray[Any] = np.empty((_INITIAL_ROWS, *self._columns), dtype=kind)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, new_rows: ArrayLike) -> None:
        """Append rows."""
        added = np.asarray(new_rows)
        begin = self._count
        self._count += len(added)
        if self._count > len(self._rows):
            # realloc moves pages, not bytes: half the memory of joined arrays.
            capacity = max(self._count, len(self._rows) * 3 // 2)
            self._rows.resize((capacity, *self._columns), refcheck=False)
        self._rows[slice(begin, self._count)] = added

    def array(self) -> NDArray[Any]:
        """Return all rows; nothing can be added any more."""
        self._rows.resize((self._count, *self._columns), refcheck=False)
        return self._rows


class ArrayPool:
    """Shares equal arrays of times, which saves memory."""

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


class SeriesColumns:
    """Builds a series of log times, stamps and rows of numbers, block by block."""

    def __init__(self, width: int, kind: DTypeLike = np.float64) -> None:
        self._times = GrowingArray(np.int64)
        self._stamps = GrowingArray(np.int64)
        self._numbers = GrowingArray(kind, width)

    def __len__(self) -> int:
        return len(self._times)

    def add(self, times: IntArray, stamps: IntArray, numbers: FloatArray) -> None:
        """Add log times and stamps [ns], shape (n,), and numbers, shape (n, width)."""
        self._times.add(times)
        self._stamps.add(stamps)
        self._numbers.add(numbers)

    def series(self, shared: ArrayPool) -> Series:
        """Return all rows by their log times; nothing can be added any more."""
        times = self._times.array()
        stamps = self._stamps.array()
        numbers = self._numbers.array()
        if (np.diff(times) < 0).any():
            order = np.argsort(times, kind='stable')
            times = times[order]
            stamps = stamps[order]
            numbers = numbers[order]
        return Series(shared.share(times), shared.share(stamps), numbers)
