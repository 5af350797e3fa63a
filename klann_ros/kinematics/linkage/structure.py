"""The structure of a linkage, without a number: bodies that turn or slide, pivots, the foot."""

from collections.abc import Iterable, Sequence, Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from math import prod
from typing import NamedTuple

from klann_ros.kinematics.errors import GeometryError
from klann_ros.sanitize.text import did_you_mean

from .topology import add_paths, assembly_order, Graph, Group, Path

UNITS = {'length': 'm', 'brace': 'm', 'x': 'm', 'y': 'm', 'bend': 'rad'}
# The name of the ground as a carrier of sliding bodies, and its index among the bodies.
GROUND = 'ground'
FIXED = -1


class Brace(NamedTuple):
    """A second bar to a bar's end, from another point of the body; its side is 'left', 'right'."""

    start: str
    side: str


class Bar(NamedTuple):
    """
    A bar of a body, from one of its points to a new one.

    The first bar's direction is the body's angle; another's is bent from it, or follows from the
    triangle with a brace.
    """

    start: str
    end: str
    brace: Brace | None = None


class Body(NamedTuple):
    """A rigid body: bars that turn by one angle, or slide by one distance."""

    # The name of its angle, or of its distance, under which it is published.
    angle: str
    # The first leads from a point of another body, or from a pivot; each of the others from a
    # point that this body has already. Of a body that slides the first is the line: from a point
    # of what it slides along to its own first point, as long as the distance is.
    bars: tuple[Bar, ...]
    # Whether its angle is measured clockwise.
    clockwise: bool = False
    # The label of the body; its angle's name by default.
    label: str = ''
    # The body that it slides along, or GROUND, with whose angle its bars turn; empty for a body
    # that turns by an angle of its own.
    along: str = ''

    @property
    def slides(self) -> bool:
        """Return whether it slides along a line."""
        return bool(self.along)

    @property
    def unit(self) -> str:
        """Return the unit of its angle, or of its distance."""
        return 'm' if self.slides else 'rad'

    @property
    def sense(self) -> int:
        """Return +1 for a counter-clockwise angle, -1 for a clockwise one."""
        return -1 if self.clockwise else 1

    @property
    def line(self) -> Bar | None:
        """Return the way along which it slides; None for a body that turns."""
        return self.bars[0] if self.slides else None

    @property
    def rigid(self) -> tuple[Bar, ...]:
        """Return its bars that have a length of their own: all but the line."""
        return self.bars[1:] if self.slides else self.bars

    @property
    def points(self) -> tuple[str, ...]:
        """Return its points; of one that turns the one that it starts from first."""
        ends = [bar.end for bar in self.bars]
        return tuple(ends) if self.slides else (self.bars[0].start, *ends)


class Dimension(NamedTuple):
    """A number of a linkage."""

    # Such as `l_bc`, `B-C` or `D.x`.
    name: str
    # 'length' of a bar, its 'bend' or its 'brace'; 'x' or 'y' of a pivot.
    kind: str
    # Which bar, through all bodies, or which pivot.
    place: int
    # -1 for a bend that is measured clockwise.
    sense: int = 1

    @property
    def unit(self) -> str:
        """Return the unit of the dimension."""
        return UNITS[self.kind]

    @property
    def is_length(self) -> bool:
        """Return whether it must be > 0."""
        return self.kind in ('length', 'brace')


