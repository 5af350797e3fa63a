"""
The bodies of a robot as flat plates: links of one width along bars, with holes at the joints.

A plate's coordinates are those of its body, from its first point along its angle; the ground's are
the plane's. A sliding body has pins, and the body that it slides along a slot for them.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import isfinite

from klann_ros.kinematics import body_points, FIXED, GROUND, Linkage
from klann_ros.robot import Robot
from klann_ros.sanitize.text import counted, did_you_mean

from .outline import crosses, distance_to, nearest_on, Segment
from .travel import ExportError, slide_lines, SlideLine

# Points within this distance coincide [m].
COINCIDENCE = 1e-9
# Candidate positions of a sliding body's pins along its line, in widths from its first point.
GUIDE_POSITIONS = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 5.0, -5.0)
# Minimum material between a hole and an edge, or another hole, as a part of its diameter.
MIN_WALL = 0.25

__all__ = ['ExportError', 'Hole', 'Plate', 'Slot', 'plates', 'slot_conflict']


@dataclass(frozen=True)
class Hole:
    """A hole in a plate."""

    name: str  # its points, such as 'A'; '' for a guide pin
    at: complex  # its centre [m]
    diameter: float  # that of the seat, if it has one [m]
    depth: float = 0.0  # of the seat in its upper end [m]
    bore: float = 0.0  # its diameter below a seat that does not go through [m]

    @property
    def label(self) -> str:
        """Return its name for messages."""
        return f'hole {self.name}' if self.name else 'a guide'

    @property
    def points(self) -> frozenset[str]:
        """Return the points that it joins."""
        return frozenset(self.name.split(',')) - {''}

    @property
    def line(self) -> Segment:
        """Return its centre as a line of length 0 [m]."""
        return self.at, self.at


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
    def label(self) -> str:
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
    robot: Robot, *, hole: float, width: float, holes: Mapping[str, float] | None = None
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
    holes : mapping of str to float, optional
        The diameters of some joints, by the names of their points [m].

    Raises
    ------
    ExportError
        A diameter or the width is invalid, a joint is unknown, or holes are too close.

    """
    sizes = {'': hole, **(holes or {})}
    widest = max(sizes.values())
    if not (isfinite(width) and min(sizes.values()) > 0.0 and widest < width):
        raise ExportError(
            f'hole = {widest * 1e3:g} mm, width = {width * 1e3:g} mm are refused: a hole must '
            f'be > 0, and a bar wider than its hole'
        )
    min_width = (1.0 + 2.0 * MIN_WALL) * widest
    if width < min_width * (1.0 - COINCIDENCE):
        raise ExportError(
            f'width = {width * 1e3:g} mm leaves {(width - widest) * 500:.3g} mm beside a hole '
            f'of {widest * 1e3:g} mm: at least {min_width * 1e3:.4g} mm are needed'
        )
    legs_of: dict[Linkage, list[str]] = {}
    for leg in robot.legs:
        legs_of.setdefault(leg.linkage, []).append(leg.name)
    robot_plates: list[Plate] = []
    joints: set[str] = set()
    for linkage, names in legs_of.items():
        legs = '' if len(legs_of) == 1 else names[0]
        for plate in _linkage_plates(linkage, sizes, width):
            robot_plates.append(replace(plate, count=len(names), legs=legs))
            for drilled in plate.holes:
                joints |= drilled.points
    for name in sizes.keys() - joints - {''}:
        listing = ', '.join(sorted(joints))
        raise ExportError(
            f'hole of {name}: no such joint; there are {listing}{did_you_mean(name, joints)}'
        )
    for plate in robot_plates:
        check_holes(plate)
    return tuple(robot_plates)


def check_holes(plate: Plate) -> None:
    """Refuse holes that leave too little material between them."""
    for hole_a, hole_b in combinations(plate.holes, 2):
        diameters = hole_a.diameter, hole_b.diameter
        distance = abs(hole_a.at - hole_b.at)
        min_distance = sum(diameters) / 2.0 + MIN_WALL * max(diameters)
        if distance < min_distance:
            raise ExportError(
                f'{plate.name}: {hole_a.label} and {hole_b.label} are {distance * 1e3:.3g} mm '
                f'apart, at least {min_distance * 1e3:.3g} mm are needed: use smaller holes '
                f'(--hole, --seat) or a larger --scale'
            )


def slot_conflict(plate: Plate) -> str:
    """Return a message about slots of a plate that overlap a hole or a slot, '' without any."""
    conflicts = []
    cuts: list[Slot | Hole] = [*plate.slots, *plate.holes]
    for slot, cut in combinations(cuts, 2):
        distance = _connection(slot.line, cut.line)[0]
        if isinstance(slot, Slot) and distance < (slot.diameter + cut.diameter) / 2.0:
            conflicts.append(f'{slot.label} and {cut.label}')
    if not conflicts:
        return ''
    more = f', and {counted(len(conflicts) - 1, "more pair")}' if len(conflicts) > 1 else ''
    return f'{plate.name}: {conflicts[0]} run into each other{more}'


