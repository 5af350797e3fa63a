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
SAFE_CLEARANCE = 1e-6
MAX_LENGTH = 1e3
# Values between a dimension and its farthest value, and how many are tried at once, outward.
CANDIDATES = 64
CANDIDATES_AT_ONCE = 13


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

    `value` is the nominal one, `least` and `greatest` are the ends of the range [m or rad]; 0 for
    a length without lower limit, else -inf and inf without limits.
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
        rows = '<tr><th>dimension [m, rad]</th><th>value</th><th>least</th><th>greatest</th></tr>'
        for name, margin in self.items():
            cells = ''.join(f'<td>{number:.6g}</td>' for number in margin)
            rows += f'<tr><th>{escape(name)}</th>{cells}</tr>'
        return f'<table>{rows}</table>'


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
    linkage = as_linkage(linkage)
    arcs = _partial_arcs(linkage)
    if arcs is not None:
        raise PartialTurnError(arcs)
    margins = LengthMargins()
    names = []
    farthest = []
    for d in linkage.structure.dimensions:
        margins[d.name] = Margin(linkage.dimensions[d.name], 0.0 if d.is_length else -inf, inf)
        if _loops_of(linkage.structure, d):
            names.append(d.name)
            farthest.append(_farthest(linkage, d))
    losses = TurnLosses(linkage, [*names, *names], np.array(farthest).T.ravel())
    ends = losses.first().reshape(2, -1).T.tolist()
    for name, (low, high) in zip(names, ends, strict=True):
        margins[name] = Margin(linkage.dimensions[name], low, high)
    return margins


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
    is_pivot = dimension.kind in ('x', 'y')
    touched = {dimension.place}
    if not is_pivot:
        body, _ = structure.bars[dimension.place]
        for number, (bar_body, bar) in enumerate(structure.bars):
            if bar_body == body and bar.brace is not None:
                touched.add(number)
    loops = []
    for k, path in enumerate(structure.paths.loops):
        terms = dict(path.pivots if is_pivot else path.bars)
        if touched & terms.keys():
            loops.append(k)
    return loops


def _farthest(linkage: Linkage, dimension: Dimension) -> tuple[float, float]:
    """Return values at or beyond which a loop is no polygon; infinite or 0 without limit."""
    if dimension.kind == 'bend':
        return -inf, inf
    loops = _loops_of(linkage.structure, dimension)
    sliding = linkage.structure.line_of.keys()
    if any(sliding & linkage.rows[k][0].keys() for k in loops):
        # A line has no end, so it sets no limit.
        return 0.0 if dimension.is_length else -inf, inf
    if dimension.is_length:
        return 0.0, _max_length(linkage, dimension, loops)
    lowest = -inf
    highest = inf
    for k in loops:
        terms, _ = linkage.rows[k]
        reach = sum(map(abs, terms.values()))
        origin = 0.0
        for place, _ in linkage.structure.paths.loops[k].pivots:
            if place != dimension.place:
                pivot = linkage.pivots[place]
                origin += pivot.real if dimension.kind == 'x' else pivot.imag
        lowest = max(lowest, origin - reach)
        highest = min(highest, origin + reach)
    return lowest, highest


def _max_length(linkage: Linkage, dimension: Dimension, loops: list[int]) -> float:
    """Return a length at or beyond which one of its loops is no polygon [m]."""
    length = linkage.dimensions[dimension.name]
    perimeters = []
    is_mere_brace = dimension.kind == 'brace'
    for k in loops:
        terms, constant = linkage.rows[k]
        perimeters.append(sum(map(abs, terms.values())) + abs(constant))
        is_mere_brace |= dimension.place not in dict(linkage.structure.paths.loops[k].bars)
    if not is_mere_brace:
        return min(perimeters) - length
    # A mere brace is bounded by its triangle, and that by its loops.
    return sum(perimeters) + 2.0 * length


