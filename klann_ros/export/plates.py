"""
The bodies of a robot as flat plates: links of one width along bars, with holes at the joints.

A plate's coordinates are those of its body, from its first point along its angle; the ground's are
the plane's. What slides along a body has a slot there, as wide as a hole, for its pins to run in.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import isfinite

from klann_ros.dynamics.masses import body_places
from klann_ros.kinematics import Linkage
from klann_ros.kinematics.linkage.structure import FIXED
from klann_ros.robot import Robot
from klann_ros.sanitize.text import counted, did_you_mean

from .outline import crosses, distance_to, nearest_on, Segment
from .travel import ExportError, slide_lines, SlideLine

# Nearer than this two points are one [m].
COINCIDENCE = 1e-9
# Where the pins of what slides may stand, by the width from where its distance is measured.
GUIDES = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 5.0, -5.0)
GROUND = 'ground'
# The least material between a hole and an edge, or another hole, as a part of its diameter.
MIN_WALL = 0.25

__all__ = ['ExportError', 'Hole', 'Plate', 'Slot', 'plates', 'slot_conflict']


@dataclass(frozen=True)
class Hole:
    """A hole in a plate."""

    # The points there, such as 'A'; '' for a pin that only guides.
    name: str
    # Its centre [m].
    at: complex
    # Its diameter [m].
    diameter: float

    @property
    def shown(self) -> str:
        """Return its name for messages."""
        return f'hole {self.name}' if self.name else 'a guide'


@dataclass(frozen=True)
class Slot:
    """A slot in a plate."""

    # The body whose pins run in it.
    name: str
    # The outermost centres of the pins [m].
    start: complex
    end: complex
    # Its width, the diameter of the pins' holes [m].
    diameter: float
    # The body that slides, and its pins, in its coordinates [m].
    body: int
    pins: tuple[complex, ...]

    @property
    def shown(self) -> str:
        """Return its name for messages."""
        return f'the slot of {self.name}'

    def distance(self, at: complex) -> float:
        """Return the distance of a place from its centre line [m]."""
        return distance_to((self.start, self.end), at)


@dataclass(frozen=True)
class Plate:
    """
    A plate.

    Attributes
    ----------
    name : str
        Its body.
    holes : tuple of Hole
        Its holes.
    slots : tuple of Slot
        Its slots.
    count : int
        How many the robot has of it.
    legs : str
        Of which legs it is, where not all are alike.
    links : tuple of (complex, complex)
        The centre lines of its material, all of one width [m].
    width : float
        Of its links [m].
    body : int
        The number of its body, FIXED for the ground.

    """

    name: str
    holes: tuple[Hole, ...]
    slots: tuple[Slot, ...] = ()
    count: int = 1
    legs: str = ''
    links: tuple[Segment, ...] = ()
    width: float = 0.0
    body: int = FIXED

    @property
    def title(self) -> str:
        """Return its label: leg, body, points and count."""
        words = [self.legs, self.name, *(hole.name for hole in self.holes)]
        return ' '.join(filter(None, words)) + (f' x{self.count}' if self.count > 1 else '')


def plates(
    robot: Robot,
    *,
    hole: float,
    width: float,
    scale: float = 1.0,
    holes: Mapping[str, float] | None = None,
) -> tuple[Plate, ...]:
    """
    Return the plates of a robot: of legs that are alike once, with their number.

    Parameters
    ----------
    robot : Robot
        Its bodies are cut.
    hole : float
        The diameter of the holes [m].
    width : float
        The width of a link [m].
    scale : float
        The plates' size over the robot's; hole and width stay.
    holes : mapping of str to float, optional
        The diameters of some joints, by the names of their points [m].

    Raises
    ------
    GeometryError
        The scale is not finite and > 0.
    ExportError
        A diameter or the width is refused, or there is no such joint; holes are too near to each
        other.

    """
    sizes = {'': hole, **(holes or {})}
    greatest = max(sizes.values())
    if not (isfinite(width) and min(sizes.values()) > 0.0 and greatest < width):
        raise ExportError(
            f'hole = {greatest * 1e3:g} mm, width = {width * 1e3:g} mm are refused: a hole must '
            f'be > 0, and a bar wider than its hole'
        )
    least = (1.0 + 2.0 * MIN_WALL) * greatest
    if width < least * (1.0 - COINCIDENCE):
        raise ExportError(
            f'width = {width * 1e3:g} mm leaves {(width - greatest) * 500:.3g} mm beside a hole '
            f'of {greatest * 1e3:g} mm: at least {least * 1e3:.4g} mm are needed'
        )
    alike: dict[Linkage, list[str]] = {}
    for leg in robot.legs:
        alike.setdefault(leg.linkage.scaled(scale), []).append(leg.name)
    made: list[Plate] = []
    for linkage, names in alike.items():
        legs = '' if len(alike) == 1 else names[0]
        made += [
            replace(plate, count=len(names), legs=legs)
            for plate in _of_linkage(linkage, sizes, width)
        ]
    known = {name for plate in made for one in plate.holes for name in one.name.split(',')}
    for name in sizes.keys() - known - {''}:
        there = ', '.join(sorted(known - {''}))
        raise ExportError(
            f'hole of {name}: no such joint; there are {there}{did_you_mean(name, known)}'
        )
    for plate in made:
        _check_holes(plate)
    return tuple(made)


def _check_holes(plate: Plate) -> None:
    """Refuse holes that leave too little material between them."""
    for one, other in combinations(plate.holes, 2):
        least = (one.diameter + other.diameter) / 2.0 + MIN_WALL * max(
            one.diameter, other.diameter
        )
        if abs(one.at - other.at) < least:
            raise ExportError(
                f'{plate.name}: {one.shown} and {other.shown} are '
                f'{abs(one.at - other.at) * 1e3:.3g} mm apart, at least {least * 1e3:.3g} mm are '
                f'needed: use smaller holes (--hole) or a larger --scale'
            )


def slot_conflict(plate: Plate) -> str:
    """Return which slots of a plate run into a hole or a slot, '' for none."""
    cuts: tuple[Hole | Slot, ...] = (*plate.slots, *plate.holes)
    met = [
        f'{one.shown} and {other.shown}'
        for one, other in combinations(cuts, 2)
        if isinstance(one, Slot) and _distance(one, other) < (one.diameter + other.diameter) / 2.0
    ]
    if not met:
        return ''
    more = f', and {counted(len(met) - 1, "more pair")}' if len(met) > 1 else ''
    return f'{plate.name}: {met[0]} run into each other{more}'


def _distance(one: Slot, other: Hole | Slot) -> float:
    if isinstance(other, Hole):
        return one.distance(other.at)
    return _gap((one.start, one.end), (other.start, other.end))[0]


def _of_linkage(linkage: Linkage, sizes: Mapping[str, float], width: float) -> Iterator[Plate]:
    """Yield the plates of a leg, the ground's first."""
    structure, lines = linkage.structure, list(slide_lines(linkage))
    places, hole = body_places(linkage), sizes['']
    drilled = {
        j: [Hole(point, places[j, point], sizes.get(point, hole)) for point in body.points]
        for j, body in enumerate(structure.bodies)
    }
    drilled[FIXED] = [
        Hole(name, complex(at), sizes.get(name, hole))
        for name, at in zip(structure.pivots, linkage.pivots, strict=True)
        if len(structure.owners[name]) > 1
    ]
    widest = {line.body: drilled[line.body][0].diameter for line in lines}
    slots: dict[int, list[Slot]] = {j: [] for j in drilled}
    for line in lines:
        slots[line.on].append(_slot(line, [0.0], widest[line.body]))
    pins = {}
    for line in lines:
        pins[line.body] = [0.0]
        if structure.bodies[line.body].rigid:
            body = structure.bodies[line.body]
            is_joint = len(structure.owners[body.points[0]]) > 1
            pins[line.body] = _pins(
                line, drilled[line.body], slots[line.body], hole, width, is_joint
            )
            round_holes = drilled[line.body] if is_joint else drilled[line.body][1:]
            guides = [
                Hole('', x * line.direction, hole) for x in pins[line.body] if x or not is_joint
            ]
            drilled[line.body] = [*round_holes, *guides]
            widest[line.body] = max(hole, widest[line.body]) if is_joint else hole
    for on in slots:
        slots[on] = [
            _slot(line, pins[line.body], widest[line.body]) for line in lines if line.on == on
        ]
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    for j in (FIXED, *range(len(structure.bodies))):
        if drilled[j] or slots[j]:
            holes = tuple(_merged(drilled[j]))
            bars = [] if j == FIXED else [*_bars(linkage, j, places)]
            cuts: list[Segment] = [(at, at) for one in holes for at in [one.at]]
            cuts += [(slot.start, slot.end) for slot in slots[j]]
            links = tuple(_joined(bars, cuts))
            yield Plate(names[j], holes, tuple(slots[j]), links=links, width=width, body=j)


