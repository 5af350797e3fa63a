"""
The parts of a robot as prisms: links, spacers, washers and pins, stacked in layers.

A part's coordinates in the plane are those of its body, as a plate's are: from the body's first
point along its angle; the ground's are the leg's plane. z is along the plane's normal u x v, from
0 at the underside of layer 0; layer k begins at k (thickness + washer), and heads of pins reach
below 0. The mount's plane is z = 0. `placed_legs` says where the stack of a mounted leg goes
against the normal: the ground, outermost in most legs, is at the side of the robot's middle.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Any

from klann_ros.dynamics import BodyMass
from klann_ros.kinematics import FIXED, Linkage
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
import numpy as np

from .layers import FlushEnd, Layers, Shaft, Side
from .outline import moments, Outline, outlines
from .plates import check_holes, COINCIDENCE, ExportError, Hole, MIN_WALL, Plate

# Width of links: a multiple of the widest hole, but at least a part of the linkage's size.
WIDTH_BY_HOLE, WIDTH_BY_SIZE = 3.0, 0.04
# Added to the diameter of printed holes [m]; more is at most this part of the diameter.
HOLE_CLEARANCE, MAX_CLEARANCE_RATIO = 0.2e-3, 0.25
# Of holes, and of the thickness of parts [m]: less is a slip of units.
MIN_SIZE = 0.1e-3
# The layer of the walls of a walker, which the pins of its grounds reach.
WALL_LAYER = -2
# Height of a pin's head, as a part of its diameter, but at most a plate's thickness.
HEAD_HEIGHT = 0.8


class Role(Enum):
    """The use of a part."""

    LINK = 'link'
    CRANK = 'crank'
    FRAME = 'frame'
    SPACER = 'spacer'
    WASHER = 'washer'
    PIN = 'pin'
    CAP = 'cap'

    @property
    def is_hardware(self) -> bool:
        """Return whether screws, nuts and washers serve as well."""
        return self in {Role.WASHER, Role.PIN, Role.CAP}


@dataclass(frozen=True)
class PartSizes:
    """
    The sizes of parts [m].

    `hole` is the diameter of holes, and of pins, `holes` that of some joints by their points.
    `width` of links is 4 % of the linkage's size and at least three holes where it is None.
    `clearance` is added to the diameter of holes and slots: a printer makes them too narrow.
    `seat` is diameter and depth of the seats in holes that turn, `seats` that of some joints.
    """

    hole: float = 3.2e-3
    holes: Mapping[str, float] = field(default_factory=dict)
    width: float | None = None
    thickness: float = 3e-3
    washer: float = 0.5e-3
    clearance: float = HOLE_CLEARANCE
    seat: Sequence[float] = ()
    seats: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse sizes that no part can have."""
        min_hole = min([self.hole, *self.holes.values()])
        if not 0.0 <= self.clearance <= max(HOLE_CLEARANCE, MAX_CLEARANCE_RATIO * min_hole):
            raise ExportError(
                f'clearance = {self.clearance * 1e3:g} mm is refused: >= 0, and at most a '
                f'quarter of the smallest hole, {min_hole * 1e3:g} mm'
            )
        if min(min_hole, self.thickness) < MIN_SIZE:
            sizes = f'holes of {min_hole * 1e3:g} mm, a thickness of {self.thickness * 1e3:g} mm'
            raise ExportError(f'{sizes} are refused: at least {MIN_SIZE * 1e3:g} mm')

    @property
    def pitch(self) -> float:
        """Return the distance of two layers [m]."""
        return self.thickness + self.washer

    def link_width(self, size: float) -> float:
        """Return the width of links of a linkage of a size [m]."""
        widest = max([self.hole, *self.holes.values()])
        return self.width or max(WIDTH_BY_HOLE * widest, WIDTH_BY_SIZE * size)


@dataclass(frozen=True)
class Prism:
    """
    A solid between two heights `low` and `high` [m].

    `outlines` are its outer curves, counter-clockwise, and its windows, clockwise; `cuts` are
    holes and slots, counter-clockwise.
    """

    outlines: tuple[Outline, ...]
    cuts: tuple[Outline, ...]
    low: float
    high: float

    @cached_property
    def moments(self) -> Any:
        """Return volume [m^3], and first and polar second moment about the origin of the plane."""
        area = sum(map(moments, self.outlines)) - sum(map(moments, self.cuts), np.zeros(3))
        return (self.high - self.low) * area


