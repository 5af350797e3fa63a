"""The form of a linkage's file with all points by coordinates, as the form with bars."""

from cmath import phase, rect
from collections.abc import Mapping
from math import radians
from typing import Any

from klann_ros.kinematics.errors import GeometryError
from klann_ros.sanitize.text import did_you_mean, listed

from .structure import GROUND

# Shares of the linkage's size: nearer points coincide; points of a line within the tolerance tell
# no direction, and are on a line of stated direction, as their coordinates are rounded.
MIN_DISTANCE = 1e-9
LINE_TOLERANCE = 1e-3


def by_bars(content: dict[str, Any]) -> dict[str, Any]:
    """
    Return the content of a linkage's file with bars and a start in the place of points.

    The bars of a body lead from its first point to the others. Content without points is returned
    as it is. The schema has been checked. A GeometryError names the points and bodies that do not
    fit together.
    """
    if 'points' not in content:
        return content
    pose = _Pose(content)
    pivots = {name: content['points'][name] for name in content['pivots']}
    bodies = {}
    start = {}
    for name in content['bodies']:
        bodies[name], start[name] = pose.body(name)
    converted = {**content, 'pivots': pivots, 'bodies': bodies, 'start': start}
    del converted['points']
    return converted


class _Pose:
    """The points of a file, and the points of its bodies, in the units of the file."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self._places = {name: complex(*place) for name, place in content['points'].items()}
        self._bodies = content['bodies']
        units = content.get('units', {})
        self._radian = radians(1.0) if units.get('angle') == 'deg' else 1.0
        self._metre = units.get('length', 'm')
        # The points of each body, the one from which its bars start first.
        self._points = {name: [*body.get('points', ())] for name, body in self._bodies.items()}
        self._check_names(content)
        for name, points in self._points.items():
            starts = [point for point in points if point in content['pivots']]
            if 'slides' in self._bodies[name]:
                starts = [self._bodies[name]['slides']['to']]
            elif name != content['crank'] or not starts:
                starts = points[:1]
            others = [point for point in points if point != starts[0]]
            self._points[name] = [starts[0], *others]
        origin = next(iter(self._places.values()))
        self._size = max(abs(place - origin) for place in self._places.values())

    def body(self, name: str) -> tuple[dict[str, Any], float]:
        """Return a body with bars, and its start: an angle, or the distance that it slides."""
        body = {key: entry for key, entry in self._bodies[name].items() if key != 'points'}
        bars: list[dict[str, Any]] = []
        direction = self._direction(name)
        start, *ends = self._points[name]
        for end in ends:
            vector = self._vector(name, start, end)
            bar = {'from': start, 'to': end, 'length': abs(vector)}
            if bars or 'slides' in body:
                bar['bend'] = self._angle(vector / direction)
            bars.append(bar)
        if bars:
            body['bars'] = bars
        if 'slides' in body:
            body['slides'], distance = self._line(name)
            return body, distance
        sense = -1.0 if body.get('clockwise') else 1.0
        return body, sense * self._angle(direction)

    def _check_names(self, content: Mapping[str, Any]) -> None:
        """Refuse names of no points, and points of no body."""
        uses = {'pivots': content['pivots']}
        for name, body in self._bodies.items():
            slides = body.get('slides', {})
            ends = [slides[key] for key in ('from', 'to') if key in slides]
            uses[f'bodies.{name}'] = [*self._points[name], *ends]
        unused = dict.fromkeys(self._places)
        for place, names in uses.items():
            for point in names:
                if point not in self._places:
                    there_are = listed(self._places, 20) + did_you_mean(point, self._places)
                    msg = f'{place}: {point} is none of the points: {there_are}'
                    raise GeometryError(msg)
                unused.pop(point, None)
        for point in unused:
            raise GeometryError(f'points.{point}: it is in no body, and no pivot')

    def _vector(self, name: str, start: str, end: str) -> complex:
        vector = self._places[end] - self._places[start]
        if abs(vector) <= MIN_DISTANCE * self._size:
            msg = f'bodies.{name}: {start} and {end} are in the same place: leave one of them out'
            raise GeometryError(msg)
        return vector

    def _direction(self, name: str) -> complex:
        """Return the direction from which bends of a body count; 1 for the ground."""
        # Structure refuses bodies that slide along each other in turn, and unknown ones.
        for _ in self._bodies:
            if name == GROUND or name not in self._bodies:
                break
            if 'slides' not in self._bodies[name]:
                if len(self._points[name]) < 2:
                    raise GeometryError(f'bodies.{name}.points: a body that turns has 2 or more')
                vector = self._vector(name, *self._points[name][:2])
                return vector / abs(vector)
            name = self._bodies[name]['slides']['along']
        return 1.0 + 0j

    def _line(self, name: str) -> tuple[dict[str, Any], float]:
        """Return the line that a body slides along, with its direction, and the distance."""
        slides = self._bodies[name]['slides']
        start = slides['from']
        end = slides['to']
        vector = self._places[end] - self._places[start]
        tolerance = LINE_TOLERANCE * self._size
        direction = self._direction(slides['along'])
        if 'direction' in slides:
            offset = vector / direction / rect(1.0, self._radian * slides['direction'])
            if abs(offset.imag) > tolerance:
                distance = f'{abs(offset.imag):.3g} {self._metre}'
                msg = f'{end} is {distance} off the line through {start} in this direction'
                raise GeometryError(f'bodies.{name}.slides.direction: {msg}')
            return slides, offset.real
        if abs(vector) <= tolerance:
            msg = f'{start} and {end} are too close to tell the direction of the line: state it'
            raise GeometryError(f'bodies.{name}.slides.direction: {msg}')
        return {**slides, 'direction': self._angle(vector / direction)}, abs(vector)

    def _angle(self, vector: complex) -> float:
        return phase(vector) / self._radian
