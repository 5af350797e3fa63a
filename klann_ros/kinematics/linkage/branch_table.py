"""A branch of coupled loops as a table of poses, from which a guess at any crank angle follows."""

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN, wrap
from klann_ros.kinematics.arcs import Arc
from klann_ros.kinematics.errors import LoopsOpenError

# A tangent that needs more correction than this is not trusted to stay on its branch [rad].
TRUSTED = 0.05


class Row(NamedTuple):
    """A pose of coupled loops: crank angle, its angles and their derivatives [rad]."""

    alpha: float
    x: tuple[float, ...]
    x_1: tuple[float, ...]

    def ahead(self, step: float) -> tuple[float, ...]:
        """Return the angles a step of the crank further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.x_1, strict=True))


class BranchTable:
    """
    The poses of coupled loops along a branch, over a whole turn or an arc.

    Parameters
    ----------
    block : int
        Which block of the linkage they are, from 1.
    rows : sequence of Row
        The poses, by rising crank angle.

    """

    def __init__(self, block: int, rows: Sequence[Row]) -> None:
        """Keep the rows."""
        self._block = block
        self._rows = rows
        self._first, self._last = rows[0].alpha, rows[-1].alpha
        self._is_turn = self.is_closed(rows)

    @staticmethod
    def is_closed(rows: Sequence[Row]) -> bool:
        """Return whether rows are a whole turn, after which the loops are back where they were."""
        start, end = rows[0], rows[-1]
        if end.alpha - start.alpha < TURN:
            return False
        back = end.ahead(start.alpha + TURN - end.alpha)
        return max(abs(wrap(a - b)) for a, b in zip(back, start.x, strict=True)) <= TRUSTED

    def guess(self, alpha: float) -> tuple[float, ...]:
        """
        Return the angles at a crank angle: those of the nearest pose, led on along its tangent.

        Raises
        ------
        LoopsOpenError
            The crank angle is not on the branch.

        """
        at = self._within(alpha)
        near = self._near(at)
        if not self._first <= at <= self._last:
            raise LoopsOpenError(alpha, self._block, self.nearest(alpha))
        return near.ahead(at - near.alpha)

    def nearest(self, alpha: float) -> float:
        """Return the crank angle of the nearest row [rad]."""
        at = self._within(alpha)
        return alpha + self._near(at).alpha - at

    @property
    def arc(self) -> Arc:
        """Return the crank angles of its ends [rad]; (0, 2 pi) for a whole turn."""
        return (0.0, TURN) if self._is_turn else (self._first, self._last)

    def _within(self, alpha: float) -> float:
        """Return the crank angle, less whole turns, on the branch or nearest to it."""
        middle = (self._first + self._last) / 2.0
        return alpha - TURN * round((alpha - middle) / TURN)

    def _near(self, at: float) -> Row:
        i = bisect_left(self._rows, at, key=lambda row: row.alpha)
        neighbours = self._rows[slice(max(0, i - 1), i + 1)]
        return min(neighbours, key=lambda row: abs(row.alpha - at))
