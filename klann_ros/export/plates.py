"""
The bodies of a robot as flat plates: holes where the joints are, slots where something slides.

A plate's coordinates are those of its body, from its first point along its angle; the ground's are
the plane's. What slides along a body has a slot there, as wide as a hole, for its pins to run in.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from math import isfinite
from typing import NamedTuple

from klann_ros.dynamics.masses import body_places
from klann_ros.kinematics import Linkage
from klann_ros.kinematics.linkage.structure import FIXED
from klann_ros.robot import Robot
from klann_ros.untrusted.text import counted

from .travel import ExportError, travel

# Nearer than this two points are one [m].
SAME = 1e-9
# Where the pins of what slides may stand, by the width from where its distance is measured.
GUIDES = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 5.0, -5.0)
GROUND = 'ground'

__all__ = ['ExportError', 'Hole', 'Plate', 'Slot', 'near', 'plates']


@dataclass(frozen=True)
class Hole:
    """A hole in a plate."""

    # The points there, such as 'A'; '' for a pin that only guides.
    name: str
    # Where its middle is [m].
    at: complex

    @property
    def shown(self) -> str:
        """Return what it is called in a sentence."""
        return f'hole {self.name}' if self.name else 'a guide'


@dataclass(frozen=True)
class Slot:
    """A slot in a plate."""

    # The body whose pins run in it.
    name: str
    # The outermost middles of the pins [m].
    start: complex
    end: complex

    @property
    def shown(self) -> str:
        """Return what it is called in a sentence."""
        return f'the slot of {self.name}'

    def distance(self, at: complex) -> float:
        """Return how far a place is from its middle line [m]."""
        along = self.end - self.start
        if not along:
            return abs(at - self.start)
        part = ((at - self.start) * along.conjugate()).real / abs(along) ** 2
        return abs(at - self.start - min(max(part, 0.0), 1.0) * along)


class Line(NamedTuple):
    """What a body slides along."""

    # What slides, and what has the line, FIXED being the ground.
    body: int
    on: int
    # What slides.
    name: str
    # Where the distance is 0, in what has the line [m], and which way it grows.
    origin: complex
    direction: complex
    # Of the distance [m].
    least: float
    greatest: float

    def slot(self, pins: list[float]) -> Slot:
        """Return the slot for pins that are so far from where the distance is measured [m]."""
        start = self.origin + (self.least + min(pins)) * self.direction
        return Slot(self.name, start, self.origin + (self.greatest + max(pins)) * self.direction)


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

    """

    name: str
    holes: tuple[Hole, ...]
    slots: tuple[Slot, ...] = ()
    count: int = 1
    legs: str = ''

    @property
    def title(self) -> str:
        """Return what is written on it: its leg and its body, its points, how many there are."""
        words = [self.legs, self.name, *(hole.name for hole in self.holes)]
        return ' '.join(filter(None, words)) + (f' x{self.count}' if self.count > 1 else '')

    @property
    def corners(self) -> tuple[complex, ...]:
        """Return what its outline goes around [m]."""
        return (
            *(hole.at for hole in self.holes),
            *(end for slot in self.slots for end in (slot.start, slot.end)),
        )


def plates(robot: Robot, *, hole: float, width: float, scale: float = 1.0) -> tuple[Plate, ...]:
    """
    Return the plates of a robot: of legs that are alike once, with their number.

    Parameters
    ----------
    robot : Robot
        What is cut.
    hole : float
        The holes' diameter [m].
    width : float
        The width of a bar [m].
    scale : float
        How many times as large as it is the robot is cut; hole and width stay.

    Raises
    ------
    GeometryError
        The scale is none.
    ExportError
        The numbers are none, or a bar is no wider than its hole.

    """
    if not (isfinite(width) and 0.0 < hole < width):
        raise ExportError(
            f'hole = {hole * 1e3:g} mm, width = {width * 1e3:g} mm are refused: a hole must be '
            f'> 0, and a bar wider than its hole'
        )
    alike: dict[Linkage, list[str]] = {}
    for leg in robot.legs:
        alike.setdefault(leg.linkage.scaled(scale), []).append(leg.name)
    made = []
    for linkage, names in alike.items():
        legs = '' if len(alike) == 1 else names[0]
        made += [
            replace(plate, count=len(names), legs=legs)
            for plate in _of_linkage(linkage, hole, width)
        ]
    return tuple(made)


