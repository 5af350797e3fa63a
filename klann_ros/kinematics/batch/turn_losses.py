"""Where on the way from a linkage's numbers to others its crank first turns fully no more."""

from sys import float_info

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.kinematics.linkage.linkage import Linkage
from klann_ros.kinematics.linkage.structure import by_name
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import last_nonnegative, minimum_near
import numpy as np

from .turn_clearance import turn_clearances

# As long as nothing is, in the linkage's size.
LONG = 1e3
# Values between a number's own and its farthest, and how many are tried at once, outward.
CANDIDATES, AT_ONCE = 64, 13


class TurnLosses:
    """
    The first loss of the full turn on the way from numbers to their farthest values.

    Parameters
    ----------
    linkage : Linkage
        One whose crank turns fully.
    names : list of str
        The numbers, each to be changed alone.
    farthest : numpy.ndarray, shape (n,)
        Values at or beyond which a loop is no polygon [m or rad]; infinite where there is none.

    """

    def __init__(self, linkage: Linkage, names: list[str], farthest: FloatArray) -> None:
        self._linkage, self._farthest = linkage, farthest
        dimensions = linkage.structure.dimensions
        places = by_name(dimensions)
        self._places = np.array([places[name] for name in names], dtype=np.intp)
        self._own = np.array(linkage.numbers)[self._places]
        self._turns = np.array([dimensions[place].unit == 'rad' for place in self._places])
        # A bend is searched for a whole turn both ways, and what has no end for long.
        most = np.where(self._turns, TURN, LONG * linkage.size)
        self._outward: FloatArray = np.where(
            np.isinf(farthest), np.copysign(most, farthest), farthest - self._own
        )

    def first(self) -> FloatArray:
        """Return the first value of each number, going outward, at which the turn is lost."""
        # The denser the nearer: their roots are even. A length of 0 is no length, so the last is
        # not quite the farthest.
        roots = np.linspace(0.0, 1.0 - 5e-10, CANDIDATES + 1)
        clearances = self._outward_from_own(roots)
        lost = np.fmin.reduce(clearances, axis=2) < 0.0
        # The leg itself turns fully, whatever rounding says.
        lost[:, 0] = False
        limited = lost.any(axis=1)
        first = np.where(limited, lost.argmax(axis=1), CANDIDATES)
        keeps, loses = roots[np.maximum(first - 1, 0)], roots[first]
        for way, before, dip in self._hidden_losses(roots, clearances, first):
            if before < keeps[way]:
                keeps[way], loses[way], limited[way] = before, dip, True
        rows = np.flatnonzero(limited)

        def clearance(of: IndexArray, roots: FloatArray) -> FloatArray:
            own: FloatArray = np.fmin.reduce(self._clearances(rows[of], roots), axis=1)
            return own

        unlimited = self._farthest.copy()
        unlimited[rows] = self._value(rows, last_nonnegative(clearance, keeps[rows], loses[rows]))
        return unlimited

    def _value(self, ways: IndexArray, roots: FloatArray) -> FloatArray:
        value: FloatArray = self._own[ways] + roots**2 * self._outward[ways]
        return value

    def _clearances(self, ways: IndexArray, roots: FloatArray) -> FloatArray:
        numbers = np.repeat(np.array(self._linkage.numbers)[:, None], len(ways), axis=1)
        value = self._value(ways, roots)
        # No bend is beyond a turn.
        value = np.where(self._turns[ways], np.fmod(value, TURN), value)
        numbers[self._places[ways], np.arange(len(ways))] = value
        changes = dict(zip(self._linkage.dimensions, numbers, strict=True))
        return turn_clearances(Variants(self._linkage, changes))

    def _outward_from_own(self, roots: FloatArray) -> FloatArray:
        """Return the clearances on each way up to a first loss; NaN beyond it."""
        ways, blocks = np.arange(len(self._places)), len(self._linkage.blocks)
        found = np.full((len(ways), len(roots), blocks), np.nan)
        for start in range(0, len(roots), AT_ONCE):
            these = np.arange(start, min(start + AT_ONCE, len(roots)))
            way, place = np.repeat(ways, len(these)), np.tile(these, len(ways))
            found[way, place] = self._clearances(way, roots[place])
            lost = np.fmin.reduce(found[ways][:, these[these > 0]], axis=(1, 2)) < 0.0
            ways = ways[~lost]
        return found

    def _hidden_losses(
        self, roots: FloatArray, clearances: FloatArray, first: IndexArray
    ) -> list[tuple[int, float, float]]:
        """Return way, root before and root of each dip between candidates that loses it."""
        inner = clearances[:, 1:-1]
        dips = (inner < clearances[:, :-2]) & (inner <= clearances[:, 2:])
        reached = np.arange(1, CANDIDATES) < first[:, None]
        ways, before, dyads = np.nonzero(dips & reached[:, :, None])
        if not len(ways):
            return []

        def clearance(rows: IndexArray, at: FloatArray) -> FloatArray:
            each = np.repeat(rows, at.shape[1])
            found = self._clearances(ways[each], at.ravel())
            return found[np.arange(at.size), dyads[each]].reshape(at.shape)

        rounding = float_info.epsilon * np.abs(clearances[ways, before + 1, dyads])
        bottom, least = minimum_near(clearance, roots[before + 1], roots[1], rounding)
        lost = least < 0.0
        return list(zip(ways[lost].tolist(), roots[before[lost]], bottom[lost], strict=True))
