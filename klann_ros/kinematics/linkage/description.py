"""A linkage as data: pivots, bodies of bars, the crank, the foot, and a pose to start from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.validation import LARGEST, SMALLEST


@dataclass(frozen=True)
class Bar:
    """
    A bar of a body, from one of its points to a new one.

    Attributes
    ----------
    start, end : str
        The points at its two ends.
    vector : complex
        From start to end, x + i y, in the frame of the body, whose x axis its angle turns [m].

    """

    start: str
    end: str
    vector: complex


@dataclass(frozen=True)
class Body:
    """
    A rigid body: bars that turn by one angle.

    Attributes
    ----------
    angle : str
        The name of its angle, under which it is published; the body's name as well.
    bars : tuple of Bar
        The first leads from a point of another body, or from a pivot; each of the others from a
        point that this body has already.
    clockwise : bool
        Whether its angle is measured clockwise.

    """

    angle: str
    bars: tuple[Bar, ...]
    clockwise: bool = False

    @property
    def sense(self) -> int:
        """Return +1 for a counter-clockwise angle, -1 for a clockwise one."""
        return -1 if self.clockwise else 1

    @property
    def points(self) -> tuple[str, ...]:
        """Return its points, the one that it starts from first."""
        return (self.bars[0].start, *(bar.end for bar in self.bars))


@dataclass(frozen=True)
class Description:
    """
    A linkage as data.

    Attributes
    ----------
    name : str
        What it is called.
    pivots : mapping of str to complex
        The fixed points, x + i y [m].
    bodies : tuple of Body
        The moving bodies, the crank first.
    foot : str
        The point that is published.
    start : mapping of str to float
        An angle for every body [rad]: at the crank's, Newton-Raphson starts from the others; where
        it leads to is the assembly branch.
    source : str
        Where the numbers are from.

    Raises
    ------
    GeometryError
        It is no linkage; the text says why.

    """

    name: str
    pivots: Mapping[str, complex]
    bodies: tuple[Body, ...]
    foot: str
    start: Mapping[str, float]
    source: str = ''

    def __post_init__(self) -> None:
        """Refuse what is no linkage, with the reason."""
        for point, place in self.pivots.items():
            size = max(abs(place.real), abs(place.imag))
            _must(size <= LARGEST, f'pivot {point} is at {place}: it must be within {LARGEST:g} m')
        for body in self.bodies:
            _check_body(body)
        names = [body.angle for body in self.bodies]
        for name in names:
            _must(names.count(name) == 1, f'there are two bodies called {name}')
            _must(
                name in self.start, f'start has no angle for {name}: it needs one for every body'
            )
            angle = self.start[name]
            _must(isfinite(angle), f'the start angle of {name} is {angle}: it must be finite')
        for name in self.start:
            _must(name in names, f'start has an angle for {name}, which is no body')
        _must(bool(self.bodies), 'there are no bodies: the first is the crank')
        crank = self.crank.bars[0].start
        known, fixed = ', '.join(self.points), ', '.join(self.pivots)
        turns = crank in self.pivots
        _must(turns, f'the crank starts from {crank}, which is no pivot: these are {fixed}')
        moves = self.foot not in self.pivots
        _must(moves, f'the foot {self.foot} is a pivot and does not move')
        _must(self.foot in self.points, f'the foot {self.foot} is none of the points: {known}')

    @property
    def crank(self) -> Body:
        """Return the body whose angle is given."""
        return self.bodies[0]

    @property
    def points(self) -> tuple[str, ...]:
        """Return every point's name, the pivots first, each once."""
        moving = (point for body in self.bodies for point in body.points)
        return tuple(dict.fromkeys([*self.pivots, *moving]))


def _check_body(body: Body) -> None:
    _must(bool(body.bars), f'body {body.angle} has no bars')
    have = {body.bars[0].start}
    for bar in body.bars:
        text = f'bar {bar.start}-{bar.end} of body {body.angle}'
        length = abs(bar.vector)
        allowed = SMALLEST <= length <= LARGEST
        within = f'{SMALLEST:g} .. {LARGEST:g} m'
        _must(allowed, f'{text} is {length:g} m long: it must be within {within}')
        _must(bar.start in have, f'{text} starts from a point that the body does not have yet')
        _must(bar.end not in have, f'{text} ends at a point that the body has already')
        have.add(bar.end)


def _must(condition: bool, otherwise: str) -> None:
    if not condition:
        raise GeometryError(otherwise)


def chained(bars: Sequence[Bar]) -> dict[str, complex]:
    """Return the points of a body in its frame, x + i y [m]; its first point is at 0."""
    places = {bars[0].start: 0j} if bars else {}
    for bar in bars:
        places[bar.end] = places[bar.start] + bar.vector
    return places