@dataclass(frozen=True)
class Part:
    """
    A part of a leg: prisms that make one solid.

    `body` is the number of the body that it moves with, FIXED for the ground. `count` is the
    number of such legs in the robot, `legs` the first leg that has it, if legs differ.
    """

    name: str
    role: Role
    body: int
    prisms: tuple[Prism, ...]
    count: int = 1
    legs: str = ''

    @property
    def volume(self) -> float:
        """Return the volume [m^3]."""
        return float(sum(prism.moments for prism in self.prisms)[0].real)

    def mass(self, density: float) -> BodyMass:
        """Return mass, centre and inertia for a density [kg/m^3]."""
        volume, first, second = sum(prism.moments for prism in self.prisms)
        inertia = (second - abs(first) ** 2 / volume).real
        return BodyMass(
            float(density * volume.real), complex(first / volume), float(density * inertia)
        )


@dataclass(frozen=True)
class PlacedLeg:
    """
    The parts of a mounted leg.

    The height z of its stack lies at `offset` + `direction` z along the normal of the leg's plane
    [m], with `direction` +1 or -1.
    """

    leg: RobotLeg
    stack: Layers
    parts: tuple[Part, ...]
    direction: int = 1
    offset: float = 0.0

    def pose(self, body: int, sample: int) -> FloatArray:
        """Return the pose in base_link of a body's parts at a sample of the motion: (4, 4)."""
        origin, rotation = self.stack.motion.frame(body, sample)
        part_in_plane = np.diag([rotation.real, rotation.real, self.direction, 1.0])
        part_in_plane[1, 0] = rotation.imag
        part_in_plane[0, 1] = -rotation.imag
        part_in_plane[:3, 3] = origin.real, origin.imag, self.offset
        plane = np.eye(4)
        plane[:3, :3] = self.leg.mount.rotation
        plane[:3, 3] = self.leg.mount.xyz
        return np.asarray(plane @ part_in_plane)


def distinct_parts(legs: Iterable[PlacedLeg]) -> tuple[Part, ...]:
    """Return the parts of legs, those of equal legs once, as their `count` says."""
    return tuple({id(part): part for placed in legs for part in placed.parts}.values())


def stack_parts(
    stack: Layers, sizes: PartSizes, linkage: Linkage, *, is_framed: bool
) -> Iterator[Part]:
    """Yield the parts of a leg's layers; the pins of the ground reach a frame's wall."""
    crank = linkage.structure.bodies.index(linkage.structure.crank)
    roles = {FIXED: Role.FRAME, crank: Role.CRANK}
    for plate, layer in zip(stack.plates, stack.layer, strict=True):
        solid = prisms(plate, layer * sizes.pitch, sizes.thickness, sizes.clearance)
        role = roles.get(plate.body, Role.LINK)
        yield Part(plate.name, role, plate.body, tuple(solid), plate.count, plate.legs)
    for shaft in stack.shafts:
        joined = {stack.layer[p] for p in shaft.plates}
        if is_framed and any(stack.plates[p].body == FIXED for p in shaft.plates):
            joined.add(WALL_LAYER)
        yield from _shaft_parts(stack, shaft, sizes, joined)


def seated(stack: Layers, sizes: PartSizes, linkage: Linkage) -> Layers:
    """Return layers with seats in the plates that turn on a pin: of the axle, in the ground."""
    plates = [*stack.plates]
    crank = linkage.structure.bodies.index(linkage.structure.crank)
    for shaft in stack.shafts:
        points = {*shaft.name.split(',')}
        seat = next((sizes.seats[name] for name in points & sizes.seats.keys()), sizes.seat)
        bodies = {plates[p].body: p for p in shaft.plates}
        carrier = shaft.carrier
        for end in stack.flush:
            # A flush end is fixed in its plate.
            if end.shaft.name == shaft.name:
                upward = sorted(shaft.plates, key=stack.layer.__getitem__)
                carrier = upward[0 if end.side is Side.LOWER else -1]
        if FIXED in bodies:
            carrier = bodies.get(crank, carrier)
        for p in {*shaft.plates} - {carrier} if seat else ():
            holes = [*plates[p].holes]
            for k, hole in enumerate(holes):
                if hole.points & points:
                    holes[k] = _seat(hole, seat[0], seat[1], sizes, plates[p].width)
            plates[p] = replace(plates[p], holes=tuple(holes))
            check_holes(plates[p])
    return replace(stack, plates=tuple(plates))


