"""Series that come block by block: arrays that grow, and are kept once."""

from typing import Any

from klann_ros.review.model.recording import Series
from klann_ros.review.model.times import Floats, Times
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

_FIRST = 1024


class GrowingArray:
    """
    Rows of numbers whose count is known at the end only.

    Lists of small arrays that are joined at the end need twice the memory: what they held is
    scattered, and stays with the process.

    Parameters
    ----------
    kind : data type
        Of the numbers.
    width : int
        How many numbers a row has; 0 for rows that are numbers themselves.

    """

    def __init__(self, kind: DTypeLike, width: int = 0) -> None:
        self._columns = (width,) if width else ()
        self._rows: NDArray[Any] = np.empty((_FIRST, *self._columns), dtype=kind)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, rows: ArrayLike) -> None:
        """Append rows."""
        new = np.asarray(rows)
        begin, self._count = self._count, self._count + len(new)
        if self._count > len(self._rows):
            # The system moves pages, not bytes, and gives none before they are written to.
            room = max(self._count, len(self._rows) * 3 // 2)
            self._rows.resize((room, *self._columns), refcheck=False)
        self._rows[slice(begin, self._count)] = new

    def array(self) -> NDArray[Any]:
        """Return all rows; nothing can be added any more."""
        self._rows.resize((self._count, *self._columns), refcheck=False)
        return self._rows


class Shared:
    """Gives for each array of times one that is equal, the same for all that are."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int, int], list[Times]] = {}

    def one(self, times: Times) -> Times:
        """Return an array with these times."""
        if not len(times):
            return times
        alike = self._known.setdefault((len(times), int(times[0]), int(times[-1])), [])
        for known in alike:
            if np.array_equal(known, times):
                return known
        alike.append(times)
        return times


class SeriesColumns:
    """
    Log times, stamps and numbers that come block by block and are wanted as one series.

    Parameters
    ----------
    width : int
        How many numbers a row has.
    kind : data type
        Of the numbers.

    """

    def __init__(self, width: int, kind: DTypeLike = np.float64) -> None:
        self._times = GrowingArray(np.int64)
        self._stamps = GrowingArray(np.int64)
        self._values = GrowingArray(kind, width)

    def add(self, times: Times, stamps: Times, values: Floats) -> None:
        """Add rows: log times and stamps [ns], shape (n,), and values, shape (n, width)."""
        self._times.add(times)
        self._stamps.add(stamps)
        self._values.add(values)

    def series(self, shared: Shared) -> Series:
        """Return all rows by their log times; nothing can be added any more."""
        times, stamps, values = (
            column.array() for column in (self._times, self._stamps, self._values)
        )
        if (np.diff(times) < 0).any():
            order = np.argsort(times, kind='stable')
            times, stamps, values = times[order], stamps[order], values[order]
        return Series(shared.one(times), shared.one(stamps), values)
