"""What a pose is drawn from, by whatever draws it: points, bodies and joints; no matplotlib."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, radians, sin, tau
from typing import NamedTuple

from klann_ros.kinematics import LinkagePose
import numpy as np
from numpy.typing import NDArray

# Bodies take the colours in turn; those of the Klann leg are crank, coupler, both rockers, leg.
COLOURS = ('#d1495b', '#30638e', '#7a9e7e', '#edae49', '#003d5b', '#8f5c38', '#66618c')
# Kinds of joints: what turns on the ground, what turns on another body, and a mere point of one.
# What slides is drawn as a block on its line.
PIVOT, PIN, POINT = 'pivot', 'pin', 'point'
# How far a line is drawn beyond both its points, as a part of the drawing's size.
BEYOND = 0.1
# Where the ground is, as seen from a pivot [rad].
SUPPORT = (radians(225.0), radians(315.0))

Array = NDArray[np.float64]


class DrawnBody(NamedTuple):
    """A body as it is drawn."""

    # Its bars, by their points.
    bars: list[tuple[str, str]]
    # What it is called, and its colour.
    label: str
    colour: str
    # The line that it slides along: from a point of what has the line to its own first.
    line: tuple[str, str] | None = None

    @property
    def points(self) -> list[str]:
        """Return its points."""
        return list(dict.fromkeys(name for bar in self.bars for name in bar))

    @property
    def strokes(self) -> list[tuple[str, str]]:
        """Return its bars, and the way along its line."""
        return [*([self.line] if self.line else ()), *self.bars]


class Drawn(NamedTuple):
    """What a pose is drawn from."""

    # Every point by its name [m], shape (2,) each.
    points: dict[str, Array]
    # The bodies, the crank first.
    bodies: list[DrawnBody]
    # The points by the kind of their joint: PIVOT, PIN and POINT.
    joints: dict[str, list[str]]

    @classmethod
    def of(cls, pose: LinkagePose) -> 'Drawn':
        """Return what a pose is drawn from."""
        structure = pose.linkage.structure
        points = dict(zip(structure.points, pose.points, strict=True))
        bodies = [
            DrawnBody(
                [(bar.start, bar.end) for bar in body.rigid],
                label,
                colour_of(i),
                (body.line.start, body.line.end) if body.line else None,
            )
            for i, (body, label) in enumerate(zip(structure.bodies, structure.labels, strict=True))
        ]
        joints: dict[str, list[str]] = {PIVOT: [], PIN: [], POINT: []}
        for name in points:
            several = len(structure.owners[name]) > 1
            kind = PIVOT if name in structure.pivots else PIN if several else POINT
            joints[kind].append(name)
        return cls(points, bodies, joints)

    @property
    def pivots(self) -> Sequence[str]:
        """Return the points that are fixed."""
        return self.joints[PIVOT]

    def at(self, names: Sequence[str]) -> Array:
        """Return points, shape (n, 2) [m]."""
        return np.array([self.points[name] for name in names]).reshape(-1, 2)

    def line(self, body: DrawnBody) -> Array:
        """Return the points along a body's bars, shape (n, 2); NaN where a bar starts anew."""
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

    def outline(self, body: DrawnBody) -> Array:
        """Return a body's points in the order in which they stand around their middle."""
        corners = self.at(body.points)
        x, y = (corners - corners.mean(axis=0)).T
        ordered: Array = corners[np.argsort(np.arctan2(y, x))]
        return ordered

    @property
    def size(self) -> float:
        """Return the larger side of what is drawn [m]."""
        return float(np.ptp([*self.points.values()], axis=0).max())

    def guide(self, body: DrawnBody, direction: complex) -> Array:
        """Return the ends of the line of a body that slides, a little beyond both points."""
        start, end = (complex(*self.points[name]) for name in body.line or ())
        beyond = BEYOND * self.size * direction
        first, last = sorted((start, end), key=lambda at: (at * direction.conjugate()).real)
        return np.array([(at.real, at.imag) for at in (first - beyond, last + beyond)])

    def free_side(self, name: str) -> tuple[float, float]:
        """Return the direction farthest from the bars at a point, and from its support."""
        bars = [bar for body in self.bodies for bar in body.strokes if name in bar]
        ends = [self.points[q if p == name else p] - self.points[name] for p, q in bars]
        lines = [body.line[::-1] for body in self.bodies if body.line and body.line[1] == name]
        # A block lies to both sides of its point.
        ends += [self.points[p] - self.points[q] for p, q in lines]
        # Where something has slid to the start of its line there is no way along it.
        ends = [end for end in ends if end.any()]
        taken = [atan2(y, x) % tau for x, y in ends]
        taken = sorted([*taken, *(SUPPORT if name in self.pivots else ())]) or [0.0]
        gaps = [(b - a, (a + b) / 2.0) for a, b in pairwise([*taken, taken[0] + tau])]
        _, middle = max(gaps)
        return cos(middle), sin(middle)


def line_directions(pose: LinkagePose) -> list[complex]:
    """Return the direction of each line that something slides along, in the bodies' order."""
    linkage, u = pose.linkage, pose.vectors
    return [complex(linkage.line(u, j)) for j in sorted(linkage.structure.line_of)]


def colour_of(body: int) -> str:
    """Return the colour of a body, by its number."""
    return COLOURS[body % len(COLOURS)]