def _seat(hole: Hole, diameter: float, depth: float, sizes: PartSizes, width: float) -> Hole:
    max_diameter = width / (1.0 + 2.0 * MIN_WALL)
    floor = round(sizes.thickness - depth, 9)
    is_deep = floor == 0.0 or floor >= MIN_WALL * sizes.thickness - COINCIDENCE
    is_wide = hole.diameter + sizes.clearance < diameter < max_diameter + COINCIDENCE
    if not (is_deep and is_wide):
        raise ExportError(
            f'seat of {hole.name}, {diameter * 1e3:g} x {depth * 1e3:g} mm, is refused: wider '
            f'than its hole, at most {max_diameter * 1e3:.4g} mm in this --width, and as deep as '
            f'the plate, {sizes.thickness * 1e3:g} mm, or at most {1.0 - MIN_WALL:.0%} of that'
        )
    return replace(hole, diameter=diameter, depth=depth, bore=hole.diameter if floor else 0.0)


def prisms(plate: Plate, low: float, thickness: float, clearance: float = 0.0) -> Iterator[Prism]:
    """Yield a plate at a height [m], its holes and slots, but no seats, wider by a clearance."""
    curves = outlines(plate.links, plate.width / 2.0)
    floors = {thickness - hole.depth for hole in plate.holes if hole.bore}
    for floor, top in pairwise(sorted({0.0, thickness, *floors})):
        cuts: list[Outline] = []
        for slot in plate.slots:
            cuts += outlines([slot.line], (slot.diameter + clearance) / 2.0)
        for hole in plate.holes:
            width = hole.diameter + (0.0 if hole.depth else clearance)
            if hole.bore and floor < thickness - hole.depth:
                width = hole.bore + clearance
            cuts += outlines([hole.line], width / 2.0)
        yield Prism(curves, tuple(cuts), low + floor, low + top)


def _shaft_parts(
    stack: Layers, shaft: Shaft, sizes: PartSizes, joined: set[int]
) -> Iterator[Part]:
    """Yield a shaft's pins, one unless it is a stub, with their caps, spacers and washers."""
    carrier = stack.plates[shaft.carrier]
    outer = shaft.radius(carrier.width)
    inner = shaft.diameter / 2.0

    def part(role: Role, *rings: tuple[float, float, float, float]) -> Part:
        """Return a part of rings: outer radius, radius of the hole, and heights."""
        prisms = []
        for radius, hole, low, high in rings:
            cuts = outlines([(shaft.at, shaft.at)], hole) if hole else ()
            prisms.append(Prism(outlines([(shaft.at, shaft.at)], radius), cuts, low, high))
        name = f'{role.value} {shaft.name}'
        return Part(name, role, carrier.body, tuple(prisms), carrier.count, carrier.legs)

    head = min(sizes.thickness, HEAD_HEIGHT * shaft.diameter)
    hole = inner + sizes.clearance / 2.0
    # Axial play at each head, which would clamp its plate.
    play = min(sizes.clearance, sizes.washer) / 2.0
    passed = _passed_layers(stack, shaft)
    for span in _spans(joined, passed):
        bottom = span[0] * sizes.pitch
        top = span[-1] * sizes.pitch + sizes.thickness
        is_bottom_flush = FlushEnd(shaft, Side.LOWER) in stack.flush or span[0] - 1 in passed
        is_top_flush = FlushEnd(shaft, Side.UPPER) in stack.flush or span[-1] + 1 in passed
        low_end = bottom - (0.0 if is_bottom_flush else play)
        high_end = top + (0.0 if is_top_flush else play)
        rods = [(inner, 0.0, low_end, high_end)]
        if not is_bottom_flush:
            rods.append((outer, 0.0, low_end - head, low_end))
            if not is_top_flush:
                rods[0] = (inner, 0.0, low_end, high_end + head)
                yield part(Role.CAP, (outer, inner, high_end, high_end + head))
        elif not is_top_flush:
            rods.append((outer, 0.0, high_end, high_end + head))
        yield part(Role.PIN, *rods)
        for layer in span:
            low = layer * sizes.pitch
            if layer not in joined:
                yield part(Role.SPACER, (outer, hole, low, low + sizes.thickness))
            if layer != span[-1] and sizes.washer:
                yield part(Role.WASHER, (outer, hole, low + sizes.thickness, low + sizes.pitch))


def _passed_layers(stack: Layers, shaft: Shaft) -> set[int]:
    """Return the layers of the plates that pass through a shaft, if it is a stub."""
    passed = set()
    for stub in stack.stubs:
        if stub.shaft.name == shaft.name:
            passed |= {stack.layer[p] for p in stub.crossing}
    return passed


def _spans(joined: set[int], passed: set[int]) -> Iterator[range]:
    """Yield the layers of each pin of a shaft: a stub ends at the layers that plates pass."""
    pieces: list[list[int]] = []
    for layer in sorted(joined):
        if not pieces or passed & {*range(pieces[-1][-1], layer + 1)}:
            pieces.append([])
        pieces[-1].append(layer)
    for piece in pieces:
        yield range(piece[0], piece[-1] + 1)
