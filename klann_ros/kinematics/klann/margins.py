"""How much each length, pivot and bend of a leg may change before the full turn is lost."""

from math import hypot, inf, pi
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc, GOLDEN
from klann_ros.kinematics.errors import KinematicsError
import numpy as np

from .geometry import BENDS, COORDINATES, KlannGeometry, LENGTHS, NUMBERS
from .reach import reachable_arcs
from .turn_clearance import Array, Indices, turn_clearances

# Values between a number's own and the farthest that could close at all.
CANDIDATES = 64
# Neither touches a dyad.
FREE = ('l_gh', 'angle_fgh')


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


def turns_fully(geometry: KlannGeometry) -> bool:
    """
    Return whether both dyads close all round the crank's turn.

    Parameters
    ----------
    geometry : KlannGeometry
        The leg.

    Raises
    ------
    TypeError
        `geometry` is no KlannGeometry.

    """
    return reachable_arcs(geometry) == [(0.0, TURN)]


def length_margins(geometry: KlannGeometry) -> dict[str, Margin]:
    """
    Return for every number of a leg the range within which its crank still turns fully.

    Only one number is changed at a time, and the range is that around its own value: beyond it
    the crank may turn fully again. It ends where the least clearance of both dyads over the turn
    (`turn_clearances`) is 0, to about 1e-12 of the number.

    Parameters
    ----------
    geometry : KlannGeometry
        A leg whose crank turns fully.

    Returns
    -------
    dict of str to Margin
        The 7 lengths and 4 pivot coordinates [m] and 2 bends [rad], by their names.

    Raises
    ------
    PartialTurnError
        The crank does not turn fully as it is.
    TypeError
        `geometry` is no KlannGeometry.

    """
    arcs = reachable_arcs(geometry)
    if arcs != [(0.0, TURN)]:
        raise PartialTurnError(arcs)
    numbers = [name for name in NUMBERS if name not in FREE]
    farthest = [_farthest(geometry, name) for name in numbers]
    search = _Search(geometry, [*numbers, *numbers], np.transpose(farthest).ravel())
    least, greatest = search.first_losses().reshape(2, -1).tolist()
    margins = {
        name: Margin(getattr(geometry, name), low, high)
        for name, low, high in zip(numbers, least, greatest, strict=True)
    }
    margins['l_gh'] = Margin(geometry.l_gh, 0.0, inf)
    margins['angle_fgh'] = Margin(geometry.angle_fgh, -inf, inf)
    return {name: margins[name] for name in NUMBERS}


def _farthest(geometry: KlannGeometry, name: str) -> tuple[float, float]:
    """Return values at or beyond which a loop is no polygon, or that mean no change at all."""
    g = geometry
    value = getattr(g, name)
    loop_1 = (g.l_ab, g.l_bc, g.l_dc)
    loop_2 = (g.l_dc, g.l_cg, g.l_ef, g.l_fg)
    if name in BENDS:
        return value - TURN, value + TURN
    if name in LENGTHS:
        first = name in ('l_ab', 'l_bc', 'l_dc')
        others = sum(loop_1) + hypot(g.x_d, g.y_a) if first else sum(loop_2)
        return 0.0, others - value + (0.0 if first else hypot(g.x_e - g.x_d, g.y_e))
    reach = sum(loop_2) if name in ('x_e', 'y_e') else sum(loop_1)
    origin = g.x_d if name == 'x_e' else 0.0
    return origin - reach, origin + reach


class _Search:
    """The first loss of the full turn on the way from a leg's numbers to their farthest values."""

    def __init__(self, geometry: KlannGeometry, names: list[str], farthest: Array) -> None:
        self._assembly = geometry.assembly
        self._leg = np.array([getattr(geometry, name) for name in NUMBERS])
        self._columns = np.array([NUMBERS.index(name) for name in names])
        self._farthest = farthest
        self._bounded = np.array([name in LENGTHS + COORDINATES for name in names])

    def first_losses(self) -> Array:
        """Return the first value of each number, going outward, at which the turn is lost."""
        ways = np.arange(len(self._columns))
        # The denser the nearer. A length of 0 is no length, so the last is not quite the farthest.
        shares = np.linspace(0.0, 1.0 - 1e-9, CANDIDATES + 1) ** 2
        each_way, each_share = np.repeat(ways, len(shares)), np.tile(shares, len(ways))
        clearances = self._clearances(each_way, each_share).reshape(len(ways), -1, 2)
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

    @property
    def _outward(self) -> Array:
        outward: Array = self._farthest - self._leg[self._columns]
        return outward

    def _value(self, ways: Indices, shares: Array) -> Array:
        value: Array = self._leg[self._columns[ways]] + shares * self._outward[ways]
        return value

    def _clearances(self, ways: Indices, shares: Array) -> Array:
        legs = np.tile(self._leg, (len(ways), 1))
        legs[np.arange(len(ways)), self._columns[ways]] = self._value(ways, shares)
        return turn_clearances(legs, self._assembly)

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
