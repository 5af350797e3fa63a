"""
The bodies of a robot as flat plates: links of one width along bars, with holes at the joints.

A plate's coordinates are those of its body, from its first point along its angle; the ground's are
the plane's. A sliding body has pins, and the body that it slides along a slot for them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import isfinite

from klann_ros.kinematics import body_points, FIXED, Linkage
from klann_ros.robot import Robot
from klann_ros.sanitize.text import counted, did_you_mean

from .outline import crosses, distance_to, nearest_on, Segment
from .travel import ExportError, slide_lines, SlideLine

# Points within this distance coincide [m].
COINCIDENCE = 1e-9
# Candidate positions of a sliding body's pins along its line, in widths from its first point.
GUIDE_POSITIONS = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 5.0, -5.0)
GROUND = 'ground'
# Minimum material between a hole and an edge, or another hole, as a part of its diameter.
MIN_WALL = 0.25

__all__ = ['ExportError', 'Hole', 'Plate', 'Slot', 'plates', 'slot_conflict']


@dataclass(frozen=True)
class Hole:
    """A hole in a plate."""

    name: str  # its points, such as 'A'; '' for a guide pin
    at: complex  # its centre [m]
    diameter: float  # [m]

    @property
    def shown(self) -> str:
        """Return its name for messages."""
        return f'hole {self.name}' if self.name else 'a guide'


@dataclass(frozen=True)
class Slot:
    """A slot in a plate."""

    name: str  # the body whose pins run in it
    start: complex  # the outermost centres of the pins [m]
    end: complex
    diameter: float  # its width, the diameter of the pins' holes [m]
    body: int  # the number of the sliding body
    pins: tuple[complex, ...]  # in its coordinates [m]

    @property
    def shown(self) -> str:
        """Return its name for messages."""
        return f'the slot of {self.name}'

    @property
    def line(self) -> Segment:
        """Return its centre line [m]."""
        return self.start, self.end


@dataclass(frozen=True)
class Plate:
    """
    A plate of a body, with holes and slots.

    `count` is the number of such plates in the robot, `legs` the first leg that has it, if legs
    differ. `links` are the centre lines of its material, all of one `width` [m]. `body` is the
    number of its body, FIXED for the ground.
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
    Return the plates of a robot; equal legs once, with their number.

    Parameters
    ----------
    robot : Robot
        The robot.
    hole : float
        The diameter of the holes [m].
    width : float
        The width of a link [m].
    scale : float
        Scale of the robot; holes and width stay.
    holes : mapping of str to float, optional
        The diameters of some joints, by the names of their points [m].

    Raises
    ------
    GeometryError
        The scale is not finite and > 0.
    ExportError
        A diameter or the width is invalid, a joint is unknown, or holes are too close.

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
        diameters = one.diameter, other.diameter
        least = sum(diameters) / 2.0 + MIN_WALL * max(diameters)
        if abs(one.at - other.at) < least:
            raise ExportError(
                f'{plate.name}: {one.shown} and {other.shown} are '
                f'{abs(one.at - other.at) * 1e3:.3g} mm apart, at least {least * 1e3:.3g} mm are '
                f'needed: use smaller holes (--hole) or a larger --scale'
            )


def slot_conflict(plate: Plate) -> str:
    """Return a message about slots of a plate that overlap a hole or a slot, '' without any."""
    cuts: list[tuple[Hole | Slot, Segment]] = [(slot, slot.line) for slot in plate.slots]
    cuts += [(hole, (hole.at, hole.at)) for hole in plate.holes]
    met = [
        f'{one.shown} and {other.shown}'
        for (one, line), (other, place) in combinations(cuts, 2)
        if isinstance(one, Slot) and _gap(line, place)[0] < (one.diameter + other.diameter) / 2.0
    ]
    if not met:
        return ''
    more = f', and {counted(len(met) - 1, "more pair")}' if len(met) > 1 else ''
    return f'{plate.name}: {met[0]} run into each other{more}'


