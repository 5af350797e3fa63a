"""How much each number of a linkage may change before the crank loses its full turn."""

from dataclasses import dataclass
from math import inf, pi
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.linkage.reach import reachable_arcs
from klann_ros.kinematics.linkage.structure import Dimension, Structure
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .turn_clearance import turn_clearances
from .turn_losses import TurnLosses

# A part of a dyad's links by which its ends are inside its reach beyond any doubt.
CLEAR = 1e-6


@dataclass(eq=False, repr=False)
class PartialTurnError(KinematicsError):
    """
    A leg whose crank does not turn fully, so that there is no full turn to lose.

    Attributes
    ----------
    arcs : list of (float, float)
        Where the crank can be: start and end of each arc [rad].

    """

    arcs: list[Arc]

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
    return _arcs_of_part(as_linkage(linkage)) is None


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
    arcs = _arcs_of_part(given)
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
    return free | found


def _arcs_of_part(linkage: Linkage) -> list[Arc] | None:
    """Return where a crank can be that does not turn fully; None for one that does."""
    # Near the limit `reachable_arcs` decides, for all.
    if linkage.is_dyadic:
        clearances = turn_clearances(Variants(linkage, {}))[0]
        if (clearances > CLEAR * linkage.size).all():
            return None
    arcs = reachable_arcs(linkage)
    return None if arcs == [(0.0, TURN)] else arcs


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
        return -inf, inf
    paths = linkage.structure.paths.loops
    loops = _loops_of(linkage.structure, dimension)
    slides = {j for j, body in enumerate(linkage.structure.bodies) if body.slides}
    if any(slides & linkage.rows[k][0].keys() for k in loops):
        # A line has no end, so nothing else is too long for it.
        return 0.0 if dimension.is_length else -inf, inf
    if dimension.is_length:
        totals = []
        for k in loops:
            terms, constant = linkage.rows[k]
            totals.append(sum(map(abs, terms.values())) + abs(constant))
        own = dimension.kind == 'length' and all(
            dimension.place in dict(paths[k].bars) for k in loops
        )
        # What only braces another bar is bounded by its triangle, and that by its loops.
        most = min(totals) - value if own else sum(totals) + 2.0 * value
        sides = _other_sides(linkage, dimension)
        return max([0.0, *(abs(p - q) for p, q in sides)]), min([most, *(p + q for p, q in sides)])
    ranges = []
    for k in loops:
        terms, _ = linkage.rows[k]
        reach = sum(map(abs, terms.values()))
        others = [place for place, _ in paths[k].pivots if place != dimension.place]
        at = [linkage.pivots[place] for place in others]
        origin = sum((p.real if dimension.kind == 'x' else p.imag for p in at), 0.0)
        ranges.append((origin - reach, origin + reach))
    return max(low for low, _ in ranges), min(high for _, high in ranges)


def _other_sides(linkage: Linkage, dimension: Dimension) -> list[tuple[float, float]]:
    """Return the other sides of each triangle of bars and a brace that a length is a side of."""
    bars, found = linkage.structure.bars, []
    lengths = dict(zip(linkage.structure.slots, linkage.numbers, strict=True))
    for number, (body, bar) in enumerate(bars):
        if bar.brace is None:
            continue
        ends = {bar.start, bar.brace.start}
        bases = (n for n, (of, b) in enumerate(bars) if of == body and {b.start, b.end} == ends)
        sides = {('length', number), ('brace', number), *(('length', base) for base in bases)}
        own = (dimension.kind, dimension.place)
        if len(sides) == 3 and own in sides:
            p, q = (lengths[side] for side in sides - {own})
            found.append((p, q))
    return found