def near(plate: Plate, hole: float) -> str:
    """Return which holes and slots of a plate run into each other, '' for none."""
    cuts: tuple[Hole | Slot, ...] = (*plate.holes, *plate.slots)
    met = [
        f'{one.shown} and {other.shown}'
        for one, other in combinations(cuts, 2)
        if _distance(one, other) < hole
    ]
    if not met:
        return ''
    more = f', and {counted(len(met) - 1, "more pair")}' if len(met) > 1 else ''
    return f'{plate.name}: {met[0]} run into each other{more}'


def _distance(one: Hole | Slot, other: Hole | Slot) -> float:
    if isinstance(one, Hole):
        return abs(one.at - other.at) if isinstance(other, Hole) else other.distance(one.at)
    if isinstance(other, Hole):
        return one.distance(other.at)
    a, b = one.end - one.start, other.end - other.start
    across = (a.conjugate() * b).imag
    if across:
        apart = other.start - one.start
        s, t = (apart.conjugate() * b).imag / across, (apart.conjugate() * a).imag / across
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return 0.0
    ends = [one.distance(end) for end in (other.start, other.end)]
    return min(*ends, other.distance(one.start), other.distance(one.end))


def _of_linkage(linkage: Linkage, hole: float, width: float) -> Iterator[Plate]:
    """Yield the plates of a leg, the ground's first."""
    structure, lines = linkage.structure, list(_lines(linkage))
    places = body_places(linkage)
    drilled = {
        j: [Hole(point, places[j, point]) for point in body.points]
        for j, body in enumerate(structure.bodies)
    }
    drilled[FIXED] = [
        Hole(name, complex(at))
        for name, at in zip(structure.pivots, linkage.pivots, strict=True)
        if len(structure.owners[name]) > 1
    ]
    slots: dict[int, list[Slot]] = {j: [] for j in drilled}
    for line in lines:
        slots[line.on].append(line.slot([0.0]))
    pins = {}
    for line in lines:
        pins[line.body] = [0.0]
        if structure.bodies[line.body].rigid:
            body = structure.bodies[line.body]
            is_joint = len(structure.owners[body.points[0]]) > 1
            pins[line.body] = _pins(
                line, drilled[line.body], slots[line.body], hole, width, is_joint
            )
            kept = drilled[line.body] if is_joint else drilled[line.body][1:]
            guides = [Hole('', x * line.direction) for x in pins[line.body] if x or not is_joint]
            drilled[line.body] = [*kept, *guides]
    for on in slots:
        slots[on] = [line.slot(pins[line.body]) for line in lines if line.on == on]
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    for j in (FIXED, *range(len(structure.bodies))):
        if drilled[j] or slots[j]:
            yield Plate(names[j], tuple(_merged(drilled[j])), tuple(slots[j]))


def _lines(linkage: Linkage) -> Iterator[Line]:
    """Yield the lines that bodies slide along."""
    structure, places = linkage.structure, body_places(linkage)
    for j, (least, greatest) in travel(linkage).items():
        body, along = structure.bodies[j], structure.along[j]
        on, start = FIXED if along is None else along, body.bars[0].start
        pivots = dict(zip(structure.pivots, linkage.pivots, strict=True))
        origin = complex(pivots[start]) if on == FIXED else places[on, start]
        direction = complex(linkage.bars[structure.line_of[j]])
        yield Line(j, on, body.angle, origin, direction, least, greatest)


def _pins(  # noqa: PLR0917 - what is there already
    line: Line, holes: list[Hole], slots: list[Slot], hole: float, width: float, is_joint: bool
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
    kept: list[Hole] = []
    for hole in holes:
        same = next((k for k, other in enumerate(kept) if abs(other.at - hole.at) < SAME), None)
        if same is None:
            kept.append(hole)
        else:
            kept[same] = replace(kept[same], name=f'{kept[same].name},{hole.name}'.strip(','))
    yield from kept
