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

GROUND, CRANK, AXLE = 0, 1, 'A'
SIZES = {1: 'four', 2: 'six', 3: 'eight', 4: 'ten'}
# Ranges relative to the crank's length: of bars, of pivots from its axle, and of points drawn.
SHORTEST_BAR, LONGEST_BAR, PIVOT_REACH, POINT_REACH = 0.25, 8.0, 6.0, 4.0
# Of a path whose size does not count [of its size].
CRANK_PART = 0.25


class AddedDyad(NamedTuple):
    """The bodies that the two links of a dyad are joined to; whether the second one slides."""

    one: int
    other: int
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
    found: dict[Shape, None] = {}
    for count in range(1, dyads + 2):
        for chain in _chains(count, sliders=sliders):
            for foot in (2 * count, 2 * count + 1):
                shape = Shape(chain, foot)
                if _is_minimal(shape):
                    found[min(_relabelled(shape))] = None
    return sorted(found, key=lambda shape: (len(shape.dyads), shape))


def _chains(count: int, *, sliders: bool) -> Iterator[tuple[AddedDyad, ...]]:
    if count == 0:
        yield ()
        return
    for chain in _chains(count - 1, sliders=sliders):
        for one, other in combinations(range(2 * count), 2):
            yield (*chain, AddedDyad(one, other))
            if sliders:
                yield (*chain, AddedDyad(one, other, slides=True))
                yield (*chain, AddedDyad(other, one, slides=True))


