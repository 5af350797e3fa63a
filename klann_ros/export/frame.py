"""
The frame of a walker: legs beside each other, a wall at the grounds of each plane, and beams.

A wall is two layers below layer 0, so that the heads of pins move freely between; its holes are
the pivots of the grounds. Square beams join the walls where no leg passes.

>>> from klann_ros.robot import robot_of
>>> [part.name for part in placed_legs(robot_of('chebyshev'))[0].parts][:6]
['ground', 'phi', 'link', 'rocker', 'cap O1', 'pin O1']
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain, groupby, product
from operator import attrgetter
from typing import Any

from klann_ros.kinematics import FIXED
from klann_ros.robot import Mount, Robot
import numpy as np

from .layers import CLEARANCE, distances, layers
from .outline import Corner, outlines
from .parts import Part, PartSizes, PlacedLeg, Prism, prisms, Role, seated, stack_parts, WALL_LAYER
from .plates import ExportError, Hole, joined_links, merged_holes, Plate, plates

# Positions of a turn at which legs are compared, and the share of them for two joints.
POSITIONS, JOINTS_STRIDE = 360, 5
# Beams between two walls, the least angle between them, and the directions that are tried [deg].
BEAMS, BEAM_ANGLE, BEAM_DIRECTIONS = 3, 45, range(0, 181, 15)
# Half of a beam's diagonal, as a part of the width of links.
BEAM_RADIUS = 0.75
# The parts of a file are placed to be weighed, and again with their masses.
_layers = lru_cache(maxsize=16)(layers)


def placed_legs(
    robot: Robot, sizes: PartSizes | None = None, scale: float = 1.0
) -> tuple[PlacedLeg, ...]:
    """
    Return the legs of a robot, scaled, with their parts, and those of a walker in a frame.

    The frame needs parallel planes, and grounds that are outermost.

    Raises
    ------
    ExportError
        The sizes leave too little material, the crank reaches no angle, or no layers are found.

    """
    sizes = sizes or PartSizes()
    robot = _scaled(robot, scale)
    width = sizes.link_width(max(leg.linkage.size for leg in robot.legs))
    robot_plates = plates(robot, hole=sizes.hole, width=width, holes=sizes.holes)
    stacks = {}
    linkages = dict.fromkeys(leg.linkage for leg in robot.legs)
    leg_plates = groupby(robot_plates, key=attrgetter('legs'))
    for linkage, (_, group) in zip(linkages, leg_plates, strict=True):
        stacks[linkage] = seated(_layers(linkage, tuple(group)), sizes, linkage)
    stack_plates = chain.from_iterable(stack.plates for stack in stacks.values())
    holes = chain.from_iterable(plate.holes for plate in stack_plates)
    for name in sizes.seats.keys() - {*chain.from_iterable(h.points for h in holes if h.depth)}:
        raise ExportError(f'seat of {name}: no plate turns on a pin there')
    axes = np.array([leg.mount.rotation[:, 2] for leg in robot.legs])
    is_framed = robot.is_walker and np.allclose(abs(axes @ axes[0]), 1.0, rtol=0.0)
    is_framed = is_framed and not any(stack.layer[0] for stack in stacks.values())
    parts = {}
    for linkage, stack in stacks.items():
        parts[linkage] = tuple(stack_parts(stack, sizes, linkage, is_framed=is_framed))
    centre = np.mean([leg.mount.xyz for leg in robot.legs], axis=0)
    legs = []
    for leg, axis in zip(robot.legs, axes, strict=True):
        stack = stacks[leg.linkage]
        outward = (np.array(leg.mount.xyz) - centre) @ axis
        is_ground_low = 2 * stack.layer[0] < stack.count
        is_against = (outward < 0.0) == is_ground_low and robot.is_walker
        legs.append(PlacedLeg(leg, stack, parts[leg.linkage], -1 if is_against else 1))
    if is_framed:
        legs = _framed(legs, sizes)
    return tuple(legs)


def _scaled(robot: Robot, scale: float) -> Robot:
    """Return a robot with its legs and their places scaled."""
    legs = []
    for leg in robot.legs:
        x, y, z = leg.mount.xyz
        mount = replace(leg.mount, xyz=(scale * x, scale * y, scale * z))
        legs.append(replace(leg, linkage=leg.linkage.scaled(scale), mount=mount))
    return replace(robot, legs=tuple(legs))


@dataclass(frozen=True)
class _Wall:
    """A wall at `side` +1 or -1: outward heights of its legs' mounts and of their stacks [m]."""

    side: int
    mount_height: float
    height: float
    legs: tuple[int, ...]

    def span(self, sizes: PartSizes) -> list[float]:
        """Return the heights of the wall's faces along the axis [m]."""
        low = self.height + WALL_LAYER * sizes.pitch
        return sorted((self.side * low, self.side * (low + sizes.thickness)))


