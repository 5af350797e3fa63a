"""
The layers of a leg's plates: over all crank angles no two parts in a layer collide.

Plates in a layer keep a clearance from each other, and from each foreign shaft through the layer;
a shaft is the pin of a joint, from its lowest plate to its highest. Distances are sampled over the
crank angle and reduced by a bound of their change between samples. The search for the minimum
number of layers is exact: depth first, with all plates and shafts of a layer checked at each step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, count
from typing import Any

from klann_ros.kinematics import FIXED, Linkage, linkage_poses
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np

from .plates import COINCIDENCE, ExportError, Plate
from .travel import crank_angles

# Search steps for the first arrangement, and for a better one.
MAX_STEPS, MAX_BETTER = 1_000_000, 100_000
# Between moving parts [m].
CLEARANCE = 0.5e-3
# Crank angles of a turn, or of an arc.
SWEEP_SAMPLES = 3601

# The centre lines of a part at all crank angles, shape (k,) for both ends, and its half width.
SweptPart = tuple[list[tuple[ComplexArray, ComplexArray]], float]
# Of each shaft: its plates, and the foreign plates that it would cross.
Pins = Sequence[tuple[tuple[int, ...], tuple[int, ...]]]


@dataclass(frozen=True)
class Shaft:
    """A pin through plates."""

    name: str  # its points, or the body that it guides
    plates: tuple[int, ...]  # the plates that it joins
    carrier: int  # a plate that it is fixed to
    at: complex  # in that plate's coordinates [m]
    diameter: float  # of its holes [m]

    def radius(self, width: float) -> float:
        """Return the outer radius of its spacers: two holes wide, but no wider than a link [m]."""
        return min(self.diameter, width / 2.0)


@dataclass(frozen=True)
class Layers:
    """
    The layers of a leg's plates, and its pins.

    `layer` is that of each plate, from 0 at the bottom. `stubs` are the pins that every
    arrangement interrupts, with the plates between their own; `flush` a pin, and -1 for its lower
    or 1 for its upper end, that a plate passes over: no head or nut may stand out there.
    """

    plates: tuple[Plate, ...]
    layer: tuple[int, ...]
    shafts: tuple[Shaft, ...]
    stubs: tuple[tuple[Shaft, tuple[int, ...]], ...]
    flush: tuple[tuple[Shaft, int], ...]
    motion: 'PlateMotion'

    @property
    def count(self) -> int:
        """Return the number of layers."""
        return max(self.layer) + 1

    def span(self, shaft: Shaft) -> tuple[int, int]:
        """Return the lowest and the highest layer of a shaft."""
        own = [self.layer[p] for p in shaft.plates]
        return min(own), max(own)

    def spacers(self, shaft: Shaft) -> int:
        """Return the number of layers between a shaft's plates without one of them."""
        low, high = self.span(shaft)
        return high - low + 1 - len({self.layer[p] for p in shaft.plates})