@dataclass(frozen=True)
class Structure:
    """
    The topology of a linkage: bodies, joints and names of dimensions, without numbers.

    Raises
    ------
    GeometryError
        It is no linkage; the text says why.

    """

    # The fixed points.
    pivots: tuple[str, ...]
    # The moving bodies, the crank first.
    bodies: tuple[Body, ...]
    # The point that is published.
    foot: str
    # Every point, in published order; by default the pivots come first.
    points: tuple[str, ...] = ()
    # The dimensions by their users' names; one that is left out is 0. By default all of them,
    # named by their points.
    dimensions: tuple[Dimension, ...] = ()
    # The blocks, from 1, whose transmission angle is measured outside of the joint.
    outside: tuple[int, ...] = ()
    # The unit of its lengths in texts; empty where it may be any.
    unit: str = 'm'

    def __post_init__(self) -> None:
        _require(bool(self.bodies), 'there are no bodies: the first is the crank')
        points = dict.fromkeys(self.pivots)
        for body in self.bodies:
            _check_body(body)
            points |= dict.fromkeys(body.points)
        names = self.angles
        for name in names:
            _require(names.count(name) == 1, f'there are two bodies called {name}')
        self._check_slides()
        crank = self.crank
        _require(not crank.slides, f'the crank {crank.angle} slides: a driven link must turn')
        start = crank.points[0]
        pivots = ', '.join(self.pivots)
        no_pivot = f'the crank starts from {start}, which is no pivot: these are {pivots}'
        _require(start in self.pivots, no_pivot)
        _require(
            self.foot not in self.pivots, f'the foot {self.foot} is a pivot and does not move'
        )
        there_are = f'{", ".join(points)}{did_you_mean(self.foot, points)}'
        _require(self.foot in points, f'the foot {self.foot} is none of the points: {there_are}')
        object.__setattr__(self, 'points', self.points or tuple(points))
        object.__setattr__(self, 'dimensions', self.dimensions or tuple(_dimensions(self)))
        object.__setattr__(self, '_hash', hash((self.pivots, self.bodies, self.foot)))

    def __hash__(self) -> int:
        """Return the cached hash: a structure is a key of every linkage."""
        return self._hash  # type: ignore[attr-defined, no-any-return]  # set above

    def __reduce__(self) -> tuple[type['Structure'], tuple[object, ...]]:
        """Leave out what other processes compute and hash for themselves."""
        named = (self.foot, self.points, self.dimensions, self.outside, self.unit)
        return Structure, (self.pivots, self.bodies, *named)

    @property
    def crank(self) -> Body:
        """Return the body whose angle is given."""
        return self.bodies[0]

    @property
    def angles(self) -> tuple[str, ...]:
        """Return the names of the angles, the crank's first."""
        return tuple(body.angle for body in self.bodies)

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the bodies."""
        return tuple(body.label or body.angle for body in self.bodies)

    @cached_property
    def senses(self) -> tuple[int, ...]:
        """Return +1 or -1 for each body's angle."""
        return tuple(body.sense for body in self.bodies)

    def slides_any(self, bodies: Iterable[int]) -> bool:
        """Return whether any of some bodies slides."""
        return any(self.bodies[j].slides for j in bodies)

    def turning_sense(self, bodies: Iterable[int]) -> int:
        """Return the product of the senses of the turning ones of some bodies."""
        return prod(self.senses[j] for j in bodies if not self.bodies[j].slides)

    @cached_property
    def along(self) -> tuple[int | None, ...]:
        """Return the body that each one slides along, FIXED for the ground, None if it turns."""
        indices: dict[str, int | None] = dict(
            zip(self.angles, range(len(self.bodies)), strict=True)
        )
        indices |= {GROUND: FIXED, '': None}
        return tuple(indices[body.along] for body in self.bodies)

    @cached_property
    def frames(self) -> tuple[int, ...]:
        """Return the body each one rotates with: itself, the one it slides along, or FIXED."""
        return tuple(map(self._frame, range(len(self.bodies))))

    @cached_property
    def slides(self) -> bool:
        """Return whether anything slides."""
        return self.slides_any(range(len(self.bodies)))

    @cached_property
    def bars(self) -> tuple[tuple[int, Bar], ...]:
        """Return all bars, each with its body."""
        return tuple((j, bar) for j, body in enumerate(self.bodies) for bar in body.bars)

    @cached_property
    def owners(self) -> dict[str, tuple[int, ...]]:
        """Return the bodies that have each point; FIXED first for a pivot."""
        owners: dict[str, tuple[int, ...]] = dict.fromkeys(self.points, ())
        owners |= dict.fromkeys(self.pivots, (FIXED,))
        for j, body in enumerate(self.bodies):
            for point in body.points:
                owners[point] += (j,)
        return owners

    @property
    def foot_guides(self) -> tuple[bool, ...]:
        """Return of each body with the foot if it turns about a pivot or slides on the ground."""
        guides = []
        for j in self.owners[self.foot]:
            turns = not set(self.pivots).isdisjoint(self.bodies[j].points)
            guides.append(turns or self.along[j] == FIXED)
        return tuple(guides)

    def first_owner(self, point: str) -> int:
        """Return the first of the bodies that have a point."""
        owners = self.owners[point]
        return owners[1] if owners[0] == FIXED else owners[0]

    @cached_property
    def line_of(self) -> dict[int, int]:
        """Return the bar of the line of each body that slides."""
        return {j: n for j, n in self._first_bars.items() if self.bodies[j].slides}

    @cached_property
    def lines(self) -> frozenset[int]:
        """Return the bars that are as long as a distance: the first of each body that slides."""
        return frozenset(self.line_of.values())

    @cached_property
    def straight(self) -> frozenset[int]:
        """Return the bars that lie along their bodies' angles: the first of each that turns."""
        return frozenset(self._first_bars.values()) - self.lines

    @cached_property
    def carriers(self) -> tuple[int, ...]:
        """Return the body whose vector each bar multiplies, FIXED for none: see `joints`."""
        bars = enumerate(self.bars)
        return tuple(j if n in self.lines else self.frames[j] for n, (j, _) in bars)

    @cached_property
    def _first_bars(self) -> dict[int, int]:
        """Return the first bar of each body."""
        first_bars: dict[int, int] = {}
        for number, (body, _) in enumerate(self.bars):
            first_bars.setdefault(body, number)
        return first_bars

    def _frame(self, j: int) -> int:
        along = self.along[j] if j >= 0 else None
        return j if along is None else self._frame(along)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Return the bodies that are placed together, in the order in which they are placed."""
        points = [body.points for body in self.bodies]
        return tuple(assembly_order(Graph(self.pivots, points, self.angles, self.along)))

    @cached_property
    def paths(self) -> 'Paths':
        """Return the loops and the paths to the points, along bars."""
        bars = [(body, bar.start, bar.end) for body, bar in self.bars]
        points = {name: Path(((place, 1),), ()) for place, name in enumerate(self.pivots)}
        add_paths(points, bars, (0,))
        loops: list[Path] = []
        closing: list[str] = []
        rows = []
        for group in self.groups:
            group_loops = add_paths(points, bars, group)
            rows.append(tuple(range(len(loops), len(loops) + len(group_loops))))
            for point, loop in group_loops:
                closing.append(point)
                loops.append(loop)
        ends = tuple(points[name] for name in self.points)
        return Paths(tuple(loops), tuple(closing), tuple(rows), ends)

    def dyad_loop(self, k: int) -> Path:
        """Return the loop that a dyad closes."""
        (loop,) = self.paths.rows[k]
        return self.paths.loops[loop]

    @cached_property
    def dyad_names(self) -> tuple[tuple[str, str, str, str], ...]:
        """Return the names of the ends and links of each block, made of their points."""
        placed = {*self.pivots, *self.crank.points}
        names = []
        for group in self.groups:
            names.append(_names(self.bodies[group[0]], self.bodies[group[1]], placed))
            for j in group:
                placed.update(self.bodies[j].points)
        return tuple(names)

    def with_foot(self, foot: str) -> 'Structure':
        """Return the structure with another foot; raises a GeometryError without such a point."""
        return replace(self, foot=foot)

    def with_point(self, name: str, angle: str, start: str) -> 'Structure':
        """
        Return it with a point more as foot, at the end of a bent bar of a body from a point of it.

        The bar's length and bend are its last two dimensions. A GeometryError says that there is
        no such body, that the name is taken, or that the body does not have the start.
        """
        there_are = f'there are {", ".join(self.angles)}{did_you_mean(angle, self.angles)}'
        _require(angle in self.angles, f'{angle}: no such body; {there_are}')
        _require(name not in self.points, f'the point {name} is there already')
        j = self.angles.index(angle)
        body = self.bodies[j]
        bodies = [*self.bodies]
        bodies[j] = body._replace(bars=(*body.bars, Bar(start, name)))
        added = sum(len(body.bars) for body in self.bodies[: j + 1])
        dimensions = []
        for d in self.dimensions:
            is_later = d.kind not in ('x', 'y') and d.place >= added
            dimensions.append(d._replace(place=d.place + 1) if is_later else d)
        ends = f'{start}-{name}'
        dimensions.append(Dimension(ends, 'length', added))
        dimensions.append(Dimension(f'bend of {ends}', 'bend', added))
        points = (*self.points, name)
        numbered = tuple(bodies), name, points, tuple(dimensions), self.outside
        return Structure(self.pivots, *numbered, self.unit)

    def mirrored(self) -> 'Structure':
        """Return the structure with every brace on the other side of its bar."""
        bodies = []
        for body in self.bodies:
            bars = [bar._replace(brace=_opposite_brace(bar.brace)) for bar in body.bars]
            bodies.append(body._replace(bars=tuple(bars)))
        return replace(self, bodies=tuple(bodies))

    def prefix(self, blocks: int) -> 'Structure':
        """Return the subchain of the first blocks."""
        placed = sorted({0, *chain(*self.groups[:blocks])})
        bodies = tuple(self.bodies[j] for j in placed)
        return Structure(self.pivots, bodies, bodies[0].points[-1], unit=self.unit)

    def _check_slides(self) -> None:
        """Refuse a line that starts nowhere, or that leads round to where it started."""
        bodies = {body.angle: body for body in self.bodies}
        there_are = ', '.join([GROUND, *bodies])
        for body in self.bodies:
            _require(body.angle != GROUND, f'a body cannot be called {GROUND}')
            if not body.slides:
                continue
            along = body.along
            text = f'{body.angle} slides along {along}'
            seen = {body.angle}
            _require(along == GROUND or along in bodies, f'{text}, which is no body: {there_are}')
            points = self.pivots if along == GROUND else bodies[along].points
            start = body.bars[0].start
            problem = f'{text} from {start}, which is none of its points: {", ".join(points)}'
            _require(start in points, problem)
            while along != GROUND and bodies[along].slides:
                _require(along not in seen, f'{text}, which slides along it in turn')
                seen.add(along)
                along = bodies[along].along


class Paths(NamedTuple):
    """The loops of a structure, and the paths to its points."""

    # Each closes at a point: the path over its last bar less the point's own.
    loops: tuple[Path, ...]
    # The points where they close.
    closing: tuple[str, ...]
    # Which loops each group of bodies closes.
    rows: tuple[tuple[int, ...], ...]
    # A path from a pivot to each point.
    points: tuple[Path, ...]


def _dimensions(structure: Structure) -> list[Dimension]:
    """Return all dimensions, named by points, and by bodies where names coincide."""
    dimensions = []
    for number, (_, bar) in enumerate(structure.bars):
        ends = f'{bar.start}-{bar.end}'
        if number in structure.lines:
            dimensions.append(Dimension(f'direction of {ends}', 'bend', number))
            continue
        dimensions.append(Dimension(ends, 'length', number))
        if bar.brace is not None:
            dimensions.append(Dimension(f'{bar.brace.start}-{bar.end}', 'brace', number))
        elif number not in structure.straight:
            dimensions.append(Dimension(f'bend of {ends}', 'bend', number))
    names = [dimension.name for dimension in dimensions]
    for n, dimension in enumerate(dimensions):
        if names.count(dimension.name) > 1:
            angle = structure.bodies[structure.bars[dimension.place][0]].angle
            dimensions[n] = dimension._replace(name=f'{dimension.name} of {angle}')
    for place, name in enumerate(structure.pivots):
        dimensions += [Dimension(f'{name}.x', 'x', place), Dimension(f'{name}.y', 'y', place)]
    return dimensions


def _names(a: Body, b: Body, placed: AbstractSet[str]) -> tuple[str, str, str, str]:
    if a.slides or b.slides:
        link, slider = sorted((a, b), key=lambda body: body.slides)
        return _names_of_slide(link, slider, placed)
    p = _first_of(a.points, placed, '?')
    q = _first_of(b.points, placed, '?')
    ends = p, q, _first_of(a.points, {*b.points} - placed, '')
    link_a = ''.join(point for point in a.points if point in ends)
    link_b = ''.join(point for point in b.points if point in ends)
    return p, q, link_a, link_b


def _names_of_slide(
    link: Body, slider: Body, placed: AbstractSet[str]
) -> tuple[str, str, str, str]:
    """Return the placed end, the slider and the link between them; there is no second link."""
    p = _first_of((*link.points, *slider.points), placed, '?')
    if slider.along == link.angle:
        return p, _first_of(slider.points, placed, slider.points[0]), link.angle, ''
    return p, slider.angle, ''.join(link.points[:2]), ''


def _first_of(points: Iterable[str], choices: AbstractSet[str], default: str) -> str:
    """Return the first of the points that is among some choices."""
    return next((point for point in points if point in choices), default)


def _opposite_brace(brace: Brace | None) -> Brace | None:
    return brace and brace._replace(side='left' if brace.side == 'right' else 'right')


def _check_body(body: Body) -> None:
    """Raise a GeometryError unless each bar of a body starts at one of its points."""
    _require(bool(body.bars), f'body {body.angle} has no bars')
    line = body.bars[0]
    points = [line.end if body.slides else line.start]
    if body.slides:
        text = f'the line {line.start}-{line.end} of body {body.angle}'
        _require(line.brace is None, f'{text} has a brace: it needs a direction')
        _require(line.start != line.end, f'{text} has only one point')
    for bar in body.rigid:
        text = f'bar {bar.start}-{bar.end} of body {body.angle}'
        if bar.start not in points:
            it_has = f'it has {", ".join(points)}{did_you_mean(bar.start, points)}'
            msg = f'{text} starts from a point that the body does not have yet: {it_has}'
            raise GeometryError(msg)
        _require(bar.end not in points, f'{text} ends at a point that the body has already')
        if bar.brace is not None:
            hint = did_you_mean(bar.brace.start, points)
            missing = f'bodies.{body.angle}: {bar.brace.start} is no point of it yet'
            no_brace = f'{missing}, so nothing can be braced from it{hint}'
            _require(bar.brace.start in points, no_brace)
        points.append(bar.end)


def _require(condition: bool, otherwise: str) -> None:
    if not condition:
        raise GeometryError(otherwise)


def dimension_places(dimensions: Sequence[Dimension], names: Iterable[str] = ()) -> dict[str, int]:
    """Return the place of each dimension under its name; a GeometryError where one is wanting."""
    places = {dimension.name: number for number, dimension in enumerate(dimensions)}
    unknown = [name for name in names if name not in places]
    hint = did_you_mean(unknown[0], places) if unknown else ''
    there_are = f'there are {", ".join(places)}{hint}'
    _require(not unknown, f'{", ".join(unknown)}: no such dimension; {there_are}')
    return places
