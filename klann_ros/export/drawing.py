"""Plates laid out flat beside each other, in millimetres: what SVG and DXF are written from."""

from cmath import phase, rect
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import pi, sqrt, tan, tau
from typing import NamedTuple

from klann_ros.untrusted.text import printable

from .plates import Plate

MM = 1e3
# Between plates, and around all [mm].
GAP = 5.0
# Heights of letters, and the room of one, as a part of its height [mm].
TITLE, LEAST, LETTER = 4.0, 1.0, 0.75
# A title that is longer is cut.
LONGEST = 80


class Corner(NamedTuple):
    """A corner of an outline, as DXF has it."""

    # Where it is [mm].
    at: complex
    # Of the way to the next one: the tangent of a quarter of its arc, > 0 counter-clockwise; 0
    # for a straight line.
    bulge: float = 0.0


class Circle(NamedTuple):
    """A hole: its middle and its radius [mm]."""

    at: complex
    radius: float


class Text(NamedTuple):
    """A text: where it begins, on its base line, and how high it is [mm]."""

    text: str
    at: complex
    height: float


@dataclass(frozen=True)
class Drawing:
    """
    What is cut, x to the right, y up, [mm].

    Attributes
    ----------
    size : complex
        How wide and how high it is.
    outlines : tuple of tuple of Corner
        The plates, closed, counter-clockwise, in the order of the plates.
    circles : tuple of Circle
        The holes.
    slots : tuple of tuple of Corner
        The slots, as outlines are.
    texts : tuple of Text
        The titles and the letters.

    """

    size: complex
    outlines: tuple[tuple[Corner, ...], ...]
    circles: tuple[Circle, ...]
    slots: tuple[tuple[Corner, ...], ...]
    texts: tuple[Text, ...]


def drawing(plates: Sequence[Plate], *, hole: float, width: float) -> Drawing:
    """
    Return plates laid out in rows, none over another, each with its title below.

    Parameters
    ----------
    plates : sequence of Plate
        What is cut.
    hole, width : float
        The holes' diameter and the bars' width [m].

    """
    laid = [_Laid(plate, MM * hole, MM * width) for plate in plates]
    room = sum((one.size.real + GAP) * (one.size.imag + GAP) for one in laid)
    widest = max(*(one.size.real for one in laid), 1.2 * sqrt(room))
    x = y = GAP
    row = right = 0.0
    for one in laid:
        if x > GAP and x + one.size.real > widest + GAP:
            x, y, row = GAP, y + row + GAP, 0.0
        one.corner = complex(x, y)
        x, row = x + one.size.real + GAP, max(row, one.size.imag)
        right = max(right, x)
    return Drawing(
        complex(right, y + row + GAP),
        tuple(one.outline for one in laid),
        tuple(circle for one in laid for circle in one.circles),
        tuple(slot for one in laid for slot in one.slots),
        tuple(text for one in laid for text in one.texts),
    )


class _Laid:
    """A plate on the sheet: its longest way lies along x, its title is below it."""

    def __init__(self, plate: Plate, hole: float, width: float) -> None:
        self._plate, self._hole, self._width = plate, hole, width
        self._title = printable(plate.title, LONGEST)
        corners = plate.corners
        far = max(combinations(corners, 2), key=lambda pair: abs(pair[1] - pair[0]), default=None)
        along = far[1] - far[0] if far else 0.0
        self._turn = MM * (along.conjugate() / abs(along) if along else 1.0)
        turned = [corner * self._turn for corner in corners]
        low = complex(min(at.real for at in turned), min(at.imag for at in turned))
        high = complex(max(at.real for at in turned), max(at.imag for at in turned))
        self._low = low - complex(1.0, 1.0) * width / 2.0
        bare = high - low + complex(1.0, 1.0) * width
        letters = LETTER * TITLE * len(self._title)
        self._below = 1.5 * TITLE
        self.size = complex(max(bare.real, letters), bare.imag + self._below)
        self.corner = 0j

    @property
    def outline(self) -> tuple[Corner, ...]:
        return rounded([self._placed(at) for at in self._plate.corners], self._width / 2.0)

    @property
    def circles(self) -> list[Circle]:
        return [Circle(self._placed(hole.at), self._hole / 2.0) for hole in self._plate.holes]

    @property
    def slots(self) -> list[tuple[Corner, ...]]:
        return [
            rounded([self._placed(slot.start), self._placed(slot.end)], self._hole / 2.0)
            for slot in self._plate.slots
        ]

    @property
    def texts(self) -> list[Text]:
        title = Text(self._title, self.corner + 0.25j * TITLE, TITLE)
        # Beside the hole, in what is left of the bar.
        height = max(min(TITLE, 0.35 * (self._width - self._hole)), LEAST)
        beside = complex(0.35 * self._hole, 0.35 * self._hole)
        letters = [
            Text(printable(hole.name, LONGEST), self._placed(hole.at) + beside, height)
            for hole in self._plate.holes
            if hole.name
        ]
        return [title, *letters]

    def _placed(self, at: complex) -> complex:
        return at * self._turn - self._low + self.corner + 1j * self._below


def rounded(places: Sequence[complex], radius: float) -> tuple[Corner, ...]:
    """Return the outline that goes around places at a distance, counter-clockwise."""
    corners = hull(places)
    if len(corners) == 1:
        return Corner(corners[0] + radius, 1.0), Corner(corners[0] - radius, 1.0)
    ways = [end - start for start, end in pairwise([*corners, corners[0]])]
    made = []
    for at, before, after in zip(corners, [ways[-1], *ways[:-1]], ways, strict=True):
        # To the right of a way is outside.
        begins, ends = phase(-1j * before), phase(-1j * after)
        turned = pi if len(corners) == 2 else (ends - begins) % tau
        made.append(Corner(at + rect(radius, begins), tan(turned / 4.0)))
        made.append(Corner(at + rect(radius, ends)))
    return tuple(made)


def hull(places: Sequence[complex]) -> list[complex]:
    """Return the corners of the convex hull, counter-clockwise; of a line its two ends."""
    ordered = sorted(set(places), key=lambda at: (at.real, at.imag))
    if len(ordered) < 3:
        return ordered
    size = abs(ordered[-1] - ordered[0])
    halves = []
    for way in (ordered, ordered[::-1]):
        half: list[complex] = []
        for at in way:
            while len(half) > 1 and _bend(half[-2], half[-1], at) <= 1e-12 * size**2:
                half.pop()
            half.append(at)
        halves += half[:-1]
    return halves


def _bend(a: complex, b: complex, c: complex) -> float:
    return ((b - a).conjugate() * (c - b)).imag
