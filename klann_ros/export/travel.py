"""How far bodies slide, over all that the crank can reach."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from math import pi
from typing import NamedTuple

from klann_ros.dynamics.masses import body_places
from klann_ros.kinematics import Linkage, linkage_poses, reachable_arcs
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.linkage.structure import FIXED
import numpy as np
from numpy.typing import NDArray

# So fine the end of a stroke is missed by less than 2e-6 of the stroke.
TRAVEL_SAMPLES = 1441


class ExportError(ValueError):
    """A robot that cannot be written so; the text says why."""


class SlideLine(NamedTuple):
    """What a body slides along."""

    # What slides, and what has the line, FIXED being the ground.
    body: int
    on: int
    # What slides.
    name: str
    # Where the distance is 0, in what has the line [m], and which way it grows.
    origin: complex
    direction: complex
    # Of the distance [m].
    least: float
    greatest: float

    def ends(self, pins: Sequence[float]) -> tuple[complex, complex]:
        """Return the ends of a slot for pins at distances from the body's first point [m]."""
        start = self.origin + (self.least + min(pins)) * self.direction
        return start, self.origin + (self.greatest + max(pins)) * self.direction


def travel(linkage: Linkage) -> dict[int, tuple[float, float]]:
    """
    Return of each body that slides its least and its greatest distance [m].

    Raises
    ------
    ExportError
        The crank reaches no angle.

    """
    structure = linkage.structure
    if not structure.slides:
        return {}
    x = linkage_poses(linkage, crank_angles(linkage, TRAVEL_SAMPLES), angles=True).angles
    if x is None or not np.isfinite(x).any():
        raise ExportError('the crank reaches no angle: nothing slides anywhere')
    sliding = [j for j, body in enumerate(structure.bodies) if body.slides]
    return {j: (float(np.nanmin(x[:, j - 1])), float(np.nanmax(x[:, j - 1]))) for j in sliding}


def slide_lines(linkage: Linkage) -> Iterator[SlideLine]:
    """Yield the lines that bodies slide along."""
    structure, places = linkage.structure, body_places(linkage)
    for j, (least, greatest) in travel(linkage).items():
        body, along = structure.bodies[j], structure.along[j]
        on, start = FIXED if along is None else along, body.bars[0].start
        pivots = dict(zip(structure.pivots, linkage.pivots, strict=True))
        origin = complex(pivots[start]) if on == FIXED else places[on, start]
        direction = complex(linkage.bars[structure.line_of[j]])
        yield SlideLine(j, on, body.angle, origin, direction, least, greatest)


def crank_angles(linkage: Linkage, count: int) -> NDArray[np.float64]:
    """
    Return crank angles, a number of them in each arc that can be reached, with its ends [rad].

    They are even in a full turn. Elsewhere they are dense at the ends, where links get in line and
    bodies move by the square root of the angle.
    """
    arcs = _arcs(linkage)
    part = np.linspace(0.0, 1.0, count)
    if arcs != ((0.0, TURN),):
        part = (1.0 - np.cos(pi * part)) / 2.0
    return np.concatenate([np.empty(0), *(a + (b - a) * part for a, b in arcs)])


# Where something slides the search takes some tenths of a second.
@lru_cache(maxsize=32)
def _arcs(linkage: Linkage) -> tuple[tuple[float, float], ...]:
    return tuple(reachable_arcs(linkage))