def _slot(line: SlideLine, pins: Sequence[float], diameter: float) -> Slot:
    at = tuple(x * line.direction for x in pins)
    return Slot(line.name, *line.ends(pins), diameter, line.body, at)


def _bars(
    linkage: Linkage, j: int, places: Mapping[tuple[int, str], complex]
) -> Iterator[Segment]:
    """Yield the bars and braces of a body as segments."""
    for bar in linkage.structure.bodies[j].rigid:
        yield places[j, bar.start], places[j, bar.end]
        if bar.brace is not None:
            yield places[j, bar.brace.start], places[j, bar.end]


def _joined(bars: Sequence[Segment], cuts: Sequence[Segment]) -> Iterator[Segment]:
    """Yield bars, what cuts need around them, and the shortest links that join it all."""
    groups: list[list[Segment]] = []
    for segment in (*bars, *cuts):
        touched = [
            group for group in groups if any(_gap(segment, one)[0] < COINCIDENCE for one in group)
        ]
        groups = [group for group in groups if group not in touched]
        groups.append([*(one for group in touched for one in group), segment])
    while len(groups) > 1:
        pairs = (
            (*_gap(one, other), i, k)
            for (i, mine), (k, others) in combinations(enumerate(groups), 2)
            for one, other in product(mine, others)
        )
        _, link, i, k = min(pairs, key=lambda pair: pair[0])
        groups[i] += [link, *groups.pop(k)]
    segments = [segment for segment in groups[0] if segment[0] != segment[1]] or groups[0][:1]
    yield from dict.fromkeys(segments)


