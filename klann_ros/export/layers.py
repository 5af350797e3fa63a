"""
The layers of a leg's plates: over all crank angles nothing in a layer collides.

Plates of one layer keep a clearance from each other, and so does a plate from each foreign shaft
that passes its layer; a shaft is the pin of a joint, from the lowest of its plates to the highest.
The search for the fewest layers is exact: depth first, with the plates of a layer and
the shafts through it checked at each step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, count

from klann_ros.kinematics import Linkage
from klann_ros.kinematics.linkage.structure import FIXED

from .plates import COINCIDENCE, ExportError, Plate
from .sweep import SweptMotion

# Steps of a search for the first arrangement, and for a better one.
MAX_STEPS, MAX_BETTER = 1_000_000, 100_000


@dataclass(frozen=True)
class Shaft:
    """
    A pin through plates.

    Attributes
    ----------
    name : str
        Its points, or the body that it guides.
    plates : tuple of int
        The plates that it joins.
    carrier : int
        A plate that it is fixed to, and where in its coordinates [m].
    at : complex
        As above.
    diameter : float
        Of its holes [m].

    """

    name: str
    plates: tuple[int, ...]
    carrier: int
    at: complex
    diameter: float

    def radius(self, width: float) -> float:
        """Return the outer radius of its spacers: that of two holes, or of a link [m]."""
        return min(self.diameter, width / 2.0)


@dataclass(frozen=True)
class Layers:
    """
    The layers of a leg.

    Attributes
    ----------
    plates : tuple of Plate
        The plates of a leg.
    layer : tuple of int
        Of each plate, from 0 at the bottom.
    shafts : tuple of Shaft
        The pins.
    stubs : tuple of (Shaft, tuple of int)
        Those that no arrangement leaves whole, and the plates that pass between theirs.
    flush : tuple of (Shaft, int)
        A shaft, and -1 for its lower or 1 for its upper end, that a plate passes over: no head or
        nut may stand out there.
    motion : SweptMotion
        Of the plates.

    """

    plates: tuple[Plate, ...]
    layer: tuple[int, ...]
    shafts: tuple[Shaft, ...]
    stubs: tuple[tuple[Shaft, tuple[int, ...]], ...]
    flush: tuple[tuple[Shaft, int], ...]
    motion: SweptMotion

    @property
    def count(self) -> int:
        """Return the number of layers."""
        return max(self.layer) + 1

    def span(self, shaft: Shaft) -> tuple[int, int]:
        """Return the lowest and the highest layer of a shaft."""
        own = [self.layer[p] for p in shaft.plates]
        return min(own), max(own)

    def spacers(self, shaft: Shaft) -> int:
        """Return in how many layers between its plates a shaft has none of them."""
        low, high = self.span(shaft)
        return high - low + 1 - len({self.layer[p] for p in shaft.plates})


def layers(linkage: Linkage, plates: Sequence[Plate]) -> Layers:
    """
    Return the fewest layers of a leg's plates, the ground outermost where that takes no more.

    Among these, few shafts that must be flush, then short shafts.

    Parameters
    ----------
    linkage : Linkage
        The leg, scaled as its plates are.
    plates : sequence of Plate
        Its plates.

    Raises
    ------
    ExportError
        The crank reaches no angle, or the plates are too many for the search.

    """
    shafts = _shafts(plates)
    motion = SweptMotion(linkage)
    swept = [motion.swept(plate) for plate in plates]
    paths = [motion.pin(plates[s.carrier], s.at, s.radius(plates[0].width)) for s in shafts]
    clashes: list[set[int]] = [set() for _ in plates]
    for i, j in combinations(range(len(plates)), 2):
        if motion.collide(swept[i], swept[j]):
            clashes[i].add(j)
            clashes[j].add(i)
    crossed = [
        tuple(
            p
            for p in range(len(plates))
            if p not in shaft.plates and motion.collide(swept[p], pin)
        )
        for shaft, pin in zip(shafts, paths, strict=True)
    ]
    ground = next((p for p, plate in enumerate(plates) if plate.body == FIXED), None)
    pins = [(shaft.plates, each) for shaft, each in zip(shafts, crossed, strict=True)]
    for number in range(len(shafts) + 1):
        for cut in combinations(range(len(shafts)), number):
            remaining = [(own, () if k in cut else each) for k, (own, each) in enumerate(pins)]
            found = _fewest(clashes, remaining, ground)
            if found is not None:
                flush = tuple((shafts[k], way) for k, way in _flush(found, pins))
                stubs = tuple(
                    (shafts[k], tuple(p for p in crossed[k] if _is_between(found, p, shafts[k])))
                    for k in cut
                )
                return Layers(tuple(plates), found, tuple(shafts), stubs, flush, motion)
    raise AssertionError('without shafts, a layer for each plate is enough')


def _shafts(plates: Sequence[Plate]) -> list[Shaft]:
    """Return the pins of the plates, those at one place of a plate as one."""
    joined: list[dict[tuple[int, int], None]] = []
    for p, plate in enumerate(plates):
        for h, hole in enumerate(plate.holes):
            names = set(hole.name.split(',')) - {''}
            same = [
                group
                for group in joined
                if any(names & set(plates[q].holes[k].name.split(',')) for q, k in group)
            ]
            joined = [group for group in joined if group not in same]
            joined.append(dict.fromkeys([*(key for group in same for key in group), (p, h)]))
    found = []
    for group in joined:
        (carrier, h), *_ = group
        holes = [plates[p].holes[k] for p, k in group]
        points = dict.fromkeys(n for hole in holes for n in hole.name.split(',') if n)
        through = dict.fromkeys(p for p, _ in group)
        guided = None
        for p, plate in enumerate(plates):
            for slot in plate.slots:
                for q, k in group:
                    at = plates[q].holes[k].at
                    if (
                        plates[q].body == slot.body
                        and min(abs(at - x) for x in slot.pins) < COINCIDENCE
                    ):
                        through[p] = guided = None
                        guided = slot.name
        if len(through) > 1:
            name = ','.join(points) or f'guide of {guided}'
            widest = max(hole.diameter for hole in holes)
            found.append(Shaft(name, tuple(through), carrier, plates[carrier].holes[h].at, widest))
    return found


def _is_between(layer: Sequence[int], plate: int, shaft: Shaft) -> bool:
    own = [layer[p] for p in shaft.plates]
    return min(own) <= layer[plate] <= max(own)


Pins = Sequence[tuple[tuple[int, ...], tuple[int, ...]]]


def _fewest(clashes: Sequence[set[int]], pins: Pins, ground: int | None) -> tuple[int, ...] | None:
    """Return the layer of each plate, the fewest that there are; None if no number is enough."""
    for number in range(1, len(clashes) + 1):
        for first in (ground, None) if ground is not None else (None,):
            found = [*_Search(clashes, pins, number, first).found()]
            if found:
                return found[-1]
    return None


class _Search:
    """Plates into a number of layers, depth first."""

    def __init__(
        self, clashes: Sequence[set[int]], pins: Pins, number: int, lowest: int | None
    ) -> None:
        self._clashes, self._pins, self._number = clashes, pins, number
        self._lowest = lowest
        order = sorted(range(len(clashes)), key=lambda p: -len(clashes[p]))
        self._order = order if lowest is None else [lowest, *(p for p in order if p != lowest)]
        self._layer: dict[int, int] = {}
        self._best: tuple[int, int] | None = None
        self._steps = count()

    def found(self) -> Iterator[tuple[int, ...]]:
        """Yield arrangements, each better than the one before."""
        yield from self._down(0)

    def _down(self, depth: int) -> Iterator[tuple[int, ...]]:
        step = next(self._steps)
        if step > MAX_STEPS and self._best is None:
            raise ExportError(f'{len(self._order)} plates are too many to find their layers')
        if step > MAX_BETTER and self._best is not None:
            return
        if depth == len(self._order):
            whole = tuple(self._layer[p] for p in range(len(self._order)))
            cost = len(_flush(whole, self._pins)), self._length()
            if self._best is None or cost < self._best:
                self._best = cost
                yield whole
            return
        plate = self._order[depth]
        for layer in (0,) if plate == self._lowest else range(self._number):
            self._layer[plate] = layer
            if self._is_free(plate):
                yield from self._down(depth + 1)
            del self._layer[plate]

    def _is_free(self, plate: int) -> bool:
        layer = self._layer
        if any(layer.get(other) == layer[plate] for other in self._clashes[plate]):
            return False
        if self._best is not None and self._best[0] == 0 and self._length() >= self._best[1]:
            return False
        for own, crossing in self._pins:
            placed = [layer[p] for p in own if p in layer]
            if len(placed) > 1 and any(
                min(placed) <= layer[p] <= max(placed) for p in crossing if p in layer
            ):
                return False
        return True

    def _length(self) -> int:
        """Return how many layers all shafts span so far."""
        placed = [[self._layer[p] for p in own if p in self._layer] for own, _ in self._pins]
        return sum(max(each) - min(each) for each in placed if each)


def _flush(layer: Sequence[int], pins: Pins) -> list[tuple[int, int]]:
    """Return the ends of shafts, -1 lower and 1 upper, that a plate of the next layer passes."""
    found = []
    for k, (own, crossing) in enumerate(pins):
        crossed = {layer[p] for p in crossing}
        spanned = [layer[p] for p in own]
        found += [(k, -1)] if min(spanned) - 1 in crossed else []
        found += [(k, 1)] if max(spanned) + 1 in crossed else []
    return found