def _framed(legs: Sequence[PlacedLeg], sizes: PartSizes) -> list[PlacedLeg]:
    """Return the legs of a walker in parallel planes, moved outward until none collide, framed."""
    plane = legs[0].leg.mount
    axis = plane.rotation[:, 2]
    sweeps = [_sweep(placed, plane) for placed in legs]
    width = legs[0].stack.plates[0].width
    walls: list[_Wall] = []
    sides = [round(leg.direction * float(leg.leg.mount.rotation[:, 2] @ axis)) for leg in legs]
    positions = np.array([leg.leg.mount.xyz for leg in legs]) @ axis
    heights: Any = np.array(sides) * positions
    is_two_sided = len({*sides}) == 2
    for k in sorted(range(len(legs)), key=lambda k: heights[k]):
        inner = [wall for wall in walls if wall.side == sides[k]]
        for wall in inner:
            is_level = abs(wall.mount_height - heights[k]) < CLEARANCE
            if is_level and not any(
                _collide(legs[k], sweeps[k], legs[m], sweeps[m], width) for m in wall.legs
            ):
                walls[walls.index(wall)] = replace(wall, legs=(*wall.legs, k))
                break
        else:
            height = float(heights[k])
            if is_two_sided:
                # Heads of pins are between the walls of both sides.
                middle = sides[k] * float(positions.mean())
                height = max(height, middle + (1 - WALL_LAYER) * sizes.pitch)
            if inner:
                layer_count = max(legs[m].stack.count for m in inner[-1].legs) + 1 - WALL_LAYER
                height = max(height, inner[-1].height + layer_count * sizes.pitch)
            walls.append(_Wall(sides[k], heights[k], height, (k,)))
    beams = _beam_places(legs, sweeps, plane, width)
    framed = [*legs]
    walls.sort(key=lambda wall: wall.side * wall.height)
    for wall, following in zip(walls, [*walls[1:], None], strict=True):
        for k in wall.legs:
            framed[k] = replace(legs[k], offset=legs[k].direction * (wall.height - heights[k]))
        first = framed[wall.legs[0]]
        places = [_in_plane(first.leg.mount, plane, place) for place in beams]
        parts = [_wall_part([legs[k] for k in wall.legs], places, sizes)]
        low = wall.span(sizes)[1]
        high = following.span(sizes)[0] if following else low
        if high > low:
            ends = sorted(wall.side * end - wall.height for end in (low, high))
            for place in places:
                outer = tuple(Corner(place + width / 2.0 * 1j**n * (1 + 1j)) for n in range(4))
                holes = outlines([(place, place)], (sizes.hole + sizes.clearance) / 2.0)
                prism = Prism((outer,), holes, ends[0], ends[1])
                parts.append(Part('beam', Role.FRAME, FIXED, (prism,)))
        framed[wall.legs[0]] = replace(first, parts=(*first.parts, *parts))
    return framed


