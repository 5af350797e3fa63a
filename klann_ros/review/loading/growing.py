"""An array that grows at its end, without ever being there twice."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

_FIRST = 1024


class Growing:
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
