"""How much each number of a linkage may change before the crank loses its full turn."""

from math import inf, pi
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc, GOLDEN
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.reach import reachable_arcs
from klann_ros.kinematics.linkage.structure import by_name, Dimension, Structure
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np
from numpy.typing import NDArray

from .program import Array
from .turn_clearance import turn_clearances

Indices = NDArray[np.intp]
# Values between a number's own and the farthest that could close at all.
CANDIDATES = 64


class PartialTurnError(KinematicsError):
    """
    A leg whose crank does not turn fully, so that there is no full turn to lose.

    Attributes
    ----------
    arcs : list of (float, float)
        Where the crank can be: start and end of each arc [rad].

    """

    def __init__(self, arcs: list[Arc]) -> None:
        """Keep the arcs."""
        super().__init__(arcs)
        self.arcs = arcs

    def __str__(self) -> str:
        arcs = ', '.join(f'{a * 180 / pi:.3f} .. {b * 180 / pi:.3f}' for a, b in self.arcs)
        return f'the crank does not turn fully, and has no margins: it reaches {arcs} deg'


class Margin(NamedTuple):
    """
    The range of one number within which the crank turns fully, all others unchanged.

    Attributes
    ----------
    value : float
        The number as it is [m or rad].
    least, greatest : float
        The ends of the range [m or rad]; least is 0 where a length has no other limit, and a
        number without limit has -inf and inf.

    """

    value: float
    least: float
    greatest: float

    @property
    def changes(self) -> tuple[float, float]:
        """Return by how much it may change down and up, <= 0 and >= 0 [m or rad]."""
        return self.least - self.value, self.greatest - self.value

    @property
    def relative(self) -> tuple[float, float]:
        """Return the changes as parts of its magnitude; of a number that is 0, +-inf."""
        if self.value == 0.0:
            return -inf, inf
        down, up = self.changes
        return down / abs(self.value), up / abs(self.value)


def turns_fully(linkage: Any) -> bool:
    """
    Return whether every loop closes all round the crank's turn.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.

    Raises
    ------
    TypeError
        It is none of these.

    """
    return reachable_arcs(linkage) == [(0.0, TURN)]


def length_margins(linkage: Any) -> dict[str, Margin]:
    """
    Return for every number of a linkage the range within which its crank still turns fully.

    Only one number is changed at a time, and the range is that around its own value: beyond it
    the crank may turn fully again. It ends where the least clearance of all dyads over the turn
    (`turn_clearances`) is 0, to about 1e-12 of the number.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        A linkage whose crank turns fully.

    Returns
    -------
    dict of str to Margin
        By the names of its dimensions [m, rad]: of a Klann leg 7 lengths, 4 pivot coordinates and
        2 bends.

    Raises
    ------
    PartialTurnError
        The crank does not turn fully as it is.
    TypeError
        `linkage` is none of these.

    """
    given = as_linkage(linkage)
    arcs = reachable_arcs(given)
    if arcs != [(0.0, TURN)]:
        raise PartialTurnError(arcs)
    dimensions = given.structure.dimensions
    bound = [d for d in dimensions if _loops_of(given.structure, d)]
    farthest = np.array([_farthest(given, dimension) for dimension in bound])
    names = [dimension.name for dimension in bound]
    search = _Search(given, [*names, *names], farthest.T.ravel())
    least, greatest = search.first_losses().reshape(2, -1).tolist()
    found = {
        name: Margin(given.dimensions[name], low, high)
        for name, low, high in zip(names, least, greatest, strict=True)
    }
    free = {
        d.name: Margin(given.dimensions[d.name], 0.0 if d.is_length else -inf, inf)
        for d in dimensions
    }
    return free | found


def _loops_of(structure: Structure, dimension: Dimension) -> list[int]:
    """Return the loops that a number is in; a braced bar depends on all numbers of its body."""
    loops = structure.paths.loops
    if dimension.kind in ('x', 'y'):
        return [k for k, path in enumerate(loops) if dimension.place in dict(path.pivots)]
    body = structure.bars[dimension.place][0]
    touched = {
        number
        for number, (own, bar) in enumerate(structure.bars)
        if number == dimension.place or (own == body and bar.brace is not None)
    }
    return [k for k, path in enumerate(loops) if touched & dict(path.bars).keys()]


