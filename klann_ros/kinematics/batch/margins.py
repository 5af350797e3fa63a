"""Margins: the range of each dimension of a linkage within which its crank turns fully."""

from dataclasses import dataclass
from html import escape
from math import inf, pi
from sys import float_info
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.reach import reachable_arcs
from klann_ros.kinematics.linkage.structure import Dimension, dimension_places, Structure
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import last_nonnegative, minimum_near
import numpy as np

from .turn_clearance import turn_clearances

# A clearance beyond doubt, and a length without practical limit, relative to the linkage's size.
SAFE_CLEARANCE, MAX_LENGTH = 1e-6, 1e3
# Values between a dimension's own and its farthest, and how many are tried at once, outward.
CANDIDATES, CANDIDATES_AT_ONCE = 64, 13


@dataclass(eq=False, repr=False)
class PartialTurnError(KinematicsError):
    """
    A leg whose crank does not turn fully.

    `arcs` are the start and the end of each reachable arc [rad].
    """

    arcs: list[Arc]

    def __str__(self) -> str:
        arcs = ', '.join(f'{a * 180 / pi:.3f} .. {b * 180 / pi:.3f}' for a, b in self.arcs)
        return f'the crank does not turn fully, and has no margins: it reaches {arcs} deg'


class Margin(NamedTuple):
    """
    The range of one dimension within which the crank turns fully, all others unchanged.

    `value` is the nominal value, `least` and `greatest` are the ends of the range [m or rad]; 0
    for a length without lower limit, else -inf and inf without limits.
    """

    value: float
    least: float
    greatest: float

    @property
    def changes(self) -> tuple[float, float]:
        """Return the admissible changes down and up, <= 0 and >= 0 [m or rad]."""
        return self.least - self.value, self.greatest - self.value

    @property
    def relative(self) -> tuple[float, float]:
        """Return the changes relative to the magnitude; +-inf for a value of 0."""
        if self.value == 0.0:
            return -inf, inf
        down, up = self.changes
        return down / abs(self.value), up / abs(self.value)


class LengthMargins(dict[str, Margin]):
    """The margins of a linkage by the names of its dimensions; a table in a notebook."""

    def _repr_html_(self) -> str:
        cells = ''.join(
            f'<tr><th>{escape(name)}</th>'
            + ''.join(f'<td>{value:.6g}</td>' for value in margin)
            + '</tr>'
            for name, margin in self.items()
        )
        heads = ('dimension [m, rad]', 'value', 'least', 'greatest')
        head = ''.join(f'<th>{text}</th>' for text in heads)
        return f'<table><tr>{head}</tr>{cells}</table>'


def turns_fully(linkage: Any) -> bool:
    """
    Return whether every loop closes over the crank's whole turn.

    `linkage` is a Linkage, KlannGeometry, FourBarGeometry or leg; a TypeError for anything else.
    """
    return _partial_arcs(as_linkage(linkage)) is None


def length_margins(linkage: Any) -> LengthMargins:
    """
    Return the range of every dimension of a linkage within which its crank turns fully.

    One dimension is changed at a time, and the range is the one around its nominal value: beyond
    it the crank may turn fully again. It ends where the least clearance of all dyads over the turn
    (`turn_clearances`) is 0, to about 1e-12 of the value.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        A linkage whose crank turns fully.

    Returns
    -------
    LengthMargins, a dict of str to Margin
        By the names of its dimensions [m, rad]: 7 lengths, 4 pivot coordinates and 2 bends of a
        Klann leg.

    Raises
    ------
    PartialTurnError
        The crank does not turn fully at the nominal values.
    TypeError
        `linkage` is none of these.

    """
    given = as_linkage(linkage)
    arcs = _partial_arcs(given)
    if arcs is not None:
        raise PartialTurnError(arcs)
    dimensions = given.structure.dimensions
    bound = [d for d in dimensions if _loops_of(given.structure, d)]
    farthest = np.array([_farthest(given, dimension) for dimension in bound])
    names = [dimension.name for dimension in bound]
    losses = TurnLosses(given, [*names, *names], farthest.T.ravel())
    least, greatest = losses.first().reshape(2, -1).tolist()
    found = {
        name: Margin(given.dimensions[name], low, high)
        for name, low, high in zip(names, least, greatest, strict=True)
    }
    free = {
        d.name: Margin(given.dimensions[d.name], 0.0 if d.is_length else -inf, inf)
        for d in dimensions
    }
    return LengthMargins(free | found)


def _partial_arcs(linkage: Linkage) -> list[Arc] | None:
    """Return the reachable arcs of a crank; None if it turns fully."""
    # Near the limit `reachable_arcs` decides.
    if linkage.is_dyadic:
        clearances = turn_clearances(Variants(linkage, {}))[0]
        if (clearances > SAFE_CLEARANCE * linkage.size).all():
            return None
    arcs = reachable_arcs(linkage)
    return None if arcs == [(0.0, TURN)] else arcs