def _linkage_plates(linkage: Linkage, sizes: Mapping[str, float], width: float) -> Iterator[Plate]:
    """Yield the plates of a leg, the ground's first."""
    structure = linkage.structure
    lines = list(slide_lines(linkage))
    places = body_points(structure, linkage.bars)
    hole = sizes['']
    holes: dict[int, list[Hole]] = {FIXED: []}
    for name, place in zip(structure.pivots, linkage.pivots, strict=True):
        if len(structure.owners[name]) > 1:
            holes[FIXED].append(Hole(name, complex(place), sizes.get(name, hole)))
    for j, body in enumerate(structure.bodies):
        holes[j] = [Hole(name, places[j, name], sizes.get(name, hole)) for name in body.points]
    # A sliding body's pins keep clear of the slots in it, first taken as short as with one pin.
    short_slots: defaultdict[int, list[Segment]] = defaultdict(list)
    for line in lines:
        short_slots[line.on].append(line.ends([0.0]))
    slots: defaultdict[int, list[Slot]] = defaultdict(list)
    for line in lines:
        j = line.body
        pins = [0.0]
        diameter = holes[j][0].diameter
        if structure.bodies[j].rigid:
            is_joint = len(structure.owners[structure.bodies[j].points[0]]) > 1
            joints = holes[j] if is_joint else holes[j][1:]
            pins = _pins(line, joints, short_slots[j], hole, width, is_joint=is_joint)
            guides = [Hole('', x * line.direction, hole) for x in pins if x or not is_joint]
            holes[j] = [*joints, *guides]
            diameter = max(hole, diameter) if is_joint else hole
        pins_on_line = tuple(x * line.direction for x in pins)
        slots[line.on].append(Slot(line.name, *line.ends(pins), diameter, j, pins_on_line))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    for j, name in names.items():
        if holes[j] or slots[j]:
            plate_holes = tuple(merged_holes(holes[j]))
            bars = [] if j == FIXED else [*_bars(linkage, j, places)]
            cuts = [hole.line for hole in plate_holes] + [slot.line for slot in slots[j]]
            links = tuple(joined_links(bars, cuts))
            yield Plate(name, plate_holes, tuple(slots[j]), links=links, width=width, body=j)


def _bars(
    linkage: Linkage, j: int, places: Mapping[tuple[int, str], complex]
) -> Iterator[Segment]:
    for bar in linkage.structure.bodies[j].rigid:
        yield places[j, bar.start], places[j, bar.end]
        if bar.brace is not None:
            yield places[j, bar.brace.start], places[j, bar.end]


def joined_links(bars: Sequence[Segment], cuts: Sequence[Segment]) -> Iterator[Segment]:
    """Yield bars, links around cuts, and the shortest links that connect all of these."""
    groups: list[list[Segment]] = []
    for segment in (*bars, *cuts):
        merged_group = []
        separate = []
        for group in groups:
            if any(_connection(segment, member)[0] < COINCIDENCE for member in group):
                merged_group += group
            else:
                separate.append(group)
        groups = [*separate, [*merged_group, segment]]
    while len(groups) > 1:
        connections = []
        for i, k in combinations(range(len(groups)), 2):
            for start, end in product(groups[i], groups[k]):
                connections.append((*_connection(start, end), i, k))
        _, link, i, k = min(connections, key=lambda connection: connection[0])
        groups[i] += [link, *groups.pop(k)]
    segments = [(start, end) for start, end in groups[0] if start != end]
    yield from dict.fromkeys(segments or groups[0][:1])


def _connection(segment_a: Segment, segment_b: Segment) -> tuple[float, Segment]:
    """Return the distance of two segments, 0 if they cross, and the shortest link between."""
    if crosses(segment_a, segment_b):
        return 0.0, (segment_a[0], segment_a[0])
    links = []
    for segment, neighbour in ((segment_a, segment_b), (segment_b, segment_a)):
        for end in segment:
            links.append((end, nearest_on(neighbour, end)))
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
    for factor in GUIDE_POSITIONS:
        position = factor * width
        centre = position * line.direction
        distances = [abs(joint.at - centre) for joint in joints]
        distances += [distance_to(slot, centre) for slot in slots]
        distances += [abs(position - pin) for pin in pins]
        if len(pins) < 2 and min(distances, default=clearance) >= clearance:
            pins.append(position)
    return pins or [0.0]


def merged_holes(holes: list[Hole]) -> Iterator[Hole]:
    """Yield holes, coincident ones as one."""
    groups: list[list[Hole]] = []
    for hole in holes:
        for group in groups:
            if abs(group[0].at - hole.at) < COINCIDENCE:
                group.append(hole)
                break
        else:
            groups.append([hole])
    for group in groups:
        names = [hole.name for hole in group if hole.name]
        widest = max(group, key=lambda hole: hole.diameter)
        yield replace(widest, name=','.join(names), at=group[0].at)
