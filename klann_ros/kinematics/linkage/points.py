"""The form of a linkage's file with its points by their coordinates in one pose."""

from cmath import phase, rect
from collections.abc import Mapping
from typing import Any

from klann_ros.kinematics.angles import deg
from klann_ros.kinematics.errors import GeometryError
from klann_ros.sanitize.text import did_you_mean, listed

from .topology import MAX_BODIES

# Distances in sizes of the linkage: of points that are apart, and of a point of a line from its
# origin, if it tells the direction, and from a line of stated direction, if it is on it.
MIN_DISTANCE = 1e-9
LINE_TOLERANCE = 1e-3
LENGTH_UNITS = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}


def units_of(content: Mapping[str, Any]) -> tuple[float, float]:
    """Return the units of lengths [m] and of angles [rad] in a file's content."""
    units = content.get('units', {})
    return LENGTH_UNITS[units.get('length', 'm')], deg if units.get('angle') == 'deg' else 1.0


def bodies_of(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the bodies in a file's content: `bodies`, or `links`, of which lists get mappings."""
    bodies: dict[str, Any] = content['links' if 'links' in content else 'bodies']
    for name, body in bodies.items():
        bodies[name] = {'points': body} if isinstance(body, list) else body
    return bodies


def by_bars(content: dict[str, Any]) -> dict[str, Any]:
    """
    Return the content of a linkage's file with pivots, bodies and start in the place of points.

    The bars of a link lead from its first point to the others. Content without points is returned
    as it is. A GeometryError names points and links that do not fit.
    """
    if 'points' not in content:
        return content
    pose = _Pose(content)
    converted = {key: content[key] for key in content if key not in ('points', 'ground', 'links')}
    converted['pivots'] = {name: content['points'][name] for name in content['ground']}
    converted |= {'bodies': {}, 'start': {}}
    for name in content['links']:
        converted['bodies'][name], converted['start'][name] = pose.body(name)
    return converted


class _Pose:
    """The places of the points of a file, and the points of its links; lengths in its unit."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        _, self._radian = units_of(content)
        self._length_unit = content.get('units', {}).get('length', 'm')
        self._places = {name: complex(*place) for name, place in content['points'].items()}
        self._links = bodies_of(content)
        # The points of each link, the one from which its bars start first.
        self._points: dict[str, list[str]] = {}
        # The key that names each point last.
        users = dict.fromkeys(content['ground'], 'ground')
        for name, link in self._links.items():
            slides = link.get('slides')
            ends = [slides['to'], slides['from']] if slides else []
            points = [*ends[:1], *link.get('points', [])]
            if name == content['crank']:
                points.sort(key=lambda point: point not in content['ground'])
            self._points[name] = [*dict.fromkeys(points)]
            users |= dict.fromkeys([*points, *ends], f'links.{name}')
        for name, user in users.items():
            if name not in self._places:
                there_are = listed(self._places) + did_you_mean(name, self._places)
                raise GeometryError(f'{user}: {name} is none of the points: {there_are}')
        for name in self._places:
            if name not in users:
                raise GeometryError(f'points.{name}: it is on no link, and not on the ground')
        origin = next(iter(self._places.values()))
        self._size = max(abs(place - origin) for place in self._places.values())

    def body(self, name: str) -> tuple[dict[str, Any], float]:
        """Return a link as a body with bars, and its start: an angle, or a distance."""
        link = self._links[name]
        body = {key: link[key] for key in link if key != 'points'}
        direction = self._direction(name)
        start, *ends = self._points[name]
        bars: list[dict[str, Any]] = []
        for end in ends:
            vector = self._vector(name, start, end)
            bar = {'from': start, 'to': end, 'length': abs(vector)}
            # The first bar of a link that turns is its direction.
            if bars or 'slides' in body:
                bar['bend'] = phase(vector / direction) / self._radian
            bars.append(bar)
        if bars:
            body['bars'] = bars
        if 'slides' in body:
            body['slides'], distance = self._line(name)
            return body, distance
        sense = -1.0 if body.get('clockwise') else 1.0
        return body, sense * phase(direction) / self._radian

    def _vector(self, name: str, start: str, end: str) -> complex:
        vector = self._places[end] - self._places[start]
        if abs(vector) <= MIN_DISTANCE * self._size:
            msg = f'links.{name}: {start} and {end} are in the same place: leave one of them out'
            raise GeometryError(msg)
        return vector

    def _direction(self, name: str, depth: int = 0) -> complex:
        """Return the direction from which the bends of a link count; 1 for the ground."""
        # Structure refuses unknown links, and those that slide along each other in turn.
        if name not in self._links or depth > MAX_BODIES:
            return 1.0 + 0j
        if 'slides' in self._links[name]:
            return self._direction(self._links[name]['slides']['along'], depth + 1)
        if len(self._points[name]) == 1:
            raise GeometryError(f'links.{name}: a link that turns has 2 points or more')
        vector = self._vector(name, *self._points[name][:2])
        return vector / abs(vector)

    def _line(self, name: str) -> tuple[dict[str, Any], float]:
        """Return the line that a link slides along, with its direction, and the distance."""
        slides = self._links[name]['slides']
        start, end = slides['from'], slides['to']
        vector = (self._places[end] - self._places[start]) / self._direction(slides['along'])
        tolerance = LINE_TOLERANCE * self._size
        if 'direction' in slides:
            vector *= rect(1.0, -self._radian * slides['direction'])
            if abs(vector.imag) <= tolerance:
                return slides, vector.real
            distance = f'{abs(vector.imag):.3g} {self._length_unit}'
            problem = f'{end} is {distance} off the line through {start} in this direction'
        elif abs(vector) > tolerance:
            return {**slides, 'direction': phase(vector) / self._radian}, abs(vector)
        else:
            problem = (
                f'{start} and {end} are too close to tell the direction of the line: state it'
            )
        raise GeometryError(f'links.{name}.slides.direction: {problem}')
