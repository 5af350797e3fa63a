"""
Linkages of new structures, grown from a four-bar by dyads.

Every dyad is two links joined to each other, and one to each of two bodies that are there already;
of a sliding one (RRP) the second link slides along a line of its body. The four-bar is the first
dyad, of the ground and the crank. The dyads of a structure are unique, as the bodies that can be
placed next are: two structures are isomorphic if an order of their dyads, and of the links of
each, makes them equal.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations, permutations, product
from string import ascii_uppercase
from typing import Any, NamedTuple

from klann_ros.kinematics import FIXED, Linkage, structure_of
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.yaml_text import dump
import numpy as np

from .space import RequirementsError, Space, Units
from .target import Target

GROUND = 0
CRANK = 1
AXLE = 'A'
SIZES = {1: 'four', 2: 'six', 3: 'eight', 4: 'ten'}
# Ranges relative to the crank's length: of bars, of pivots from its axle, and of points drawn.
MIN_BAR, MAX_BAR, PIVOT_REACH, POINT_REACH = 0.25, 8.0, 6.0, 4.0
# Length of the crank for a path whose size does not count [of its size].
CRANK_SHARE = 0.25


class AddedDyad(NamedTuple):
    """The bodies that the two links of a dyad are joined to; whether the second one slides."""

    first: int
    second: int
    slides: bool = False


class Shape(NamedTuple):
    """
    A structure: its dyads, and the body of the foot.

    Body 0 is the ground, 1 the crank; dyad k has the links 2 k + 2 and 2 k + 3.
    """

    dyads: tuple[AddedDyad, ...]
    foot: int


def shapes(dyads: int, *, sliders: bool = False) -> list[Shape]:
    """
    Return all structures with up to a number of dyads beside the four-bar, each once.

    Their feet are on a link of the last dyad that is not pinned to the ground, and move by all of
    the dyads.
    """
    unique: set[Shape] = set()
    for count in range(1, dyads + 2):
        for chain in _chains(count, sliders=sliders):
            for foot in (2 * count, 2 * count + 1):
                shape = Shape(chain, foot)
                if _is_minimal(shape):
                    unique.add(min(_relabelled(shape)))
    return sorted(unique, key=lambda shape: (len(shape.dyads), shape))


def _chains(count: int, *, sliders: bool) -> Iterator[tuple[AddedDyad, ...]]:
    if count == 0:
        yield ()
        return
    for chain in _chains(count - 1, sliders=sliders):
        for first, second in combinations(range(2 * count), 2):
            yield (*chain, AddedDyad(first, second))
            if sliders:
                yield (*chain, AddedDyad(first, second, slides=True))
                yield (*chain, AddedDyad(second, first, slides=True))


def _is_minimal(shape: Shape) -> bool:
    dyads = shape.dyads
    foot_dyad, side = divmod(shape.foot - 2, 2)
    # A point of a link that is pinned to the ground, or slides along it, is on a circle or a line.
    if dyads[foot_dyad][side] == GROUND:
        return False
    needed = {foot_dyad}
    for k in reversed(range(len(dyads))):
        if k in needed:
            for body in (dyads[k].first, dyads[k].second):
                if body > CRANK:
                    needed.add(body // 2 - 1)
    return len(needed) == len(dyads)


def _relabelled(shape: Shape) -> Iterator[Shape]:
    """Yield the equal structures, by other orders of the dyads and of their links."""
    dyads = shape.dyads
    swaps = [(False,) if dyad.slides else (False, True) for dyad in dyads]
    for order, swapped in product(permutations(range(len(dyads))), product(*swaps)):
        new_body = {GROUND: GROUND, CRANK: CRANK}
        for position, k in enumerate(order):
            for side in (0, 1):
                new_body[2 * k + 2 + side] = 2 * position + 2 + (side != swapped[k])
        new_dyads = []
        # A dyad is placed on bodies of earlier ones.
        is_ordered = True
        for position, k in enumerate(order):
            first = new_body[dyads[k].second if swapped[k] else dyads[k].first]
            second = new_body[dyads[k].first if swapped[k] else dyads[k].second]
            new_dyads.append(AddedDyad(first, second, dyads[k].slides))
            is_ordered &= max(first, second) < 2 * position + 2
        if is_ordered:
            yield Shape(tuple(new_dyads), new_body[shape.foot])


def grown_spaces(
    options: Mapping[str, Any], units: Units, target: Target | None
) -> tuple[Space, ...]:
    """
    Return the spaces of the key `grow` of requirements, one for each structure.

    Raises a RequirementsError if the crank has no range.
    """
    size = units.size('m')
    if 'crank' in options:
        low = size * options['crank'][0]
        high = size * options['crank'][1]
        if not low <= high:
            raise RequirementsError(
                f'grow.crank: the range [{low / size:g}, {high / size:g}] is empty'
            )
    elif target is not None and target.can_scale:
        low = high = CRANK_SHARE * target.size
    else:
        raise RequirementsError(
            f'grow.crank is missing: the range of its length [{units.length}], which decides how '
            'large the leg is'
        )
    centre = None
    if target is not None and not target.can_move:
        centre = complex(target.points.mean())
    spaces: list[Space] = []
    for shape in shapes(int(options['dyads']), sliders=options.get('sliders', False)):
        spaces.append(_space(shape, len(spaces) + 1, (low, high), centre))
    return tuple(spaces)


def _space(shape: Shape, number: int, crank: tuple[float, float], centre: complex | None) -> Space:
    """Return the space of a structure; `centre` is where its crank may be, if it is to move."""
    unit = sum(crank) / 2.0
    content = _content(shape, number)
    structure = structure_of(content)
    numbers = []
    ranges = {}
    for dimension in structure.dimensions:
        low, high = -np.pi, np.pi
        drawn = 0.0
        is_free = True
        if dimension.kind == 'length':
            low, high = MIN_BAR * unit, MAX_BAR * unit
            drawn = unit
            is_free = structure.bars[dimension.place][1] != structure.bodies[0].bars[0]
        elif dimension.kind in 'xy':
            low, high = -PIVOT_REACH * unit, PIVOT_REACH * unit
            is_free = structure.pivots[dimension.place] != AXLE or centre is not None
        numbers.append(drawn)
        if is_free:
            shift = 0.0
            if centre is not None:
                shift = {'x': centre.real, 'y': centre.imag}.get(dimension.kind, 0.0)
            ranges[dimension.name] = low + shift, high + shift
    if crank[0] < crank[1]:
        ranges['scale'] = crank[0] / unit, crank[1] / unit
    modes = (1,) * len(shape.dyads)
    for k in range(len(modes)):
        ranges[f'assembly of dyad {k + 1}'] = -1.0, 1.0
    lows, highs = np.array([*ranges.values()]).T
    linkage = Linkage(structure, numbers, assembly=modes, name=content['name'])
    leg = RobotLeg('', linkage, description=dump(content))
    return Space(leg, tuple(ranges), lows, highs, dyads=len(modes), draw=_closed_candidates)


def _content(shape: Shape, number: int) -> dict[str, Any]:
    """Return the file of a structure, without numbers."""
    letters = iter(ascii_uppercase)
    names = ['ground', 'crank']
    for n in range(2 * len(shape.dyads)):
        names.append(f'link_{n + 1}')
    pivots = {next(letters): [0.0, 0.0]}
    bodies: dict[int, dict[str, Any]] = {CRANK: {'bars': []}}
    # The point from which the bars of a body start.
    starts = {CRANK: AXLE}

    def joint(body: int) -> str:
        point = next(letters)
        if body == GROUND:
            pivots[point] = [0.0, 0.0]
        else:
            bodies[body].setdefault('bars', []).append({'from': starts[body], 'to': point})
        return point

    for k, dyad in enumerate(shape.dyads):
        p = joint(dyad.first)
        q = joint(dyad.second)
        middle = next(letters)
        first = 2 * k + 2
        second = 2 * k + 3
        starts[first] = p
        bodies[first] = {'bars': [{'from': p, 'to': middle}]}
        starts[second] = middle if dyad.slides else q
        bodies[second] = {'bars': [{'from': q, 'to': middle}]}
        if dyad.slides:
            line = {'along': names[dyad.second], 'from': q, 'to': middle}
            bodies[second] = {'slides': line}
    foot = joint(shape.foot)
    return {
        'name': f'Grown {SIZES[len(shape.dyads)]}-bar {number}',
        'units': {'length': 'mm', 'angle': 'deg'},
        'pivots': pivots,
        'crank': names[CRANK],
        'foot': foot,
        'bodies': {names[j]: body for j, body in bodies.items()},
    }


def _closed_candidates(space: Space, random: np.random.Generator, count: int) -> FloatArray:
    """Return candidates, shape (n, d), that close at one crank angle: their points are random."""
    structure = space.linkage.structure
    unit = space.linkage.numbers[0]
    ranges = dict(zip(space.names, zip(space.low, space.high, strict=True), strict=True))
    axle_ranges = (ranges.get(f'{AXLE}.x', (0.0, 0.0)), ranges.get(f'{AXLE}.y', (0.0, 0.0)))
    centre = complex(*np.mean(axle_ranges, axis=1))
    points: dict[str, Any] = {}
    for name in structure.points:
        reach = unit * (PIVOT_REACH if name in structure.pivots else POINT_REACH)
        points[name] = centre + reach * (random.uniform(-1.0, 1.0, (count, 2)) @ (1.0, 1j))
    if f'{AXLE}.x' not in ranges:
        points[AXLE] = np.zeros(count)
    pin = structure.bodies[0].bars[0].end
    points[pin] = points[AXLE] + unit * np.exp(2j * np.pi * random.uniform(size=count))
    bars = []
    first_bars: dict[int, Any] = {}
    for j, bar in structure.bars:
        vector = points[bar.end] - points[bar.start]
        bars.append(vector)
        first_bars.setdefault(j, vector)
    columns: dict[str, Any] = {}
    if 'scale' in ranges:
        columns['scale'] = random.uniform(*ranges['scale'], count)
    for dimension in structure.dimensions:
        n = dimension.place
        if dimension.kind in 'xy':
            pivot = points[structure.pivots[n]]
            columns[dimension.name] = pivot.real if dimension.kind == 'x' else pivot.imag
        elif dimension.kind == 'length':
            columns[dimension.name] = np.abs(bars[n])
        else:
            frame = structure.frames[structure.bars[n][0]]
            columns[dimension.name] = np.angle(
                bars[n] / (1.0 if frame == FIXED else first_bars[frame])
            )
    for k, (a, b) in enumerate(structure.groups, start=1):
        quarter_turn = 1j if structure.bodies[b].slides else 1.0
        area = (np.conj(first_bars[a]) * first_bars[b] * quarter_turn).imag
        columns[f'assembly of dyad {k}'] = np.sign(area)
    candidates = np.array([columns[name] for name in space.names]).T
    return np.asarray(np.clip((candidates - space.low) / (space.high - space.low), 0.0, 1.0))