def _is_minimal(shape: Shape) -> bool:
    dyads, foot = shape
    own, side = dyads[foot // 2 - 1], foot % 2
    # A point of a link that is pinned to the ground, or slides along it, is on a circle or a line.
    if own[side] == GROUND:
        return False
    needed = {foot // 2 - 1}
    for k in reversed(range(len(dyads))):
        if k in needed:
            needed |= {body // 2 - 1 for body in dyads[k][:2] if body > CRANK}
    return len(needed) == len(dyads)


def _relabelled(shape: Shape) -> Iterator[Shape]:
    """Yield the equal structures, by other orders of the dyads and of their links."""
    dyads, count = shape.dyads, len(shape.dyads)
    turns = [(False,) if dyad.slides else (False, True) for dyad in dyads]
    for order, turned in product(permutations(range(count)), product(*turns)):
        new = {GROUND: GROUND, CRANK: CRANK}
        for place, k in enumerate(order):
            links = 2 * k + 2, 2 * k + 3
            new |= {link: 2 * place + 2 + (side != turned[k]) for side, link in enumerate(links)}
        made = []
        for k in order:
            one, other, slides = dyads[k]
            ends = new[one], new[other]
            made.append(AddedDyad(*(ends[::-1] if turned[k] else ends), slides))
        if all(max(dyad[:2]) < 2 * place + 2 for place, dyad in enumerate(made)):
            yield Shape(tuple(made), new[shape.foot])


def grown_spaces(
    wanted: Mapping[str, Any], units: Units, target: Target | None
) -> tuple[Space, ...]:
    """
    Return the spaces of the key `grow` of requirements, one for each structure.

    Raises
    ------
    RequirementsError
        The crank has no range.

    """
    size = units.size('m')
    if 'crank' in wanted:
        low, high = (size * end for end in wanted['crank'])
        if not low <= high:
            shown = f'[{low / size:g}, {high / size:g}]'
            raise RequirementsError(f'grow.crank: the range {shown} is empty')
    elif target is not None and target.can_scale:
        low = high = CRANK_PART * target.size
    else:
        raise RequirementsError(
            f'grow.crank is missing: the range of its length [{units.length}], which decides how '
            'large the leg is'
        )
    centre = 0j
    if target is not None and not target.can_move:
        centre = complex(target.points.mean())
    every = shapes(wanted['dyads'], sliders=wanted.get('sliders', False))
    fixed = target is None or target.can_move
    return tuple(
        _space(shape, number, (low, high), None if fixed else centre)
        for number, shape in enumerate(every, start=1)
    )


def _space(shape: Shape, number: int, crank: tuple[float, float], centre: complex | None) -> Space:
    """Return the space of a structure; `centre` is where its crank may be, if it is to move."""
    unit = sum(crank) / 2.0
    content = _content(shape, number)
    structure = structure_of(content)
    bars, pivots = structure.bars, structure.pivots
    numbers, found = [], {}
    for d in structure.dimensions:
        least, most, own = -np.pi, np.pi, 0.0
        if d.kind == 'length':
            least, most, own = SHORTEST_BAR * unit, LONGEST_BAR * unit, unit
        elif d.kind in 'xy':
            least, most = -PIVOT_REACH * unit, PIVOT_REACH * unit
        numbers.append(own)
        is_pin = d.kind == 'length' and bars[d.place][1] == structure.bodies[0].bars[0]
        is_axle = d.kind in 'xy' and pivots[d.place] == AXLE
        if not is_pin and (not is_axle or centre is not None):
            shift = 0.0 if centre is None else {'x': centre.real, 'y': centre.imag}.get(d.kind, 0)
            found[d.name] = least + shift, most + shift
    if crank[0] < crank[1]:
        found['scale'] = crank[0] / unit, crank[1] / unit
    modes = (1,) * len(shape.dyads)
    found |= {f'assembly of dyad {k}': (-1.0, 1.0) for k, _ in enumerate(modes, start=1)}
    low, high = np.array([*found.values()]).T
    linkage = Linkage(structure, numbers, assembly=modes, name=content['name'])
    leg = RobotLeg('', linkage, description=dump(content))
    return Space(leg, tuple(found), low, high, dyads=len(modes), draw=_drawn)


def _content(shape: Shape, number: int) -> dict[str, Any]:
    """Return the file of a structure, without numbers."""
    letters = iter(ascii_uppercase)
    bodies = ['ground', 'crank', *(f'link_{n}' for n, _ in enumerate(2 * shape.dyads, start=1))]
    pivots = {next(letters): [0.0, 0.0]}
    bars: dict[int, list[dict[str, Any]]] = {CRANK: []}
    starts, lines = {CRANK: AXLE}, {}

    def joint(body: int) -> str:
        point = next(letters)
        if body == GROUND:
            pivots[point] = [0.0, 0.0]
        else:
            bars[body].append({'from': starts[body], 'to': point})
        return point

    for k, (one, other, slides) in enumerate(shape.dyads):
        p, q, middle = joint(one), joint(other), next(letters)
        link, last = 2 * k + 2, 2 * k + 3
        starts[link], bars[link] = p, [{'from': p, 'to': middle}]
        starts[last], bars[last] = q, [{'from': q, 'to': middle}]
        if slides:
            starts[last], bars[last] = middle, []
            lines[last] = {'along': bodies[other], 'from': q, 'to': middle}
    foot = joint(shape.foot)
    return {
        'name': f'Grown {SIZES[len(shape.dyads)]}-bar {number}',
        'units': {'length': 'mm', 'angle': 'deg'},
        'pivots': pivots,
        'crank': bodies[CRANK],
        'foot': foot,
        'bodies': {
            bodies[j]: ({'slides': lines[j]} if j in lines else {})
            | ({'bars': own} if own else {})
            for j, own in bars.items()
        },
    }


def _drawn(space: Space, random: np.random.Generator, count: int) -> FloatArray:
    """Return candidates, shape (n, d), that close at one crank angle: their points are random."""
    structure, unit = space.linkage.structure, space.linkage.numbers[0]
    ranges = {
        name: (low, high)
        for name, low, high in zip(space.names, space.low, space.high, strict=True)
    }
    x_y = [ranges.get(f'{AXLE}.{axis}', (0.0, 0.0)) for axis in 'xy']
    centre = complex(*np.mean(x_y, axis=1))
    at: dict[str, Any] = {}
    for name in structure.points:
        reach = unit * (PIVOT_REACH if name in structure.pivots else POINT_REACH)
        at[name] = centre + reach * (random.uniform(-1.0, 1.0, (count, 2)) @ (1.0, 1j))
    if f'{AXLE}.x' not in ranges:
        at[AXLE] = np.zeros(count)
    pin = structure.bodies[0].bars[0].end
    at[pin] = at[AXLE] + unit * np.exp(2j * np.pi * random.uniform(size=count))
    steps = [at[bar.end] - at[bar.start] for _, bar in structure.bars]
    firsts = {j: steps[n] for n, (j, _) in reversed([*enumerate(structure.bars)])}
    values: dict[str, Any] = {}
    if 'scale' in ranges:
        values['scale'] = random.uniform(*ranges['scale'], count)
    for d in structure.dimensions:
        if d.kind in 'xy':
            z = at[structure.pivots[d.place]]
            values[d.name] = z.real if d.kind == 'x' else z.imag
        elif d.kind == 'length':
            values[d.name] = np.abs(steps[d.place])
        else:
            frame = structure.frames[structure.bars[d.place][0]]
            values[d.name] = np.angle(steps[d.place] / (1.0 if frame == FIXED else firsts[frame]))
    for k, (a, b) in enumerate(structure.groups, start=1):
        turn = 1j if structure.bodies[b].slides else 1.0
        values[f'assembly of dyad {k}'] = np.sign((np.conj(firsts[a]) * firsts[b] * turn).imag)
    drawn = np.array([values[name] for name in space.names]).T
    return np.asarray(np.clip((drawn - space.low) / (space.high - space.low), 0.0, 1.0))