def _of_linkage(linkage: Linkage, sizes: Mapping[str, float], width: float) -> Iterator[Plate]:
    """Yield the plates of a leg, the ground's first."""
    structure, lines = linkage.structure, list(slide_lines(linkage))
    places, hole = body_points(linkage.structure, linkage.bars), sizes['']
    drilled = {
        j: [Hole(point, places[j, point], sizes.get(point, hole)) for point in body.points]
        for j, body in enumerate(structure.bodies)
    }
    drilled[FIXED] = [
        Hole(name, complex(at), sizes.get(name, hole))
        for name, at in zip(structure.pivots, linkage.pivots, strict=True)
        if len(structure.owners[name]) > 1
    ]
    # A sliding body's pins keep clear of the slots in it, first taken as short as with one pin.
    short: dict[int, list[Segment]] = {j: [] for j in drilled}
    for line in lines:
        short[line.on].append(line.ends([0.0]))
    slots: dict[int, list[Slot]] = {j: [] for j in drilled}
    for line in lines:
        j, pins, widest = line.body, [0.0], drilled[line.body][0].diameter
        if structure.bodies[j].rigid:
            is_joint = len(structure.owners[structure.bodies[j].points[0]]) > 1
            joints = drilled[j] if is_joint else drilled[j][1:]
            pins = _pins(line, joints, short[j], hole, width, is_joint=is_joint)
            guides = [Hole('', x * line.direction, hole) for x in pins if x or not is_joint]
            drilled[j] = [*joints, *guides]
            widest = max(hole, widest) if is_joint else hole
        places_on_line = tuple(x * line.direction for x in pins)
        slots[line.on].append(Slot(line.name, *line.ends(pins), widest, j, places_on_line))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    for j in (FIXED, *range(len(structure.bodies))):
        if drilled[j] or slots[j]:
            holes = tuple(_merged(drilled[j]))
            bars = [] if j == FIXED else [*_bars(linkage, j, places)]
            cuts: list[Segment] = [(one.at, one.at) for one in holes]
            cuts += [slot.line for slot in slots[j]]
            links = tuple(_joined(bars, cuts))
            yield Plate(names[j], holes, tuple(slots[j]), links=links, width=width, body=j)


def _bars(
    linkage: Linkage, j: int, places: Mapping[tuple[int, str], complex]
) -> Iterator[Segment]:
    for bar in linkage.structure.bodies[j].rigid:
        yield places[j, bar.start], places[j, bar.end]
        if bar.brace is not None:
            yield places[j, bar.brace.start], places[j, bar.end]


def _joined(bars: Sequence[Segment], cuts: Sequence[Segment]) -> Iterator[Segment]:
    """Yield bars, links around cuts, and the shortest links that connect all of these."""
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
    """Return the distance of two segments, 0 if they cross, and the shortest link between."""
    if crosses(one, other):
        return 0.0, (one[0], one[0])
    links = [(end, nearest_on(other, end)) for end in one]
    links += [(end, nearest_on(one, end)) for end in other]
    link = min(links, key=lambda link: abs(link[1] - link[0]))
    return abs(link[1] - link[0]), link


def _pins(
    line: SlideLine,
    joints: Sequence[Hole],
    slots: Sequence[Segment],
    hole: float,
    width: float,
    *,
    is_joint: bool,
) -> list[float]:
    """Return the positions of a sliding body's two pins on its line [m]; one may be its joint."""
    clearance = max(hole, width / 2.0)
    pins = [0.0] if is_joint else []
    for part in GUIDE_POSITIONS:
        at = part * width * line.direction
        apart = [abs(other.at - at) for other in joints]
        apart += [distance_to(slot, at) for slot in slots]
        apart += [abs(part * width - pin) for pin in pins]
        if len(pins) < 2 and all(far >= clearance for far in apart):
            pins.append(part * width)
    return pins or [0.0]


def _merged(holes: list[Hole]) -> Iterator[Hole]:
    """Yield holes, coincident ones as one."""
    groups: list[list[Hole]] = []
    for hole in holes:
        group = next((g for g in groups if abs(g[0].at - hole.at) < COINCIDENCE), None)
        if group is None:
            groups.append([hole])
        else:
            group.append(hole)
    for group in groups:
        name = ','.join(filter(None, (hole.name for hole in group)))
        yield Hole(name, group[0].at, max(hole.diameter for hole in group))