def _gap(one: Segment, other: Segment) -> tuple[float, Segment]:
    """Return the distance of two segments, and the shortest link between them; 0 if they cross."""
    if crosses(one, other):
        return 0.0, (one[0], one[0])
    links = [(end, nearest_on(other, end)) for end in one]
    links += [(end, nearest_on(one, end)) for end in other]
    link = min(links, key=lambda link: abs(link[1] - link[0]))
    return abs(link[1] - link[0]), link


def _pins(  # noqa: PLR0917 - shared state
    line: SlideLine,
    holes: list[Hole],
    slots: list[Slot],
    hole: float,
    width: float,
    is_joint: bool,
) -> list[float]:
    """
    Return where on its line the two pins are that hold what slides [m].

    One is the joint where its distance is measured, if that is one.
    """
    holes = holes if is_joint else holes[1:]
    room = max(hole, width / 2.0)
    pins = [0.0] if is_joint else []
    for part in GUIDES:
        at = part * width * line.direction
        apart = [abs(other.at - at) for other in holes] + [slot.distance(at) for slot in slots]
        apart += [abs(part * width - pin) for pin in pins]
        if len(pins) < 2 and all(far >= room for far in apart):
            pins.append(part * width)
    return pins or [0.0]


def _merged(holes: list[Hole]) -> Iterator[Hole]:
    """Yield holes, those at one place as one."""
    merged: list[Hole] = []
    for hole in holes:
        same = next(
            (k for k, other in enumerate(merged) if abs(other.at - hole.at) < COINCIDENCE), None
        )
        if same is None:
            merged.append(hole)
        else:
            name = f'{merged[same].name},{hole.name}'.strip(',')
            widest = max(merged[same].diameter, hole.diameter)
            merged[same] = Hole(name, merged[same].at, widest)
    yield from merged
