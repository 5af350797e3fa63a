"""What a run says of its legs, gathered block by block."""

from collections.abc import Iterator, Sequence

from klann_ros.review.recording import Series
import numpy as np
from numpy.typing import DTypeLike

from .growing import Growing
from .layouts import Floats, Times
from .shared import Shared


class Columns:
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
        self._times = Growing(np.int64)
        self._stamps = Growing(np.int64)
        self._values = Growing(kind, width)

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


def prefixes(names: Sequence[str], joints: Sequence[str]) -> Iterator[str]:
    """Yield the legs' names all of whose joints are among the names; '' for the unnamed one."""
    known = set(names)
    for name in names:
        prefix, slash, joint = name.rpartition('/')
        if joint == joints[0] and all(f'{prefix}{slash}{other}' in known for other in joints):
            yield prefix