def layers(linkage: Linkage, plates: Sequence[Plate]) -> Layers:
    """
    Return the minimum number of layers, with the ground outermost unless that takes more.

    Among these, with few flush ends, then with short shafts.

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
    shafts, motion = _shafts(plates), PlateMotion(linkage)
    swept = [motion.swept(plate) for plate in plates]
    clashes: list[set[int]] = [set() for _ in plates]
    for i, j in combinations(range(len(plates)), 2):
        if motion.collide(swept[i], swept[j]):
            clashes[i].add(j)
            clashes[j].add(i)
    pins = []
    for shaft in shafts:
        pin = motion.pin(plates[shaft.carrier], shaft.at, shaft.radius(plates[0].width))
        foreign = (p for p in range(len(plates)) if p not in shaft.plates)
        pins.append((shaft.plates, tuple(p for p in foreign if motion.collide(swept[p], pin))))
    ground = next((p for p, plate in enumerate(plates) if plate.body == FIXED), None)
    for number in range(len(shafts) + 1):
        for cut in combinations(range(len(shafts)), number):
            remaining = [(own, () if k in cut else each) for k, (own, each) in enumerate(pins)]
            found = _fewest(clashes, remaining, ground)
            if found is not None:
                flush = tuple((shafts[k], side) for k, side in _flush(found, pins))
                stubs = tuple((shafts[k], _between(found, *pins[k])) for k in cut)
                return Layers(tuple(plates), found, tuple(shafts), stubs, flush, motion)
    raise AssertionError('without shafts, a layer for each plate is enough')


class PlateMotion:
    """The motion of a leg's plates over all crank angles."""

    def __init__(self, linkage: Linkage) -> None:
        structure = linkage.structure
        alphas = crank_angles(linkage, SWEEP_SAMPLES)
        found: Any = linkage_poses(linkage, alphas, points=True)
        points = found.points[..., 0] + 1j * found.points[..., 1]
        is_known = np.asarray(np.isfinite(points).all(axis=1))
        if not is_known.any():
            raise ExportError('the crank reaches no angle: nothing moves')
        self._steps = is_known[1:] & is_known[:-1]
        # Nothing moves across the gap between two arcs.
        last = SWEEP_SAMPLES - 1
        self._steps[last::SWEEP_SAMPLES] = False
        # The sample that is drawn.
        self.shown = int(np.flatnonzero(is_known)[is_known.sum() // 6])
        at = {name: points[:, k] for k, name in enumerate(structure.points)}
        zero = np.zeros(alphas.size, np.complex128)
        rotations = {FIXED: zero + 1.0}
        for j, body in enumerate(structure.bodies):
            if not body.slides:
                along = at[body.bars[0].end] - at[body.bars[0].start]
                rotations[j] = along / np.abs(along)
        self._frames = {FIXED: (zero, rotations[FIXED])} | {
            j: (at[body.points[0]], rotations[structure.frames[j]])
            for j, body in enumerate(structure.bodies)
        }
        # Upper bound of the change of a computed distance between two samples [m].
        self.bound = 0.0
        # The first point of the crank.
        self.crank = structure.crank.points[0]

    def place(self, plate: Plate, at: complex) -> ComplexArray:
        """Return the path of a point of a plate, shape (k,) [m]."""
        origin, rotation = self._frames[plate.body]
        return np.asarray(origin + at * rotation)

    def swept(self, plate: Plate) -> SweptPart:
        """Return the links of a plate over all crank angles."""
        links = [(self.place(plate, a), self.place(plate, b)) for a, b in plate.links]
        return links, plate.width / 2.0

    def pin(self, plate: Plate, at: complex, radius: float) -> SweptPart:
        """Return a shaft over all crank angles."""
        place = self.place(plate, at)
        return [(place, place)], radius

    def collide(self, one: SweptPart, other: SweptPart) -> bool:
        """Return whether two parts may come nearer than the clearance, between samples too."""
        least = one[1] + other[1] + CLEARANCE
        return any(self._least(a, b) < least for a in one[0] for b in other[0])

    def _least(
        self, one: tuple[ComplexArray, ComplexArray], other: tuple[ComplexArray, ComplexArray]
    ) -> float:
        """Return a lower bound of the distance of two segments over all crank angles [m]."""
        moved = sum(
            np.max([np.abs(np.diff(end)) for end in segment], axis=0) for segment in (one, other)
        )
        far = distances(one, other)
        least = (far[1:] + far[:-1] - moved) / 2.0
        self.bound = max(self.bound, float(np.max(moved[self._steps])) / 2.0)
        return float(least[self._steps].min())


def distances(
    one: tuple[ComplexArray, ComplexArray], other: tuple[ComplexArray, ComplexArray]
) -> FloatArray:
    """Return the distances of two segments in many poses, shape (k,)."""
    a, b, apart = one[1] - one[0], other[1] - other[0], other[0] - one[0]
    across = _cross(a, b)
    with np.errstate(divide='ignore', invalid='ignore'):
        s, t = _cross(apart, b) / across, _cross(apart, a) / across
    crossing = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    ends = [_from_segment(end, other) for end in one] + [_from_segment(end, one) for end in other]
    return np.where(crossing, 0.0, np.min(ends, axis=0))


def _from_segment(at: ComplexArray, segment: tuple[ComplexArray, ComplexArray]) -> FloatArray:
    along = segment[1] - segment[0]
    size = np.abs(along) ** 2
    part = ((at - segment[0]) * along.conj()).real / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.abs(at - segment[0] - np.clip(part, 0.0, 1.0) * along))


def _cross(a: ComplexArray, b: ComplexArray) -> FloatArray:
    return np.asarray((a.conj() * b).imag)


def _shafts(plates: Sequence[Plate]) -> list[Shaft]:
    """Return the pins of the plates; holes that share a point have one."""
    groups: list[list[tuple[int, int]]] = []
    for p, plate in enumerate(plates):
        for h, hole in enumerate(plate.holes):
            names = set(hole.name.split(',')) - {''}
            same = [
                group
                for group in groups
                if any(names & set(plates[q].holes[k].name.split(',')) for q, k in group)
            ]
            groups = [group for group in groups if group not in same]
            groups.append([*(key for group in same for key in group), (p, h)])
    found = []
    for group in groups:
        (carrier, h), *_ = group
        holes = [(plates[p].body, plates[p].holes[k]) for p, k in group]
        points = dict.fromkeys(n for _, hole in holes for n in hole.name.split(',') if n)
        guiding = {
            p: slot.name
            for p, plate in enumerate(plates)
            for slot in plate.slots
            for body, hole in holes
            if body == slot.body and min(abs(hole.at - x) for x in slot.pins) < COINCIDENCE
        }
        through = tuple(dict.fromkeys([*(p for p, _ in group), *guiding]))
        if len(through) > 1:
            name = ','.join(points) or f'guide of {[*guiding.values()][-1]}'
            widest = max(hole.diameter for _, hole in holes)
            found.append(Shaft(name, through, carrier, plates[carrier].holes[h].at, widest))
    return found


def _between(layer: Sequence[int], own: Sequence[int], crossing: Sequence[int]) -> tuple[int, ...]:
    """Return the plates among `crossing` between the lowest and the highest of a shaft's own."""
    span = [layer[p] for p in own]
    return tuple(p for p in crossing if min(span) <= layer[p] <= max(span))


def _fewest(clashes: Sequence[set[int]], pins: Pins, ground: int | None) -> tuple[int, ...] | None:
    """Return the layer of each plate, as few as possible; None if no number is enough."""
    for number in range(1, len(clashes) + 1):
        for first in (ground, None) if ground is not None else (None,):
            found = [*_Search(clashes, pins, number, first).arrangements(0)]
            if found:
                return found[-1]
    return None


class _Search:
    """Depth-first search of the plates' layers, for a given number of layers."""

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

    def arrangements(self, depth: int) -> Iterator[tuple[int, ...]]:
        """Yield arrangements, each better than the one before."""
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
                yield from self.arrangements(depth + 1)
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
        """Return the total length of all shafts so far [layers]."""
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
