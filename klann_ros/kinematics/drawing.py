"""The drawing of a pose: its points, bodies and joints; as SVG, markers and URDF show it."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, radians, sin, tau
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray, plane_vectors, with_short_repr
import numpy as np

# Colours of the bodies, repeated; in a Klann leg they are crank, coupler, both rockers and leg.
COLOURS = ('#d1495b', '#30638e', '#7a9e7e', '#edae49', '#003d5b', '#8f5c38', '#66618c')
# Kinds of points: a fixed pivot, a pin between bodies, a point of one body. Sliding joints are
# drawn as a block on a line.
PIVOT, PIN, POINT = 'pivot', 'pin', 'point'
# Extension of a line beyond both its points, relative to the size of the drawing.
LINE_EXTENSION = 0.1
# Directions of the ground from a pivot [rad].
SUPPORT_DIRECTIONS = (radians(225.0), radians(315.0))


class BodyDrawing(NamedTuple):
    """The drawing of a body."""

    # Its bars, by their points.
    bars: list[tuple[str, str]]
    label: str
    colour: str
    # The line of a sliding body: from a point of the line's body to its own first.
    line: tuple[str, str] | None = None

    @property
    def points(self) -> list[str]:
        """Return the unique points of the body."""
        return list(dict.fromkeys(name for bar in self.bars for name in bar))

    @property
    def strokes(self) -> list[tuple[str, str]]:
        """Return the line and the bars of the body."""
        return [*([self.line] if self.line else ()), *self.bars]


@with_short_repr
class PoseDrawing(NamedTuple):
    """The points, bodies and joints of a pose."""

    # Every point by its name [m], shape (2,) each.
    points: dict[str, FloatArray]
    # The bodies, the crank first.
    bodies: list[BodyDrawing]
    # The points by the kind of their joint: PIVOT, PIN and POINT.
    joints: dict[str, list[str]]

    @classmethod
    def of(cls, pose: Any) -> 'PoseDrawing':
        """Return the drawing of a LinkagePose."""
        structure = pose.linkage.structure
        points = dict(zip(structure.points, pose.points, strict=True))
        bodies = []
        for i, body in enumerate(structure.bodies):
            bars = [(bar.start, bar.end) for bar in body.rigid]
            line = (body.line.start, body.line.end) if body.line else None
            bodies.append(BodyDrawing(bars, structure.labels[i], colour_of(i), line))
        joints: dict[str, list[str]] = {PIVOT: [], PIN: [], POINT: []}
        for name in points:
            if name in structure.pivots:
                kind = PIVOT
            elif len(structure.owners[name]) > 1:
                kind = PIN
            else:
                kind = POINT
            joints[kind].append(name)
        return cls(points, bodies, joints)

    @property
    def pivots(self) -> Sequence[str]:
        """Return the fixed pivots."""
        return self.joints[PIVOT]

    @property
    def on_bars(self) -> set[str]:
        """Return the points of bars; any other is the start of a slider's line."""
        return {name for body in self.bodies for bar in body.bars for name in bar}

    def at(self, names: Sequence[str]) -> FloatArray:
        """Return points, shape (n, 2) [m]."""
        return np.array([self.points[name] for name in names]).reshape(-1, 2)

    def line(self, body: BodyDrawing) -> FloatArray:
        """Return the points along a body's bars, shape (n, 2); NaN between disconnected bars."""
        if not body.bars:
            return np.empty((0, 2))
        last, *_ = body.bars[0]
        line = [self.points[last]]
        for start, end in body.bars:
            if start != last:
                line += [np.full(2, np.nan), self.points[start]]
            line.append(self.points[end])
            last = end
        return np.array(line)

    def outline(self, body: BodyDrawing) -> FloatArray:
        """Return a body's points in their order around its centre, from its first point on."""
        corners = self.at(body.points)
        x, y = (corners - corners.mean(axis=0)).T
        order = np.argsort(np.arctan2(y, x))
        ordered: FloatArray = corners[np.roll(order, -int(np.argmin(order)))]
        return ordered

    @property
    def size(self) -> float:
        """Return the larger side of the drawing [m]."""
        return float(np.ptp([*self.points.values()], axis=0).max())

    def guide(self, body: BodyDrawing, direction: complex) -> FloatArray:
        """Return the ends of a sliding body's line, extended beyond both points."""
        points = [complex(*self.points[name]) for name in body.line or ()]
        first, last = sorted(points, key=lambda point: (point * direction.conjugate()).real)
        extension = LINE_EXTENSION * self.size * direction
        ends = np.array([first - extension, last + extension])
        return plane_vectors(ends)

    def free_side(self, name: str) -> tuple[float, float]:
        """Return the direction at a point farthest from its bars and its support."""
        point = self.points[name]
        vectors = []
        for body in self.bodies:
            for start, end in body.strokes:
                if start == name:
                    vectors.append(self.points[end] - point)
                elif end == name:
                    vectors.append(self.points[start] - point)
            if body.line and body.line[1] == name:
                # A block extends to both sides of its point.
                vectors.append(point - self.points[body.line[0]])
        # A body at the start of its line has no direction along it.
        directions = [atan2(y, x) % tau for x, y in vectors if x or y]
        if name in self.pivots:
            directions += SUPPORT_DIRECTIONS
        directions = sorted(directions) or [0.0]
        gaps = [(b - a, (a + b) / 2.0) for a, b in pairwise([*directions, directions[0] + tau])]
        _, middle = max(gaps)
        return cos(middle), sin(middle)


def line_directions(pose: Any) -> list[complex]:
    """Return the direction of each sliding body's line, in the bodies' order."""
    linkage = pose.linkage
    return [complex(linkage.line(pose.vectors, j)) for j in sorted(linkage.structure.line_of)]


def colour_of(body: int) -> str:
    """Return the colour of a body, by its number."""
    return COLOURS[body % len(COLOURS)]
