"""Plates laid out flat beside each other, in millimetres: what SVG and DXF are written from."""

from cmath import rect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import hypot, sqrt, tau
from typing import NamedTuple

from klann_ros.sanitize.text import printable

from .outline import distance_to, Outline, outlines
from .plates import ExportError, Plate

MM = 1e3
# Between plates, and around all [mm].
GAP = 5.0
# Heights of letters [mm]; the width of one as a part of its height, capitals being wider.
TITLE, MIN_LETTER, LETTER, CAPITAL = 4.0, 0.7, 0.75, 1.2
# Between a label and a cut [mm]; directions and distances that are tried for a label.
MARGIN, DIRECTIONS, DISTANCES = 0.3, 24, 16
# Of a title [characters].
MAX_TITLE = 80


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
    Cut lines, x to the right, y up, [mm].

    Attributes
    ----------
    size : complex
        How wide and how high it is.
    outlines : tuple of tuple of Corner
        The plates, closed, counter-clockwise, in the order of the plates.
    windows : tuple of tuple of Corner
        Openings between the links of a plate, closed, clockwise.
    circles : tuple of Circle
        The holes.
    slots : tuple of tuple of Corner
        The slots, as outlines are.
    texts : tuple of Text
        The titles and the letters.

    """

    size: complex
    outlines: tuple[Outline, ...]
    windows: tuple[Outline, ...]
    circles: tuple[Circle, ...]
    slots: tuple[Outline, ...]
    texts: tuple[Text, ...]


def drawing(plates: Sequence[Plate], *, kerf: float = 0.0) -> Drawing:
    """
    Return plates laid out in rows, none over another, each with its title below.

    Parameters
    ----------
    plates : sequence of Plate
        The plates.
    kerf : float
        The width of the cut: outlines grow, holes and slots shrink by half of it [m].

    Raises
    ------
    ExportError
        The kerf is not >= 0, or a hole is no wider.

    """
    least = min((hole.diameter for plate in plates for hole in plate.holes), default=1.0)
    if not 0.0 <= kerf < least:
        raise ExportError(
            f'kerf = {kerf * 1e3:g} mm is refused: >= 0, and narrower than the smallest hole, '
            f'{least * 1e3:g} mm'
        )
    placed = [_PlacedPlate(plate, MM * kerf / 2.0) for plate in plates]
    room = sum((one.size.real + GAP) * (one.size.imag + GAP) for one in placed)
    widest = max(*(one.size.real for one in placed), 1.2 * sqrt(room))
    x = y = GAP
    row = right = 0.0
    for one in placed:
        if x > GAP and x + one.size.real > widest + GAP:
            x, y, row = GAP, y + row + GAP, 0.0
        one.corner = complex(x, y)
        x, row = x + one.size.real + GAP, max(row, one.size.imag)
        right = max(right, x)
    return Drawing(
        complex(right, y + row + GAP),
        tuple(one.outlines[0] for one in placed),
        tuple(window for one in placed for window in one.outlines[1:]),
        tuple(circle for one in placed for circle in one.circles),
        tuple(slot for one in placed for slot in one.slots),
        tuple(text for one in placed for text in one.texts),
    )


class _PlacedPlate:
    """A plate on the sheet: its longest way lies along x, its title is below it."""

    def __init__(self, plate: Plate, offset: float) -> None:
        self._plate, self._offset = plate, offset
        self._title = printable(plate.title, MAX_TITLE)
        self._radius = MM * plate.width / 2.0
        corners = [end for link in plate.links for end in link]
        far = max(combinations(corners, 2), key=lambda pair: abs(pair[1] - pair[0]))
        along = far[1] - far[0]
        self._turn = MM * (along.conjugate() / abs(along) if along else 1.0)
        turned = [corner * self._turn for corner in corners]
        low = complex(min(at.real for at in turned), min(at.imag for at in turned))
        high = complex(max(at.real for at in turned), max(at.imag for at in turned))
        edge = complex(1.0, 1.0) * (self._radius + offset)
        self._low = low - edge
        bare = high - low + 2.0 * edge
        letters = LETTER * TITLE * len(self._title)
        self._below = 1.5 * TITLE
        self.size = complex(max(bare.real, letters), bare.imag + self._below)
        self.corner = 0j

    @property
    def outlines(self) -> tuple[Outline, ...]:
        return outlines(self._links, self._radius + self._offset)

    @property
    def _links(self) -> list[tuple[complex, complex]]:
        return [(self._placed(start), self._placed(end)) for start, end in self._plate.links]

    @property
    def circles(self) -> list[Circle]:
        return [
            Circle(self._placed(hole.at), MM * hole.diameter / 2.0 - self._offset)
            for hole in self._plate.holes
        ]

    @property
    def slots(self) -> list[Outline]:
        return [
            outlines(
                [(self._placed(slot.start), self._placed(slot.end))],
                MM * slot.diameter / 2.0 - self._offset,
            )[0]
            for slot in self._plate.slots
        ]

    @property
    def texts(self) -> list[Text]:
        title = Text(self._title, self.corner + 0.25j * TITLE, TITLE)
        return [title, *self._labels()]

    def _labels(self) -> Iterator[Text]:
        """Yield the names of holes where there is room beside them, clear of every cut."""
        taken = [(circle.at, circle.radius) for circle in self.circles]
        for hole in (hole for hole in self._plate.holes if hole.name):
            name, at = printable(hole.name, MAX_TITLE), self._placed(hole.at)
            # Around the text: its diagonal for a height of 1.
            across = hypot(1.0, CAPITAL * len(name))
            rooms = self._rooms(at, MM * hole.diameter, taken)
            best, room = max(rooms, key=lambda pair: pair[1])
            height = min(TITLE, 2.0 * room / across)
            if height >= MIN_LETTER:
                corner = complex(-CAPITAL * len(name), -1.0) * height / 2.0
                taken.append((best, across * height / 2.0))
                yield Text(name, best + corner, height)

    def _rooms(
        self, at: complex, hole: float, taken: Sequence[tuple[complex, float]]
    ) -> Iterator[tuple[complex, float]]:
        """Yield places around a hole with the radius that is clear of cuts and labels [mm]."""
        slots = [
            ((self._placed(slot.start), self._placed(slot.end)), MM * slot.diameter / 2.0)
            for slot in self._plate.slots
        ]
        reach = hole / 2.0 + 2.0 * self._radius
        for k in range(DIRECTIONS * DISTANCES):
            far = hole / 2.0 + (reach - hole / 2.0) * (1 + k // DIRECTIONS) / DISTANCES
            place = at + rect(far, tau * (k % DIRECTIONS) / DIRECTIONS)
            if any(abs(place - circle.at) < far * (1.0 - 1e-9) for circle in self.circles):
                # Another hole is nearer.
                continue
            inside = self._radius - min(distance_to(link, place) for link in self._links)
            clear = [abs(place - centre) - radius for centre, radius in taken]
            clear += [distance_to(slot, place) - radius for slot, radius in slots]
            # Of the same room the nearest counts.
            yield place, min(inside, *clear) - MARGIN - 1e-3 * far

    def _placed(self, at: complex) -> complex:
        return at * self._turn - self._low + self.corner + 1j * self._below
