"""
The branch of coupled loops: what a linkage reaches from its start when the crank is turned.

There is no closed form for coupled loops. Their branch is followed once, in small steps, without
passing a singular pose, and kept as a table. A guess at any crank angle is the nearest pose in it,
led on along its tangent.
"""

from bisect import bisect_left
from collections.abc import Sequence
from math import isnan, pi
from operator import itemgetter
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import GeometryError, LoopsOpenError
import numpy as np

from .equations import LoopEquations
from .step import step, TRUSTED

# Between the table's poses [rad]: an eighth of what a tangent of the Klann leg may lead astray.
STEP = 0.05
# Where steps smaller than this fail the branch ends [rad].
SHORTEST = 1e-9
TOLERANCE, ITERATIONS = 1e-9, 6
# Of what a step returns: see LinkagePose, which is above all this.
X_AND_RATES = itemgetter(1, 5)


class Row(NamedTuple):
    """A pose: crank angle, the other angles and their derivatives [rad]."""

    alpha: float
    x: tuple[float, ...]
    x_1: tuple[float, ...]

    def ahead(self, step: float) -> tuple[float, ...]:
        """Return the angles a step of the crank further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.x_1, strict=True))


class Branch:
    """
    The poses of a linkage along its branch, over a whole turn or an arc.

    Parameters
    ----------
    linkage : LoopEquations
        Of one that ends with coupled loops.
    start : sequence of float
        A pose of it: every coordinate, the crank's angle first [rad, m].
    block : int
        Which block these are, from 1.

    Raises
    ------
    GeometryError
        It is nearly singular at its start, or not back there after a turn.

    """

    def __init__(self, linkage: LoopEquations, start: Sequence[float], block: int) -> None:
        self._block, self._refine = block, step(linkage, tuple).refine
        alpha, *x = start
        first = self._row(alpha, tuple(x))
        if first is None:
            msg = (
                'its coupled loops cannot be followed from the start: it is nearly singular there'
            )
            raise GeometryError(msg)
        rows = self._walk(first, 1.0)
        if not _is_closed(linkage, rows):
            rows = _one_turn([*reversed(self._walk(first, -1.0)[1:]), *rows], alpha)
        self._rows = rows
        self._first, self._last = rows[0].alpha, rows[-1].alpha
        self._is_turn = _is_closed(linkage, rows)
        self._check_seam()

    @property
    def arc(self) -> Arc:
        """Return the crank angles of its ends [rad]; (0, 2 pi) for a whole turn."""
        return (0.0, TURN) if self._is_turn else (self._first, self._last)

    def x(self, alpha: float) -> tuple[float, ...]:
        """
        Return the angles at a crank angle [rad].

        A LoopsOpenError says that the crank angle is not on the branch.
        """
        at = self._within(alpha)
        near = self._near(at)
        if self._first <= at <= self._last:
            row = self._refined(alpha, near.ahead(at - near.alpha))
            if row is not None:
                return row.x
        raise LoopsOpenError(alpha, self._block, alpha + near.alpha - at)

    def guesses(self, alphas: FloatArray) -> FloatArray:
        """Return guesses of the angles at many crank angles, shape (n - 1, k); NaN beyond it."""
        rows = [np.array(column) for column in zip(*self._rows, strict=True)]
        at = self._first + np.remainder(alphas - self._first, TURN)
        right = np.searchsorted(rows[0], at).clip(1, len(self._rows) - 1)
        near = right - (at - rows[0][right - 1] < rows[0][right] - at)
        found = rows[1][near] + (at - rows[0][near])[:, None] * rows[2][near]
        found[at > self._last] = np.nan
        angles: FloatArray = found.T
        return angles

    def _row(self, alpha: float, guess: tuple[float, ...]) -> Row | None:
        """Return the pose at a crank angle; None where the guess does not lead to it safely."""
        row = self._refined(alpha, guess)
        return None if row is None or isnan(row.x_1[0]) else row

    def _refined(self, alpha: float, guess: tuple[float, ...]) -> Row | None:
        found = self._refine(alpha, guess, TOLERANCE, ITERATIONS)
        return None if found is None else Row(alpha, *X_AND_RATES(found))

    def _walk(self, first: Row, direction: float) -> list[Row]:
        """Return the poses from the first on, for a whole turn or until the branch ends."""
        rows, length = [first], STEP
        while abs(rows[-1].alpha - first.alpha) < TURN and length > SHORTEST:
            guess = rows[-1].ahead(direction * length)
            row = self._row(rows[-1].alpha + direction * length, guess)
            if row is None:
                length /= 2.0
            else:
                rows.append(row)
                length = min(STEP, 2.0 * length)
        return rows

    def _check_seam(self) -> None:
        """Refuse a crank that can turn on to where the linkage is put together in another way."""
        if self._is_turn or self._last - self._first < TURN - 2.0 * STEP:
            return
        try:
            self.x(self._first + 2.0 * STEP)
            self.x(self._last - 2.0 * STEP)
        except LoopsOpenError:
            return
        msg = (
            'its coupled loops are not back where they were after a turn of the crank: one crank '
            'angle has two poses, and such a linkage is not solved'
        )
        raise GeometryError(msg)

    def _within(self, alpha: float) -> float:
        """Return the crank angle, less whole turns, on the branch or nearest to it."""
        middle = (self._first + self._last) / 2.0
        return alpha - TURN * round((alpha - middle) / TURN)

    def _near(self, at: float) -> Row:
        i = bisect_left(self._rows, at, key=lambda row: row.alpha)
        neighbours = self._rows[slice(max(0, i - 1), i + 1)]
        return min(neighbours, key=lambda row: abs(row.alpha - at))


def _is_closed(linkage: LoopEquations, rows: Sequence[Row]) -> bool:
    """Return whether rows are a whole turn, after which the loops are back where they were."""
    start, end = rows[0], rows[-1]
    if end.alpha - start.alpha < TURN:
        return False
    back = end.ahead(start.alpha + TURN - end.alpha)
    return max(map(abs, linkage.differences(back, start.x))) <= TRUSTED


def _one_turn(rows: list[Row], start: float) -> list[Row]:
    """Return the rows of one turn around the start; on a longer branch an angle has two poses."""
    if rows[-1].alpha - rows[0].alpha < TURN:
        return rows
    first = min(max(rows[0].alpha, start - pi), rows[-1].alpha - TURN)
    return [row for row in rows if first <= row.alpha <= first + TURN]
