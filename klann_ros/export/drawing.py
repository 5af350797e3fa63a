"""The plates laid out on a sheet in millimetres, and the sheet as SVG and DXF."""

from cmath import rect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import chain, combinations
from math import atan, hypot, sin, sqrt, tau
from typing import NamedTuple
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.missing_package import install_command
from klann_ros.sanitize.text import printable
import numpy as np

from .outline import distance_to, Outline, outlines, Segment
from .plates import ExportError, Plate

MM = 1e3
# Between plates, and around the sheet [mm].
PLATE_GAP = 5.0
# Heights of letters [mm], and their width as a part of that; capitals are wider.
TITLE, MIN_LETTER, LETTER, CAPITAL = 4.0, 0.7, 0.75, 1.2
# Between a label and a cut [mm]; directions and distances that are tried for a label.
LABEL_CLEARANCE, DIRECTIONS, DISTANCES = 0.3, 24, 16
# Of a title [characters].
MAX_TITLE = 80
# A capital's height, as a part of the SVG font's.
FONT_CAPITAL = 0.72
# Colours by which the programs of laser cutters tell cutting from engraving.
SVG_STYLES = {
    'CUT': {'fill': 'none', 'stroke': '#ff0000', 'stroke-width': '0.1'},
    'HOLES': {'fill': 'none', 'stroke': '#0000ff', 'stroke-width': '0.1'},
    'LABELS': {'fill': '#000000', 'stroke': 'none', 'font-family': 'sans-serif'},
    # Areas for programs that extrude them.
    'PLATES': {'fill': '#c0c0c0', 'fill-rule': 'evenodd', 'stroke': 'none'},
}
# The colours' numbers in AutoCAD: red, blue, black or white.
DXF_COLOURS = {'CUT': 1, 'HOLES': 5, 'LABELS': 7}


class NoEzdxfError(RuntimeError):
    """DXF output without ezdxf (the extra `dxf`)."""

    def __init__(self) -> None:
        super().__init__(f'DXF needs ezdxf, which is not here: {install_command("ezdxf", "dxf")}')


class Circle(NamedTuple):
    """A hole: its centre and radius [mm]."""

    at: complex
    radius: float


class Text(NamedTuple):
    """A text: the start of its base line and its height [mm]."""

    text: str
    at: complex
    height: float


@dataclass(frozen=True)
class Drawing:
    """
    Cut lines, x to the right, y up, [mm]; `size` is width and height.

    `outlines` are the plates, in their order, and `slots`: closed, counter-clockwise; `windows`
    the openings between the links of a plate: closed, clockwise. `circles` are the holes, `texts`
    titles and names of holes. `areas` has all curves of each plate, its outline first.
    """

    size: complex
    outlines: tuple[Outline, ...]
    windows: tuple[Outline, ...]
    circles: tuple[Circle, ...]
    slots: tuple[Outline, ...]
    texts: tuple[Text, ...]
    areas: tuple[tuple[Outline, ...], ...]


def drawing(plates: Sequence[Plate], *, kerf: float = 0.0) -> Drawing:
    """
    Return plates laid out in rows without overlap, each with its title below.

    Parameters
    ----------
    plates : sequence of Plate
        The plates.
    kerf : float
        Width of the cut: outlines grow, holes and slots shrink by half of it [m].

    Raises
    ------
    ExportError
        The kerf is negative, or a hole is not wider.

    """
    holes = chain.from_iterable(plate.holes for plate in plates)
    min_diameter = min((hole.diameter for hole in holes), default=1.0)
    if not 0.0 <= kerf < min_diameter:
        raise ExportError(
            f'kerf = {kerf * 1e3:g} mm is refused: >= 0, and narrower than the smallest hole, '
            f'{min_diameter * 1e3:g} mm'
        )
    placed_plates = [_PlacedPlate(plate, MM * kerf / 2.0) for plate in plates]
    max_width = 0.0
    area = 0.0
    for placed in placed_plates:
        max_width = max(max_width, placed.size.real)
        area += (placed.size.real + PLATE_GAP) * (placed.size.imag + PLATE_GAP)
    sheet_width = max(max_width, 1.2 * sqrt(area))
    x = y = PLATE_GAP
    row_height = right = 0.0
    cuts: list[Outline] = []
    windows: list[Outline] = []
    circles: list[Circle] = []
    slots: list[Outline] = []
    texts: list[Text] = []
    areas: list[tuple[Outline, ...]] = []
    for placed in placed_plates:
        if x > PLATE_GAP and x + placed.size.real > sheet_width + PLATE_GAP:
            x = PLATE_GAP
            y += row_height + PLATE_GAP
            row_height = 0.0
        placed.corner = complex(x, y)
        x += placed.size.real + PLATE_GAP
        row_height = max(row_height, placed.size.imag)
        right = max(right, x)
        outer, *inner = placed.outlines()
        cuts.append(outer)
        windows += inner
        circles += placed.circles()
        slots += placed.slots()
        texts += placed.texts()
        curves = [outer, *inner, *placed.slots()]
        for circle in placed.circles():
            curves += outlines([(circle.at, circle.at)], circle.radius)
        areas.append(tuple(curves))
    return Drawing(
        size=complex(right, y + row_height + PLATE_GAP),
        outlines=tuple(cuts),
        windows=tuple(windows),
        circles=tuple(circles),
        slots=tuple(slots),
        texts=tuple(texts),
        areas=tuple(areas),
    )


