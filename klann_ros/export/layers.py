"""
The layers of a leg's plates: over all crank angles no two parts in a layer collide.

Plates in a layer keep a clearance from each other, and from each foreign shaft through the layer;
a shaft is the pin of a joint, from its lowest plate to its highest. Distances are sampled over the
crank angle and reduced by a bound of their change between samples. The search for the minimum
number of layers is exact: depth first, with all plates and shafts of a layer checked at each step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations, count, product
from typing import Any, NamedTuple

from klann_ros.kinematics import cross, FIXED, Linkage, linkage_poses
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np

from .plates import COINCIDENCE, ExportError, Hole, Plate
from .travel import crank_angles

# Search steps for the first arrangement, and for a better one.
MAX_STEPS = 1_000_000
MAX_BETTER = 100_000
# Between moving parts [m].
CLEARANCE = 0.5e-3
# Crank angles of a turn, or of an arc.
SWEEP_SAMPLES = 3601

# A centre line at all crank angles: both ends, shape (k,).
SweptLine = tuple[ComplexArray, ComplexArray]


class SweptPart(NamedTuple):
    """A part at all crank angles."""

    lines: list[SweptLine]
    radius: float  # half of its width [m]


class PinPlates(NamedTuple):
    """The plates that a shaft joins, and the foreign plates that it would cross."""

    joined: tuple[int, ...]
    crossing: tuple[int, ...]

    def span(self, layer: Sequence[int]) -> tuple[int, int]:
        """Return the lowest and the highest layer of the joined plates."""
        joined_layers = [layer[p] for p in self.joined]
        return min(joined_layers), max(joined_layers)


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


class Stub(NamedTuple):
    """A pin that every arrangement interrupts, and the plates that pass between its own."""

    shaft: Shaft
    crossing: tuple[int, ...]


class Side(Enum):
    """The lower or the upper end of a pin."""

    LOWER = 'lower'
    UPPER = 'upper'


class FlushEnd(NamedTuple):
    """An end of a pin that a plate passes over: no head or nut may stand out there."""

    shaft: Shaft
    side: Side


@dataclass(frozen=True)
class Layers:
    """The layers of a leg's plates, and its pins."""

    plates: tuple[Plate, ...]
    layer: tuple[int, ...]  # the layer of each plate, from 0 at the bottom
    shafts: tuple[Shaft, ...]
    stubs: tuple[Stub, ...]
    flush: tuple[FlushEnd, ...]
    motion: 'PlateMotion'

    @property
    def count(self) -> int:
        """Return the number of layers."""
        return max(self.layer) + 1

    def plates_in(self, layer: int) -> list[int]:
        """Return the plates of a layer."""
        return [p for p, plate_layer in enumerate(self.layer) if plate_layer == layer]

    def span(self, shaft: Shaft) -> tuple[int, int]:
        """Return the lowest and the highest layer of a shaft."""
        return PinPlates(shaft.plates, ()).span(self.layer)

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
    shafts = _shafts(plates)
    motion = PlateMotion(linkage)
    swept = []
    clashes: list[set[int]] = []
    ground = None
    for p, plate in enumerate(plates):
        swept.append(motion.swept(plate))
        clashes.append(set())
        if plate.body == FIXED:
            ground = p
    for i, j in combinations(range(len(plates)), 2):
        if motion.collide(swept[i], swept[j]):
            clashes[i].add(j)
            clashes[j].add(i)
    pins = []
    for shaft in shafts:
        pin = motion.pin(plates[shaft.carrier], shaft.at, shaft.radius(plates[0].width))
        pins.append(PinPlates(shaft.plates, _crossing_plates(shaft, pin, swept, motion)))
    for stub_count in range(len(shafts) + 1):
        for cut in combinations(range(len(shafts)), stub_count):
            whole_pins = [*pins]
            for k in cut:
                whole_pins[k] = PinPlates(pins[k].joined, ())
            layer = _fewest(clashes, whole_pins, ground)
            if layer is not None:
                stubs = tuple(Stub(shafts[k], _between(layer, pins[k])) for k in cut)
                flush = tuple(FlushEnd(shafts[k], side) for k, side in _flush(layer, pins))
                return Layers(tuple(plates), layer, tuple(shafts), stubs, flush, motion)
    raise AssertionError('without shafts, a layer for each plate is enough')


def _crossing_plates(
    shaft: Shaft, pin: SweptPart, swept: Sequence[SweptPart], motion: 'PlateMotion'
) -> tuple[int, ...]:
    """Return the plates that a shaft does not join, and that meet it."""
    crossing = []
    for p, swept_plate in enumerate(swept):
        if p not in shaft.plates and motion.collide(swept_plate, pin):
            crossing.append(p)
    return tuple(crossing)