def _wall_part(legs: Sequence[PlacedLeg], places: Sequence[complex], sizes: PartSizes) -> Part:
    """Return the wall of legs of a plane, with holes at their pivots and for beams."""
    mount = legs[0].leg.mount
    holes = [Hole('', place, sizes.hole) for place in places]
    links = []
    for placed in legs:
        ground = placed.stack.plates[0]
        for hole in ground.holes:
            holes.append(replace(hole, at=_in_plane(mount, placed.leg.mount, hole.at)))
        for link in ground.links:
            links.append(tuple(_in_plane(mount, placed.leg.mount, end) for end in link))
    holes = [*merged_holes(holes)]
    wall_links = tuple(joined_links(links, [hole.line for hole in holes]))
    plate = Plate('wall', tuple(holes), links=wall_links, width=ground.width)
    solid = prisms(plate, WALL_LAYER * sizes.pitch, sizes.thickness, sizes.clearance)
    return Part('wall', Role.FRAME, FIXED, tuple(solid))


def _in_plane(target: Mount, source: Mount, points: Any) -> Any:
    """Return points of the plane of the mount `source` in that of a parallel `target`."""
    places = source.transform(np.stack([np.real(points), np.imag(points)], axis=-1))
    x_y = (places - np.array(target.xyz)) @ target.rotation[:, :2]
    return x_y @ (1.0, 1j)


def _sweep(placed: PlacedLeg, plane: Mount) -> Any:
    """Return the ends of a leg's links over a turn of its joint, shape (2, links, positions)."""
    motion = placed.stack.motion
    joint = np.linspace(0.0, 2.0 * np.pi, POSITIONS, endpoint=False)
    samples = [motion.nearest(angle) for angle in placed.leg.crank_angles(joint)]
    ends = []
    for plate in placed.stack.plates:
        for link in plate.links:
            ends.append([motion.place(plate, end)[samples] for end in link])
    return _in_plane(plane, placed.leg.mount, np.swapaxes(ends, 0, 1))


def _step(sweep: Any) -> float:
    """Return the largest motion between two positions [m]."""
    return float(abs(np.diff(sweep, axis=2)).max())


def _collide(leg_a: PlacedLeg, sweep_a: Any, leg_b: PlacedLeg, sweep_b: Any, width: float) -> bool:
    """Return whether two legs may meet, at any positions unless a joint drives both."""
    if leg_a.leg.crank_joint != leg_b.leg.crank_joint:
        sweep_a = sweep_a[..., ::JOINTS_STRIDE]
        sweep_b = sweep_b[..., ::JOINTS_STRIDE, None]
    clear_distance = width + CLEARANCE + (_step(sweep_a) + _step(sweep_b)) / 2.0
    for n, m in product(range(sweep_a.shape[1]), range(sweep_b.shape[1])):
        if distances(tuple(sweep_a[:, n]), tuple(sweep_b[:, m])).min() < clear_distance:
            return True
    return False


def _beam_places(
    legs: Sequence[PlacedLeg], sweeps: Sequence[Any], plane: Mount, width: float
) -> list[complex]:
    """Return the places of beams in a plane, near the pivots and clear of all legs."""
    pivots: list[complex] = []
    for placed in legs:
        holes = np.array([hole.at for hole in placed.stack.plates[0].holes])
        pivots += [*_in_plane(plane, placed.leg.mount, holes)]
    lines = np.concatenate([sweep.reshape(2, -1) for sweep in sweeps], axis=1)
    clearance = (0.5 + BEAM_RADIUS) * width + CLEARANCE + max(map(_step, sweeps)) / 2.0
    candidates = []
    for direction in BEAM_DIRECTIONS:
        for steps in range(4, 200):
            offset = steps * width / 2.0 * np.exp(1j * np.radians(direction))
            place = np.asarray(np.mean(pivots) + offset)
            if distances((place, place), tuple(lines)).min() > clearance:
                candidates.append((steps, direction, complex(place)))
                break
    chosen: dict[int, complex] = {}
    for _, direction, near_place in sorted(candidates, key=lambda candidate: candidate[:2]):
        if len(chosen) < BEAMS and all(abs(direction - near) >= BEAM_ANGLE for near in chosen):
            chosen[direction] = near_place
    return [*chosen.values()]