def _loops_of(structure: Structure, dimension: Dimension) -> list[int]:
    """Return the loops of a dimension; a braced bar depends on all dimensions of its body."""
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
    """Return values at or beyond which a loop is no polygon; infinite or 0 without limit."""
    value = linkage.dimensions[dimension.name]
    if dimension.kind == 'bend':
        return -inf, inf
    paths = linkage.structure.paths.loops
    loops = _loops_of(linkage.structure, dimension)
    slides = {j for j, body in enumerate(linkage.structure.bodies) if body.slides}
    if any(slides & linkage.rows[k][0].keys() for k in loops):
        # A line has no end, so it sets no limit.
        return 0.0 if dimension.is_length else -inf, inf
    if dimension.is_length:
        rows = [linkage.rows[k] for k in loops]
        totals = [sum(map(abs, terms.values())) + abs(constant) for terms, constant in rows]
        own = dimension.kind == 'length' and all(
            dimension.place in dict(paths[k].bars) for k in loops
        )
        # A mere brace is bounded by its triangle, and that by its loops.
        most = min(totals) - value if own else sum(totals) + 2.0 * value
        return 0.0, most
    ranges = []
    for k in loops:
        terms, _ = linkage.rows[k]
        reach = sum(map(abs, terms.values()))
        others = [place for place, _ in paths[k].pivots if place != dimension.place]
        at = [linkage.pivots[place] for place in others]
        origin = sum((p.real if dimension.kind == 'x' else p.imag for p in at), 0.0)
        ranges.append((origin - reach, origin + reach))
    return max(low for low, _ in ranges), min(high for _, high in ranges)


class TurnLosses:
    """
    The first loss of the full turn on the way from nominal dimensions to their farthest values.

    Each of the named dimensions is changed alone; at or beyond `farthest`, shape (n,), a loop is
    no polygon [m or rad]; infinite without limit.
    """

    def __init__(self, linkage: Linkage, names: list[str], farthest: FloatArray) -> None:
        self._linkage, self._farthest = linkage, farthest
        dimensions = linkage.structure.dimensions
        places = dimension_places(dimensions)
        self._places = np.array([places[name] for name in names], dtype=np.intp)
        self._own = np.array(linkage.numbers)[self._places]
        self._is_bend = np.array([dimensions[place].unit == 'rad' for place in self._places])
        # Bends are searched over a turn in both directions, other unlimited values to MAX_LENGTH.
        most = np.where(self._is_bend, TURN, MAX_LENGTH * linkage.size)
        self._outward: FloatArray = np.where(
            np.isinf(farthest), np.copysign(most, farthest), farthest - self._own
        )

    def first(self) -> FloatArray:
        """Return the first value of each dimension, going outward, with a negative clearance."""
        # Denser near the nominal value: their square roots are equally spaced. The last is just
        # inside the farthest, as a length must not be 0.
        roots = np.linspace(0.0, 1.0 - 5e-10, CANDIDATES + 1)
        clearances = self._outward_from_own(roots)
        lost = np.fmin.reduce(clearances, axis=2) < 0.0
        # The nominal linkage turns fully, whatever the rounding.
        lost[:, 0] = False
        limited = lost.any(axis=1)
        first = np.where(limited, lost.argmax(axis=1), CANDIDATES)
        inside, outside = roots[np.maximum(first - 1, 0)], roots[first]
        for k, before, dip in self._hidden_losses(roots, clearances, first):
            if before < inside[k]:
                inside[k], outside[k], limited[k] = before, dip, True
        rows = np.flatnonzero(limited)

        def clearance(of: IndexArray, roots: FloatArray) -> FloatArray:
            return np.asarray(np.fmin.reduce(self._clearances(rows[of], roots), axis=1))

        found = self._farthest.copy()
        last = last_nonnegative(clearance, inside[rows], outside[rows])
        found[rows] = self._value(rows, last)
        return found

    def _value(self, searches: IndexArray, roots: FloatArray) -> FloatArray:
        return np.asarray(self._own[searches] + roots**2 * self._outward[searches])

    def _clearances(self, searches: IndexArray, roots: FloatArray) -> FloatArray:
        numbers = np.repeat(np.array(self._linkage.numbers)[:, None], len(searches), axis=1)
        value = self._value(searches, roots)
        # Bends are periodic.
        value = np.where(self._is_bend[searches], np.fmod(value, TURN), value)
        numbers[self._places[searches], np.arange(len(searches))] = value
        changes = dict(zip(self._linkage.dimensions, numbers, strict=True))
        return turn_clearances(Variants(self._linkage, changes))

    def _outward_from_own(self, roots: FloatArray) -> FloatArray:
        """Return the clearances of each search up to a first loss; NaN beyond it."""
        searches, blocks = np.arange(len(self._places)), len(self._linkage.blocks)
        found = np.full((len(searches), len(roots), blocks), np.nan)
        for start in range(0, len(roots), CANDIDATES_AT_ONCE):
            these = np.arange(start, min(start + CANDIDATES_AT_ONCE, len(roots)))
            search, place = np.repeat(searches, len(these)), np.tile(these, len(searches))
            found[search, place] = self._clearances(search, roots[place])
            lost = np.fmin.reduce(found[searches][:, these[these > 0]], axis=(1, 2)) < 0.0
            searches = searches[~lost]
        return found

    def _hidden_losses(
        self, roots: FloatArray, clearances: FloatArray, first: IndexArray
    ) -> list[tuple[int, float, float]]:
        """Return search, root before and root of each negative minimum between candidates."""
        inner = clearances[:, 1:-1]
        dips = (inner < clearances[:, :-2]) & (inner <= clearances[:, 2:])
        reached = np.arange(1, CANDIDATES) < first[:, None]
        searches, before, dyads = np.nonzero(dips & reached[:, :, None])
        if not len(searches):
            return []

        def clearance(rows: IndexArray, at: FloatArray) -> FloatArray:
            each = np.repeat(rows, at.shape[1])
            found = self._clearances(searches[each], at.ravel())
            return found[np.arange(at.size), dyads[each]].reshape(at.shape)

        rounding = float_info.epsilon * np.abs(clearances[searches, before + 1, dyads])
        bottom, least = minimum_near(clearance, roots[before + 1], roots[1], rounding)
        lost = least < 0.0
        return list(zip(searches[lost].tolist(), roots[before[lost]], bottom[lost], strict=True))