class PlateMotion:
    """The motion of a leg's plates over all crank angles."""

    def __init__(self, linkage: Linkage) -> None:
        structure = linkage.structure
        alphas = crank_angles(linkage, SWEEP_SAMPLES)
        # Crank angles of the samples [rad].
        self.angles = alphas
        poses: Any = linkage_poses(linkage, alphas, points=True)
        points = poses.points[..., 0] + 1j * poses.points[..., 1]
        is_solved = np.asarray(np.isfinite(points).all(axis=1))
        if not is_solved.any():
            raise ExportError('the crank reaches no angle: nothing moves')
        self._steps = is_solved[1:] & is_solved[:-1]
        # Nothing moves across the gap between two arcs.
        last = SWEEP_SAMPLES - 1
        self._steps[last::SWEEP_SAMPLES] = False
        # The sample that is drawn.
        self.shown = int(np.flatnonzero(is_solved)[is_solved.sum() // 6])
        paths = dict(zip(structure.points, points.T, strict=True))
        zero = np.zeros(alphas.size, np.complex128)
        rotations = {FIXED: zero + 1.0}
        for j, body in enumerate(structure.bodies):
            if not body.slides:
                along = paths[body.bars[0].end] - paths[body.bars[0].start]
                with np.errstate(invalid='ignore'):  # NaN where it cannot be assembled
                    rotations[j] = along / np.abs(along)
        # Origin and rotation of each body's coordinates.
        self._frames = {FIXED: (zero, rotations[FIXED])}
        for j, body in enumerate(structure.bodies):
            self._frames[j] = paths[body.points[0]], rotations[structure.frames[j]]
        # Upper bound of the change of a computed distance between two samples [m].
        self.bound = 0.0
        # The first point of the crank.
        self.crank = structure.crank.points[0]

    def nearest(self, angle: float) -> int:
        """Return the solved sample nearest to a crank angle [rad]."""
        distance = 1.0 - np.cos(self.angles - angle)
        return int(np.nanargmin(np.where(np.isfinite(self._frames[0][1]), distance, np.nan)))

    def frame(self, body: int, sample: int) -> tuple[complex, complex]:
        """Return origin [m] and rotation of a body's coordinates at a sample."""
        origin, rotation = self._frames[body]
        return complex(origin[sample]), complex(rotation[sample])

    def place(self, plate: Plate, point: complex) -> ComplexArray:
        """Return the path of a point of a plate, shape (k,) [m]."""
        origin, rotation = self._frames[plate.body]
        return np.asarray(origin + point * rotation)

    def swept(self, plate: Plate) -> SweptPart:
        """Return the links of a plate over all crank angles."""
        links = [(self.place(plate, start), self.place(plate, end)) for start, end in plate.links]
        return SweptPart(links, plate.width / 2.0)

    def pin(self, plate: Plate, centre: complex, radius: float) -> SweptPart:
        """Return a shaft over all crank angles."""
        path = self.place(plate, centre)
        return SweptPart([(path, path)], radius)

    def collide(self, part_a: SweptPart, part_b: SweptPart) -> bool:
        """Return whether two parts may come nearer than the clearance, between samples too."""
        clear_distance = part_a.radius + part_b.radius + CLEARANCE
        for line_a, line_b in product(part_a.lines, part_b.lines):
            if self._min_distance(line_a, line_b) < clear_distance:
                return True
        return False

    def _min_distance(self, line_a: SweptLine, line_b: SweptLine) -> float:
        """Return a lower bound of the distance of two segments over all crank angles [m]."""
        end_motion = np.abs(np.diff((*line_a, *line_b)))
        motion = end_motion[:2].max(axis=0) + end_motion[2:].max(axis=0)
        samples = distances(line_a, line_b)
        lower_bounds = (samples[1:] + samples[:-1] - motion) / 2.0
        self.bound = max(self.bound, float(np.max(motion[self._steps])) / 2.0)
        return float(lower_bounds[self._steps].min())


def distances(line_a: SweptLine, line_b: SweptLine) -> FloatArray:
    """Return the distances of two segments in many poses, shape (k,)."""
    along_a = line_a[1] - line_a[0]
    along_b = line_b[1] - line_b[0]
    offset = line_b[0] - line_a[0]
    determinant = cross(along_a, along_b)
    with np.errstate(divide='ignore', invalid='ignore'):
        s = cross(offset, along_b) / determinant
        t = cross(offset, along_a) / determinant
    is_crossing = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    end_distances = (
        _from_segment(line_a[0], line_b),
        _from_segment(line_a[1], line_b),
        _from_segment(line_b[0], line_a),
        _from_segment(line_b[1], line_a),
    )
    return np.where(is_crossing, 0.0, np.min(end_distances, axis=0))


def _from_segment(point: ComplexArray, line: SweptLine) -> FloatArray:
    start, end = line
    along = end - start
    size = np.abs(along) ** 2
    share = ((point - start) * along.conj()).real / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.abs(point - start - np.clip(share, 0.0, 1.0) * along))


def _shafts(plates: Sequence[Plate]) -> list[Shaft]:
    """Return the pins of the plates; holes that share a point have one."""
    groups: list[list[tuple[int, Hole]]] = []
    for p, plate in enumerate(plates):
        for hole in plate.holes:
            merged_group = [(p, hole)]
            separate = []
            for group in groups:
                if any(hole.points & member.points for _, member in group):
                    merged_group[:-1] += group
                else:
                    separate.append(group)
            groups = [*separate, merged_group]
    shafts = []
    for group in groups:
        shaft = _shaft(plates, group)
        if len(shaft.plates) > 1:
            shafts.append(shaft)
    return shafts


def _shaft(plates: Sequence[Plate], group: Sequence[tuple[int, Hole]]) -> Shaft:
    """Return the pin of holes, each with its plate."""
    carrier, first_hole = group[0]
    through: dict[int, None] = {}
    points: dict[str, None] = {}
    diameter = 0.0
    for p, hole in group:
        through[p] = None
        points |= dict.fromkeys(filter(None, hole.name.split(',')))
        diameter = max(diameter, hole.diameter)
    name = ','.join(points)
    for p, plate in enumerate(plates):
        for slot in plate.slots:
            for q, hole in group:
                is_guided = any(abs(hole.at - pin) < COINCIDENCE for pin in slot.pins)
                if plates[q].body == slot.body and is_guided:
                    through[p] = None
                    name = name if points else f'guide of {slot.name}'
    return Shaft(name, tuple(through), carrier, first_hole.at, diameter)


def _between(layer: Sequence[int], pin: PinPlates) -> tuple[int, ...]:
    """Return the crossing plates between the lowest and the highest joined one."""
    low, high = pin.span(layer)
    return tuple(p for p in pin.crossing if low <= layer[p] <= high)


def _fewest(
    clashes: Sequence[set[int]], pins: Sequence[PinPlates], ground: int | None
) -> tuple[int, ...] | None:
    """Return the layer of each plate, as few as possible; None if no number is enough."""
    for layer_count in range(1, len(clashes) + 1):
        for lowest in (ground, None) if ground is not None else (None,):
            arrangements = [*_Search(clashes, pins, layer_count, lowest).arrangements(0)]
            if arrangements:
                return arrangements[-1]
    return None


class _Search:
    """Depth-first search of the plates' layers, for a given number of layers."""

    def __init__(
        self,
        clashes: Sequence[set[int]],
        pins: Sequence[PinPlates],
        layer_count: int,
        lowest: int | None,
    ) -> None:
        self._clashes = clashes
        self._pins = pins
        self._layer_count = layer_count
        self._lowest = lowest
        # The lowest plate first, then those with the most clashes.
        self._order = sorted(range(len(clashes)), key=lambda p: (p != lowest, -len(clashes[p])))
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
            arrangement = tuple(self._layers_of(range(len(self._order))))
            cost = len(_flush(arrangement, self._pins)), self._length()
            if self._best is None or cost < self._best:
                self._best = cost
                yield arrangement
            return
        plate = self._order[depth]
        for layer in (0,) if plate == self._lowest else range(self._layer_count):
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
        for pin in self._pins:
            joined = self._layers_of(pin.joined)
            if len(joined) > 1:
                low = min(joined)
                high = max(joined)
                if any(low <= crossed <= high for crossed in self._layers_of(pin.crossing)):
                    return False
        return True

    def _layers_of(self, plates: Sequence[int]) -> list[int]:
        """Return the layers of those plates that have one so far."""
        return [self._layer[p] for p in plates if p in self._layer]

    def _length(self) -> int:
        """Return the total length of all shafts so far [layers]."""
        length = 0
        for pin in self._pins:
            joined = self._layers_of(pin.joined)
            length += max(joined) - min(joined) if joined else 0
        return length


def _flush(layer: Sequence[int], pins: Sequence[PinPlates]) -> list[tuple[int, Side]]:
    """Return the ends of shafts, by their number, that a plate of the next layer passes."""
    ends = []
    for k, pin in enumerate(pins):
        low, high = pin.span(layer)
        crossed_layers = {layer[p] for p in pin.crossing}
        if low - 1 in crossed_layers:
            ends.append((k, Side.LOWER))
        if high + 1 in crossed_layers:
            ends.append((k, Side.UPPER))
    return ends