def _farthest(linkage: Linkage, dimension: Dimension) -> tuple[float, float]:
    """Return values at or beyond which a loop is no polygon, or that mean no change at all."""
    value = linkage.dimensions[dimension.name]
    if dimension.kind == 'bend':
        return value - TURN, value + TURN
    paths = linkage.structure.paths.loops
    loops = _loops_of(linkage.structure, dimension)
    if dimension.is_length:
        totals = []
        for k in loops:
            terms, constant = linkage.rows[k]
            totals.append(sum(map(abs, terms.values())) + abs(constant))
        own = dimension.kind == 'length' and all(
            dimension.place in dict(paths[k].bars) for k in loops
        )
        # What only braces another bar is bounded by its triangle, and that by its loops.
        return 0.0, min(totals) - value if own else sum(totals) + 2.0 * value
    ranges = []
    for k in loops:
        terms, _ = linkage.rows[k]
        reach = sum(map(abs, terms.values()))
        others = [place for place, _ in paths[k].pivots if place != dimension.place]
        at = [linkage.pivots[place] for place in others]
        origin = sum((p.real if dimension.kind == 'x' else p.imag for p in at), 0.0)
        ranges.append((origin - reach, origin + reach))
    return max(low for low, _ in ranges), min(high for _, high in ranges)


class _Search:
    """The first loss of the full turn on the way from numbers to their farthest values."""

    def __init__(self, linkage: Linkage, names: list[str], farthest: Array) -> None:
        self._linkage, self._farthest = linkage, farthest
        dimensions = linkage.structure.dimensions
        places = by_name(dimensions)
        self._places = np.array([places[name] for name in names])
        self._own = np.array(linkage.numbers)[self._places]
        self._outward: Array = farthest - self._own
        self._bounded = np.array([dimensions[place].unit == 'm' for place in self._places])

    def first_losses(self) -> Array:
        """Return the first value of each number, going outward, at which the turn is lost."""
        ways = np.arange(len(self._places))
        # The denser the nearer. A length of 0 is no length, so the last is not quite the farthest.
        shares = np.linspace(0.0, 1.0 - 1e-9, CANDIDATES + 1) ** 2
        each_way, each_share = np.repeat(ways, len(shares)), np.tile(shares, len(ways))
        clearances = self._clearances(each_way, each_share)
        clearances = clearances.reshape(len(ways), len(shares), -1)
        lost = clearances.min(axis=2) < 0.0
        # The leg itself turns fully, whatever rounding says.
        lost[:, 0] = False
        limited = lost.any(axis=1)
        first = np.where(limited, lost.argmax(axis=1), len(shares) - 1)
        keeps, loses = shares[np.maximum(first - 1, 0)], shares[first]
        for way, left, dip in self._hidden_losses(shares, clearances, first):
            if left < keeps[way]:
                keeps[way], loses[way], limited[way] = left, dip, True
        shares = self._bisected(keeps, loses)
        unlimited = np.where(self._bounded, self._farthest, np.copysign(inf, self._outward))
        return np.where(limited, self._value(ways, shares), unlimited)

    def _value(self, ways: Indices, shares: Array) -> Array:
        value: Array = self._own[ways] + shares * self._outward[ways]
        return value

    def _clearances(self, ways: Indices, shares: Array) -> Array:
        numbers = np.repeat(np.array(self._linkage.numbers)[:, None], len(ways), axis=1)
        # A bend is searched for a whole turn both ways; none is beyond one.
        value = self._value(ways, shares)
        value = np.where(self._bounded[ways], value, np.fmod(value, TURN))
        numbers[self._places[ways], np.arange(len(ways))] = value
        changes = dict(zip(self._linkage.dimensions, numbers, strict=True))
        return turn_clearances(Variants(self._linkage, changes))

    def _hidden_losses(
        self, shares: Array, clearances: Array, first: Array
    ) -> list[tuple[int, float, float]]:
        """Return way, share before and share of each dip between candidates that loses it."""
        inner = clearances[:, 1:-1]
        dips = (inner < clearances[:, :-2]) & (inner <= clearances[:, 2:])
        reached = np.arange(inner.shape[1]) + 1 < first[:, None]
        ways, before, dyads = np.nonzero(dips & reached[:, :, None])
        if not len(ways):
            return []

        def clearance(shares: Array) -> Array:
            own: Array = self._clearances(ways, shares)[np.arange(len(ways)), dyads]
            return own

        left, right = shares[before], shares[before + 2]
        for _ in range(40):
            a, b = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
            lower = clearance(a) < clearance(b)
            left, right = np.where(lower, left, a), np.where(lower, b, right)
        bottom = (left + right) / 2.0
        lost = clearance(bottom) < 0.0
        return list(zip(ways[lost].tolist(), shares[before[lost]], bottom[lost], strict=True))

    def _bisected(self, keeps: Array, loses: Array) -> Array:
        """Return the last shares that keep the full turn."""
        ways = np.arange(len(keeps))
        for _ in range(60):
            middle = (keeps + loses) / 2.0
            kept = self._clearances(ways, middle).min(axis=1) >= 0.0
            keeps, loses = np.where(kept, middle, keeps), np.where(kept, loses, middle)
        return keeps
