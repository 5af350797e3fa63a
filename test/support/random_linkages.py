"""Random linkages: dyads of pins, with sliding bodies, and coupled loops, on a random pose."""

import cmath
import json
from random import Random
from typing import Any

from klann_ros.kinematics import GeometryError, Linkage, linkage_from_text

SIZE = 0.4
"""Half the side of the square in which the points of the first pose are [m]."""


class RandomPose:
    """A pose of a linkage that grows, and the file's content that describes it."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._pivots: dict[str, list[float]] = {}
        self._bodies: dict[str, Any] = {}
        self._start: dict[str, float] = {}
        self._places: dict[str, complex] = {}
        # A point of the body that a dyad may hold on to, and the body that carries it.
        self._carrier: dict[str, str] = {}
        self._angles: dict[str, complex] = {}
        pivot = self._pivot()
        self._body('crank', pivot, self._point(0.25))
        self._extend('crank', pivot)

    def add_dyad(self) -> None:
        """Add two bodies by a joint, or by a joint and a line."""
        kinds = [self._add_links, self._add_links, self._add_slider, self._add_block]
        self._random.choice(kinds)()

    def add_coupled_loops(self) -> None:
        """Add a triangle on three links, whose loops are coupled."""
        triangle = f'body{len(self._bodies) + 3}'
        corners = [self._point() for _ in range(3)]
        for corner, hold in zip(corners, self._holds(3), strict=True):
            self._body(f'body{len(self._bodies)}', hold, corner)
        self._body(triangle, corners[0], corners[1])
        self._bar(triangle, corners[0], corners[2])
        self._extend(triangle, corners[0])

    def linkage(self) -> Linkage:
        """Return the linkage, with a foot on any body; a GeometryError if it is none."""
        content = {
            'name': 'random',
            'pivots': self._pivots,
            'crank': 'crank',
            'foot': self._random.choice([*self._carrier]),
            'bodies': self._bodies,
            'start': self._start,
        }
        return linkage_from_text(json.dumps(content), 'random')

    def _point(self, size: float = SIZE) -> str:
        name = f'P{len(self._places)}'
        uniform = self._random.uniform
        self._places[name] = complex(uniform(-size, size), uniform(-size, size))
        return name

    def _pivot(self) -> str:
        name = self._point()
        place = self._places[name]
        self._pivots[name] = [place.real, place.imag]
        return name

    def _body(self, body: str, start: str, end: str) -> None:
        """Add a body that turns, by its first bar."""
        self._angles[body] = self._places[end] - self._places[start]
        clockwise = self._random.random() < 0.3 and body != 'crank'
        self._bodies[body] = {'clockwise': clockwise, 'bars': []}
        self._start[body] = cmath.phase(self._angles[body]) * (-1.0 if clockwise else 1.0)
        self._bar(body, start, end)
        self._carrier[end] = body

    def _bar(self, body: str, start: str, end: str) -> None:
        """Add a bar to a body."""
        vector = self._places[end] - self._places[start]
        bend = cmath.phase(vector / self._angles[body])
        bar = {'from': start, 'to': end, 'length': abs(vector)}
        if self._bodies[body]['bars'] or 'slides' in self._bodies[body]:
            bar['bend'] = bend
        self._bodies[body]['bars'].append(bar)

    def _extend(self, body: str, start: str) -> None:
        """Add a point to a body, as often as not."""
        if self._random.random() < 0.5:
            point = self._point()
            self._bar(body, start, point)
            self._carrier[point] = body

    def _holds(self, count: int) -> list[str]:
        """Return points of different bodies, or pivots; not all of them pivots."""
        candidates = [*self._carrier]
        self._random.shuffle(candidates)
        bodies: set[str] = set()
        points: list[str] = []
        for point in candidates:
            body = self._carrier[point]
            if body not in bodies and len(points) < count:
                bodies.add(body)
                points.append(point)
        if len(points) == count and self._random.random() < 0.4:
            points.pop()
        while len(points) < count:
            points.append(self._pivot())
        return points

    def _add_links(self) -> None:
        joint = self._point()
        for hold in self._holds(2):
            body = f'body{len(self._bodies)}'
            self._body(body, hold, joint)
            self._extend(body, hold)

    def _add_slider(self) -> None:
        """Add a link, and a body that slides along the ground or along another one."""
        joint = self._point()
        hold, origin = self._holds(2)
        link = f'body{len(self._bodies)}'
        self._body(link, hold, joint)
        along = self._carrier.get(origin, 'ground')
        if along != 'ground' and 'slides' in self._bodies[along]:
            along, origin = 'ground', self._pivot()
        self._slide(along, origin, joint)

    def _add_block(self) -> None:
        """Add an arm, and a block on it that a point carries: an inverted slider-crank."""
        hold, pin = self._holds(2)
        arm = f'body{len(self._bodies)}'
        edge = self._point()
        self._body(arm, hold, edge)
        self._slide(arm, edge, pin)

    def _slide(self, along: str, origin: str, pin: str) -> None:
        """Add a body that slides from an origin to a pin."""
        body = f'body{len(self._bodies)}'
        vector = self._places[pin] - self._places[origin]
        line = vector * self._random.choice([-1.0, 1.0])
        direction = cmath.phase(line / self._angles.get(along, 1.0))
        slides = {'along': along, 'from': origin, 'to': pin, 'direction': direction}
        self._bodies[body] = {'slides': slides, 'bars': []}
        self._angles[body] = self._angles.get(along, 1.0)
        self._start[body] = (vector / line).real * abs(vector)
        self._extend(body, pin)
        if not self._bodies[body]['bars']:
            del self._bodies[body]['bars']


def random_linkage(seed: int, *, coupled: bool = False) -> Linkage:
    """Return a random linkage of one to three dyads, or with coupled loops."""
    random = Random(seed)  # noqa: S311 - no secret
    while True:
        pose = RandomPose(random)
        for _ in range(random.randint(0, 1) if coupled else random.randint(1, 3)):
            pose.add_dyad()
        if coupled:
            pose.add_coupled_loops()
        try:
            return pose.linkage()
        except GeometryError:
            continue