class _PlacedPlate:
    """A plate on the sheet: its longest side lies along x, its title below it."""

    def __init__(self, plate: Plate, offset: float) -> None:
        self._plate = plate
        self._offset = offset  # half of the kerf [mm]
        self._title = printable(plate.title, MAX_TITLE)
        self._radius = MM * plate.width / 2.0
        corners = [*chain.from_iterable(plate.links)]
        diagonals = [end - start for start, end in combinations(corners, 2)]
        along = max(diagonals, key=abs)
        self._rotation = MM * (along.conjugate() / abs(along) if along else 1.0)
        rotated = np.array([corner * self._rotation for corner in corners])
        low = complex(rotated.real.min(), rotated.imag.min())
        high = complex(rotated.real.max(), rotated.imag.max())
        edge = complex(1.0, 1.0) * (self._radius + offset)
        extent = high - low + 2.0 * edge
        self._origin = low - edge - 1.5j * TITLE
        title_width = LETTER * TITLE * len(self._title)
        self.size = complex(max(extent.real, title_width), extent.imag + 1.5 * TITLE)
        self.corner = 0j

    def outlines(self) -> tuple[Outline, ...]:
        return outlines(self._links(), self._radius + self._offset)

    def circles(self) -> list[Circle]:
        circles = []
        for hole in self._plate.holes:
            radius = MM * (hole.bore or hole.diameter) / 2.0 - self._offset
            circles.append(Circle(self._to_sheet(hole.at), radius))
        return circles

    def slots(self) -> list[Outline]:
        slots = []
        for line, radius in self._slot_lines():
            slots.append(outlines([line], radius - self._offset)[0])
        return slots

    def texts(self) -> Iterator[Text]:
        """Yield the title, and the names of holes with space beside them, clear of every cut."""
        yield Text(self._title, self.corner + 0.25j * TITLE, TITLE)
        discs = self.circles()
        for hole in self._plate.holes:
            if not hole.name:
                continue
            name = printable(hole.name, MAX_TITLE)
            # The diagonal of the text's box for a height of 1.
            diagonal = hypot(1.0, CAPITAL * len(name))
            free_discs = self._free_discs(self._to_sheet(hole.at), MM * hole.diameter, discs)
            best = max(free_discs, key=lambda disc: disc.radius)
            height = min(TITLE, 2.0 * best.radius / diagonal)
            if height >= MIN_LETTER:
                corner = complex(-CAPITAL * len(name), -1.0) * height / 2.0
                discs.append(Circle(best.at, diagonal * height / 2.0))
                yield Text(name, best.at + corner, height)

    def _free_discs(
        self, centre: complex, hole: float, discs: Sequence[Circle]
    ) -> Iterator[Circle]:
        """Yield discs around a hole that are clear of cuts and labels [mm]."""
        slots = [*self._slot_lines()]
        links = self._links()
        circles = self.circles()
        reach = hole / 2.0 + 2.0 * self._radius
        for k in range(DIRECTIONS * DISTANCES):
            distance = hole / 2.0 + (reach - hole / 2.0) * (1 + k // DIRECTIONS) / DISTANCES
            place = centre + rect(distance, tau * (k % DIRECTIONS) / DIRECTIONS)
            if any(abs(place - circle.at) < distance * (1.0 - 1e-9) for circle in circles):
                # Another hole is nearer.
                continue
            clearance = self._radius - min(distance_to(link, place) for link in links)
            for disc in discs:
                clearance = min(clearance, abs(place - disc.at) - disc.radius)
            for slot, radius in slots:
                clearance = min(clearance, distance_to(slot, place) - radius)
            # Among equal ones the nearest wins.
            yield Circle(place, clearance - LABEL_CLEARANCE - 1e-3 * distance)

    def _links(self) -> list[Segment]:
        return [(self._to_sheet(start), self._to_sheet(end)) for start, end in self._plate.links]

    def _slot_lines(self) -> Iterator[tuple[Segment, float]]:
        for slot in self._plate.slots:
            line = self._to_sheet(slot.start), self._to_sheet(slot.end)
            yield line, MM * slot.diameter / 2.0

    def _to_sheet(self, point: complex) -> complex:
        return point * self._rotation - self._origin + self.corner


def svg(plan: Drawing, *, filled: bool = False) -> str:
    """
    Return a drawing as SVG in millimetres: groups of cuts, holes and labels.

    With `filled`, each plate is one path that is filled by the even-odd rule, its holes left out.
    """
    width = plan.size.real
    height = plan.size.imag
    root = Element(
        'svg',
        xmlns='http://www.w3.org/2000/svg',
        width=f'{width:.6f}mm',
        height=f'{height:.6f}mm',
        viewBox=f'0 0 {width:.6f} {height:.6f}',
    )
    groups = {}
    for name in ('PLATES', 'LABELS') if filled else DXF_COLOURS:
        groups[name] = SubElement(root, 'g', {'id': name, **SVG_STYLES[name]})

    def x_y(point: complex) -> tuple[str, str]:
        # y is down.
        return f'{point.real:.6f}', f'{height - point.imag:.6f}'

    if filled:
        for number, area in enumerate(plan.areas, start=1):
            curves = ' '.join(path_data(outline, height) for outline in area)
            SubElement(groups['PLATES'], 'path', id=f'plate_{number}', d=curves)
    else:
        for outline in (*plan.outlines, *plan.windows):
            SubElement(groups['CUT'], 'path', d=path_data(outline, height))
        for circle in plan.circles:
            cx, cy = x_y(circle.at)
            SubElement(groups['HOLES'], 'circle', cx=cx, cy=cy, r=f'{circle.radius:.6f}')
        for slot in plan.slots:
            SubElement(groups['HOLES'], 'path', d=path_data(slot, height))
    for text in plan.texts:
        x, y = x_y(text.at)
        size = f'{text.height / FONT_CAPITAL:.6f}'
        SubElement(groups['LABELS'], 'text', {'x': x, 'y': y, 'font-size': size}).text = text.text
    return svg_file(root)


def path_data(outline: Outline, height: float) -> str:
    """Return an outline as the data of an SVG path, with y down from a height [mm]."""

    def x_y(point: complex) -> str:
        return f'{point.real:.6f} {height - point.imag:.6f}'

    commands = [f'M {x_y(outline[0].at)}']
    for corner, following in zip(outline, [*outline[1:], outline[0]], strict=True):
        if corner.bulge:
            chord = abs(following.at - corner.at)
            radius = chord / (2.0 * sin(2.0 * atan(corner.bulge)))
            commands.append(f'A {radius:.6f} {radius:.6f} 0 0 0 {x_y(following.at)}')
        else:
            commands.append(f'L {x_y(following.at)}')
    return ' '.join([*commands, 'Z'])


def svg_file(root: Element) -> str:
    """Return an SVG element as the text of a file."""
    indent(root)
    text = tostring(root, encoding='unicode')
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def dxf(plan: Drawing, *, exploded: bool = False) -> bytes:
    """
    Return a drawing as DXF in millimetres: closed LWPOLYLINEs with arcs, CIRCLEs and TEXTs.

    With `exploded`, LINEs and ARCs are in place of the polylines.

    Raises
    ------
    NoEzdxfError
        ezdxf is not installed.

    """
    try:
        from ezdxf.filemanagement import new  # noqa: PLC0415 - an extra
        from ezdxf.units import MM as DXF_MM  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise NoEzdxfError from error

    document = new('R2010', units=DXF_MM)
    for name, colour in DXF_COLOURS.items():
        document.layers.add(name, color=colour)
    space = document.modelspace()

    def closed(outline: Outline, layer: str) -> None:
        corners = [(corner.at.real, corner.at.imag, corner.bulge) for corner in outline]
        attributes = {'layer': layer}
        line = space.add_lwpolyline(corners, format='xyb', close=True, dxfattribs=attributes)
        if exploded:
            line.explode()

    for outline in (*plan.outlines, *plan.windows):
        closed(outline, 'CUT')
    for circle in plan.circles:
        centre = circle.at.real, circle.at.imag
        space.add_circle(centre, circle.radius, dxfattribs={'layer': 'HOLES'})
    for slot in plan.slots:
        closed(slot, 'HOLES')
    for text in plan.texts:
        label = space.add_text(text.text, height=text.height, dxfattribs={'layer': 'LABELS'})
        label.set_placement((text.at.real, text.at.imag))
    stream = StringIO()
    document.write(stream)
    encoded: bytes = document.encode(stream.getvalue())
    return encoded