class TurnLosses:
    """
    The first loss of the full turn on the way from nominal dimensions to their farthest values.

    Each of the named dimensions is changed alone; at or beyond `farthest`, shape (n,), a loop is
    no polygon [m or rad]; infinite without limit.
    """

    def __init__(self, linkage: Linkage, names: list[str], farthest: FloatArray) -> None:
        self._linkage = linkage
        self._farthest = farthest
        dimensions = linkage.structure.dimensions
        places = dimension_places(dimensions)
        self._places = np.array([places[name] for name in names], dtype=np.intp)
        self._nominal = np.array(linkage.numbers)[self._places]
        self._is_bend = np.array([dimensions[place].unit == 'rad' for place in self._places])
        # Bends are searched over a turn in both directions, other unlimited values to MAX_LENGTH.
        max_change = np.where(self._is_bend, TURN, MAX_LENGTH * linkage.size)
        self._outward: FloatArray = np.where(
            np.isinf(farthest), np.copysign(max_change, farthest), farthest - self._nominal
        )

    def first(self) -> FloatArray:
        """Return the first value of each dimension, going outward, with a negative clearance."""
        # Denser near the nominal value: their square roots are equally spaced. The last is just
        # inside the farthest, as a length must not be 0.
        roots = np.linspace(0.0, 1.0 - 5e-10, CANDIDATES + 1)
        clearances = self._outward_clearances(roots)
        lost = np.fmin.reduce(clearances, axis=2) < 0.0
        # The nominal linkage turns fully, whatever the rounding.
        lost[:, 0] = False
        limited = lost.any(axis=1)
        first = np.where(limited, lost.argmax(axis=1), CANDIDATES)
        inside = roots[np.maximum(first - 1, 0)]
        outside = roots[first]
        for k, root_inside, dip in self._hidden_losses(roots, clearances, first):
            if root_inside < inside[k]:
                inside[k] = root_inside
                outside[k] = dip
                limited[k] = True
        searches = np.flatnonzero(limited)

        def clearance(indices: IndexArray, roots: FloatArray) -> FloatArray:
            return np.asarray(np.fmin.reduce(self._clearances(searches[indices], roots), axis=1))

        ends = self._farthest.copy()
        last = last_nonnegative(clearance, inside[searches], outside[searches])
        ends[searches] = self._number(searches, last)
        return ends

    def _number(self, searches: IndexArray, roots: FloatArray) -> FloatArray:
        return np.asarray(self._nominal[searches] + roots**2 * self._outward[searches])

    def _clearances(self, searches: IndexArray, roots: FloatArray) -> FloatArray:
        numbers = np.repeat(np.array(self._linkage.numbers)[:, None], len(searches), axis=1)
        changed = self._number(searches, roots)
        # Bends are periodic.
        changed = np.where(self._is_bend[searches], np.fmod(changed, TURN), changed)
        numbers[self._places[searches], np.arange(len(searches))] = changed
        changes = dict(zip(self._linkage.dimensions, numbers, strict=True))
        return turn_clearances(Variants(self._linkage, changes))

    def _outward_clearances(self, roots: FloatArray) -> FloatArray:
        """Return the clearances of each search up to a first loss; NaN beyond it."""
        searches = np.arange(len(self._places))
        blocks = len(self._linkage.blocks)
        clearances = np.full((len(searches), len(roots), blocks), np.nan)
        for start in range(0, len(roots), CANDIDATES_AT_ONCE):
            candidates = np.arange(start, min(start + CANDIDATES_AT_ONCE, len(roots)))
            search = np.repeat(searches, len(candidates))
            candidate = np.tile(candidates, len(searches))
            clearances[search, candidate] = self._clearances(search, roots[candidate])
            outer = clearances[searches][:, candidates[candidates > 0]]
            lost = np.fmin.reduce(outer, axis=(1, 2)) < 0.0
            searches = searches[~lost]
        return clearances

    def _hidden_losses(
        self, roots: FloatArray, clearances: FloatArray, first: IndexArray
    ) -> list[tuple[int, float, float]]:
        """Return the search, the root inside and the root of each dip between candidates."""
        inner = clearances[:, 1:-1]
        dips = (inner < clearances[:, :-2]) & (inner <= clearances[:, 2:])
        reached = np.arange(1, CANDIDATES) < first[:, None]
        searches, inside, dyads = np.nonzero(dips & reached[:, :, None])
        if not len(searches):
            return []

        def clearance(indices: IndexArray, trials: FloatArray) -> FloatArray:
            repeated = np.repeat(indices, trials.shape[1])
            block_clearances = self._clearances(searches[repeated], trials.ravel())
            of_dyad = block_clearances[np.arange(trials.size), dyads[repeated]]
            return of_dyad.reshape(trials.shape)

        rounding = float_info.epsilon * np.abs(clearances[searches, inside + 1, dyads])
        bottom, depth = minimum_near(clearance, roots[inside + 1], roots[1], rounding)
        lost = depth < 0.0
        return list(zip(searches[lost].tolist(), roots[inside[lost]], bottom[lost], strict=True))
