"""The strokes of sliding bodies over all reachable crank angles."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

from klann_ros.kinematics import body_points, FIXED, Linkage, linkage_poses, path_arcs
from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

# The end of a stroke is then missed by less than 2e-6 of the stroke.
TRAVEL_SAMPLES = 1441


class ExportError(ValueError):
    """A robot that a format cannot represent; the text says why."""


class SlideLine(NamedTuple):
    """The line that a body slides along."""

    body: int  # the sliding body
    on: int  # the body of the line, FIXED for the ground
    name: str  # of the sliding body
    origin: complex  # distance 0 in the line's body [m]
    direction: complex
    min_distance: float  # [m]
    max_distance: float

    def ends(self, pins: Sequence[float]) -> tuple[complex, complex]:
        """Return the ends of a slot for pins at distances from the body's first point [m]."""
        start = self.origin + (self.min_distance + min(pins)) * self.direction
        return start, self.origin + (self.max_distance + max(pins)) * self.direction


def travel(linkage: Linkage) -> dict[int, tuple[float, float]]:
    """Return the least and the greatest distance of each sliding body [m]; or an ExportError."""
    structure = linkage.structure
    if not structure.slides:
        return {}
    x = linkage_poses(linkage, crank_angles(linkage, TRAVEL_SAMPLES), angles=True).angles
    if x is None or not np.isfinite(x).any():
        raise ExportError('the crank reaches no angle: nothing slides anywhere')
    ranges = {}
    for j, body in enumerate(structure.bodies):
        if body.slides:
            ranges[j] = float(np.nanmin(x[:, j - 1])), float(np.nanmax(x[:, j - 1]))
    return ranges


def slide_lines(linkage: Linkage) -> Iterator[SlideLine]:
    """Yield the lines that bodies slide along."""
    structure = linkage.structure
    places = body_points(structure, linkage.bars)
    for name, pivot in zip(structure.pivots, linkage.pivots, strict=True):
        places[FIXED, name] = complex(pivot)
    for j, (min_distance, max_distance) in travel(linkage).items():
        body = structure.bodies[j]
        along = structure.along[j]
        on = FIXED if along is None else along
        origin = places[on, body.bars[0].start]
        direction = complex(linkage.bars[structure.line_of[j]])
        yield SlideLine(j, on, body.angle, origin, direction, min_distance, max_distance)


def crank_angles(linkage: Linkage, count: int) -> FloatArray:
    """
    Return `count` crank angles in each reachable arc, or turn, with its ends [rad].

    They are uniform in a full turn, else dense at the ends of arcs, where links are in line and
    bodies move with the square root of the angle.
    """
    arcs = _arcs(linkage)
    shares = np.linspace(0.0, 1.0, count)
    if arcs[:1] != [(0.0, TURN * linkage.change_points.period)]:
        shares = (1.0 - np.cos(np.pi * shares)) / 2.0
    angles = [start + (end - start) * shares for start, end in arcs]
    return np.concatenate([np.empty(0), *angles])


# With sliding bodies the search takes some tenths of a second.
@lru_cache(maxsize=32)
def _arcs(linkage: Linkage) -> list[Arc]:
    return path_arcs(linkage)
