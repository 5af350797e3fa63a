"""The assembly sheet: a leg layer by layer, with its pins, spacers and washers, as SVG."""

from collections.abc import Iterator, Sequence
from itertools import chain
from math import ceil
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from klann_ros.kinematics import FIXED
from klann_ros.sanitize.text import counted, printable
import numpy as np

from .drawing import MM, path_data, svg_file
from .layers import Layers, Shaft
from .outline import Outline, outlines, Segment
from .parts import WALL_LAYER
from .plates import Hole, Plate, Slot

# Lengths of screws up to 60 mm, then every 10 mm (ISO 4762) [mm].
SCREWS = (5, 6, 8, 10, 12, 16, 20, 25, 30, 35, 40, 45, 50, 55, 60)
# A nut and two threads, as a part of the diameter.
NUT = 1.2
# Panels of a row, their size, and the heights of titles and texts [mm].
COLUMNS, PANEL, TITLE, TEXT = 3, 88.0, 5.0, 3.2
MARGIN, LINE = 8.0, 1.6
# Mean width of a letter, as a part of the font's size.
LETTER_WIDTH = 0.6
# Rows above and below a pin that are tried for its label.
LABEL_ROWS = 6
LAYER_COLOURS = ('#1f77b4', '#d95f02', '#1b9e77', '#7570b3', '#a6761d', '#e7298a')
# Columns of the table of pins, and their widths [mm].
HEADS = ('Pin', 'Hole', 'Layers', 'Spacers', 'Washers', 'Grip', 'Screw', 'Ends')
WIDTHS = (44.0, 18.0, 20.0, 18.0, 20.0, 20.0, 18.0, 0.0)


class Pin(NamedTuple):
    """A pin for a maker: lengths and diameters in [mm]."""

    name: str
    diameter: float
    low: int
    high: int
    spacers: int
    washers: int
    grip: float
    screw: int
    ends: str


def pins(
    stack: Layers, thickness: float, washer: float, *, is_framed: bool = False
) -> Iterator[Pin]:
    """Yield a leg's pins for plates and washers [m]; those of a framed ground from its wall."""
    for shaft in stack.shafts:
        low, high = stack.span(shaft)
        spacer_count = stack.spacers(shaft)
        if is_framed and any(stack.plates[p].body == FIXED for p in shaft.plates):
            spacer_count += low - WALL_LAYER - 1
            low = WALL_LAYER
        diameter = MM * shaft.diameter
        gaps = high - low
        grip = MM * ((gaps + 1) * thickness + gaps * washer)
        ends = []
        for stub in stack.stubs:
            if stub.shaft.name == shaft.name:
                ends.append(f'a stub: {_names(stack, stub.crossing)} passes')
        for end in stack.flush:
            if end.shaft.name == shaft.name:
                ends.append(f'{end.side.value} flush')
        screw = _screw(grip + NUT * diameter)
        text = '; '.join(ends) or 'head and nut'
        yield Pin(shaft.name, diameter, low, high, spacer_count, gaps, grip, screw, text)


def _names(stack: Layers, plates: Sequence[int]) -> str:
    return ', '.join(printable(stack.plates[p].name, 24) for p in plates)


def _screw(min_length: float) -> int:
    """Return the shortest standard length of a screw [mm]."""
    for length in SCREWS:
        if length >= min_length:
            return length
    return 10 * ceil(min_length / 10.0)


def spacers(stack: Layers) -> Iterator[Plate]:
    """Yield the spacers of a leg's pins, rings of the plates' material."""
    plate = stack.plates[0]
    for shaft in stack.shafts:
        if stack.spacers(shaft):
            yield Plate(
                f'spacer {shaft.name}',
                (Hole('', 0j, shaft.diameter),),
                count=stack.spacers(shaft) * plate.count,
                legs=plate.legs,
                links=((0j, 0j),),
                width=2.0 * shaft.radius(plate.width),
            )


def assembly(
    legs: Sequence[Layers], *, thickness: float, washer: float, is_framed: bool = False
) -> str:
    """
    Return the assembly sheet of legs as SVG.

    Parameters
    ----------
    legs : sequence of Layers
        Each distinct leg once.
    thickness, washer : float
        Of the plates, and of the washers between layers; 0 for none [m].
    is_framed : bool
        Whether printed walls hold the grounds of the legs.

    """
    width = COLUMNS * PANEL + 2.0 * MARGIN
    root = Element('svg', xmlns='http://www.w3.org/2000/svg')
    SubElement(root, 'rect', width='100%', height='100%', fill='#ffffff')
    y = MARGIN
    for leg in legs:
        y = _leg(root, leg, y, thickness, washer)
        for pin in pins(leg, thickness, washer, is_framed=is_framed):
            if pin.low < 0:
                counts = f'{counted(pin.spacers, "spacer")}, {counted(pin.washers, "washer")}'
                size = f'{counts}, a grip of {pin.grip:.4g} mm, a screw of {pin.screw} mm'
                name = printable(pin.name, 24)
                _text(root, f'Through a printed wall, pin {name}: {size}', y, TEXT)
                y += LINE * TEXT
    height = y + MARGIN
    root.attrib.update(
        width=f'{width:g}mm', height=f'{height:g}mm', viewBox=f'0 0 {width:g} {height:g}'
    )
    return svg_file(root)


def _leg(root: Element, stack: Layers, y: float, thickness: float, washer: float) -> float:
    """Draw a leg below a height of the sheet; return its lower end [mm]."""
    view = _LayerView(stack)
    plate = stack.plates[0]
    name = f'Leg {printable(plate.legs, 40)}' if plate.legs else 'Leg'
    times = f', {plate.count} times' if plate.count > 1 else ''
    _text(
        root, f'{name}{times}: {counted(stack.count, "layer")}, from the bottom', y + TITLE, TITLE
    )
    y += 2.0 * TITLE
    for layer in range(stack.count):
        left = MARGIN + layer % COLUMNS * PANEL
        top = y + layer // COLUMNS * (PANEL + 2.0 * TEXT)
        title = f'Layer {layer}: {_names(stack, stack.plates_in(layer))}'
        size = min(TEXT, (PANEL - TEXT) / (LETTER_WIDTH * len(title)))
        _text(root, title, top + TEXT, size, left)
        panel = SubElement(root, 'g', transform=f'translate({left:g} {top + 1.5 * TEXT:g})')
        view.draw(panel, layer)
    y += ceil(stack.count / COLUMNS) * (PANEL + 2.0 * TEXT)
    for cells in (HEADS, *map(_pin_cells, pins(stack, thickness, washer))):
        y += LINE * TEXT
        x = MARGIN
        for cell, width in zip(cells, WIDTHS, strict=True):
            _text(root, cell, y, TEXT, x, is_bold=cells is HEADS)
            x += width
    for note in _notes(stack, view.scale, thickness, washer):
        y += LINE * TEXT
        _text(root, note, y, TEXT)
    return y + 2.0 * TITLE


def _pin_cells(pin: Pin) -> tuple[str, ...]:
    return (
        printable(pin.name, 24),
        f'{pin.diameter:g} mm',
        f'{pin.low} to {pin.high}',
        str(pin.spacers),
        str(pin.washers),
        f'{pin.grip:.4g} mm',
        f'{pin.screw} mm',
        pin.ends,
    )


def _notes(stack: Layers, scale: float, thickness: float, washer: float) -> Iterator[str]:
    gaps = f'a washer of {MM * washer:g} mm between layers' if washer else 'no washers'
    yield f'Plates of {MM * thickness:g} mm, {gaps}. Drawn 1 : {1.0 / scale:.3g}.'
    yield 'A ring is a spacer, as thick as a plate: the pin passes a layer without its plates.'
    yield (
        'Screw: the grip, a nut and two threads. A flush end is countersunk, or tapped into its '
        'plate: another plate passes over it.'
    )
    crank = stack.motion.crank
    yield f'Fix pin {printable(crank, 24)} to the crank and drive it; it turns in the ground.'
    yield (
        f'Checked at each crank angle for plates and foreign pins; the sampling error of '
        f'{MM * stack.motion.bound:.2g} mm is allowed for.'
    )


class _LayerView:
    """A leg at a crank angle, in millimetres of a panel."""

    def __init__(self, stack: Layers) -> None:
        self._stack = stack
        motion = stack.motion
        points = []
        for plate in stack.plates:
            for end in chain.from_iterable(plate.links):
                points.append(motion.place(plate, end)[motion.shown])
        shown_points = np.array(points)
        max_width = max(plate.width for plate in stack.plates)
        edge = max_width / 2.0 * (1 + 1j)
        self._low = complex(shown_points.real.min(), shown_points.imag.min()) - edge
        high = complex(shown_points.real.max(), shown_points.imag.max()) + edge
        size = high - self._low
        self.scale = (PANEL - 2.0 * TEXT) / (MM * max(size.real, size.imag))

    def draw(self, panel: Element, layer: int) -> None:
        """Draw a layer, and the layers below it in grey; its labels lie clear of each other."""
        stack = self._stack
        labels: list[_Box] = []
        for lower_layer in range(layer + 1):
            for p in stack.plates_in(lower_layer):
                self._plate(panel, p, is_new=lower_layer == layer)
        shafts = []
        for shaft in stack.shafts:
            low, high = stack.span(shaft)
            if low <= layer <= high:
                shafts.append(shaft)
                self._pin(panel, shaft, layer)
        for shaft in shafts:
            centre = self._mm(stack.plates[shaft.carrier], shaft.at)
            _label(panel, shaft.name, [], (centre, self._length(shaft.diameter / 2.0)), labels)
        for p in stack.plates_in(layer):
            plate = stack.plates[p]
            start, end = max(self._links(plate), key=lambda link: abs(link[1] - link[0]))
            holes = np.array([self._mm(plate, hole.at) for hole in plate.holes])
            places = start + np.array([0.5, 0.4, 0.6, 0.3, 0.7]) * (end - start)
            if len(holes):
                hole_distances = np.abs(places[:, None] - holes).min(axis=1)
                places = places[np.argsort(-hole_distances, kind='stable')]
            around = places[0], self._length(plate.width / 2.0)
            _label(panel, plate.name, places.tolist() if start != end else [], around, labels)

    def _plate(self, panel: Element, p: int, *, is_new: bool) -> None:
        plate = self._stack.plates[p]
        colour = LAYER_COLOURS[p % len(LAYER_COLOURS)] if is_new else '#b8b8b8'
        style = {'fill': colour, 'fill-opacity': '0.35' if is_new else '0.15', 'stroke': colour}
        cuts: list[Outline] = [*outlines(self._links(plate), self._length(plate.width / 2.0))]
        round_cuts: list[Slot | Hole] = [*plate.slots, *plate.holes]
        for round_cut in round_cuts:
            start, end = round_cut.line
            line = self._mm(plate, start), self._mm(plate, end)
            cuts += outlines([line], self._length(round_cut.diameter / 2.0))
        curves = ' '.join(path_data(cut, PANEL) for cut in cuts)
        shape = {'d': curves, 'fill-rule': 'evenodd', 'stroke-width': '0.25'}
        SubElement(panel, 'path', {**shape, **style})

    def _pin(self, panel: Element, shaft: Shaft, layer: int) -> None:
        stack = self._stack
        plate = stack.plates[shaft.carrier]
        centre = self._mm(plate, shaft.at)
        radius = self._length(shaft.diameter / 2.0)
        place = {'cx': f'{centre.real:.3f}', 'cy': f'{PANEL - centre.imag:.3f}'}
        if layer not in {stack.layer[p] for p in shaft.plates}:
            ring = f'{self._length(shaft.radius(plate.width)):.3f}'
            style = {'fill': '#ffffff', 'stroke': '#000000', 'stroke-width': '0.3'}
            SubElement(panel, 'circle', {**place, 'r': ring, **style})
        SubElement(panel, 'circle', {**place, 'r': f'{radius:.3f}', 'fill': '#000000'})

    def _links(self, plate: Plate) -> list[Segment]:
        return [(self._mm(plate, a), self._mm(plate, b)) for a, b in plate.links]

    def _mm(self, plate: Plate, point: complex) -> complex:
        motion = self._stack.motion
        return (complex(motion.place(plate, point)[motion.shown]) - self._low) * MM * self.scale

    def _length(self, metres: float) -> float:
        return metres * MM * self.scale


# The lower left and the upper right corner of a label [mm].
_Box = tuple[complex, complex]


def _label(
    panel: Element,
    text: str,
    places: Sequence[complex],
    around: tuple[complex, float],
    labels: list[_Box],
) -> None:
    """Write a label at the first place, or else around a disc, that no other label overlaps."""
    label = printable(text, 24)
    centre, radius = around
    size = complex(LETTER_WIDTH * len(label), 1.0) * TEXT
    offset = 1.2 * radius + 0.5
    corners = [*places]
    for row in range(LABEL_ROWS):
        for y in (offset + row * TEXT, -offset - (row + 1) * TEXT):
            corners.append(centre + complex(offset, y))
            corners.append(centre + complex(-offset - size.real, y))
    corner = corners[0]
    for candidate in corners:
        if not any(_overlap((candidate, candidate + size), label_box) for label_box in labels):
            corner = candidate
            break
    labels.append((corner, corner + size))
    place = {
        'x': f'{corner.real:.3f}',
        'y': f'{PANEL - corner.imag:.3f}',
        'font-size': f'{TEXT:g}',
    }
    style = {'fill': '#000000', 'font-family': 'sans-serif', 'paint-order': 'stroke'}
    halo = {'stroke': '#ffffff', 'stroke-width': '0.6'}
    SubElement(panel, 'text', {**place, **style, **halo}).text = label


def _overlap(box_a: _Box, box_b: _Box) -> bool:
    (low_a, high_a), (low_b, high_b) = box_a, box_b
    is_beside = high_a.real <= low_b.real or high_b.real <= low_a.real
    return not (is_beside or high_a.imag <= low_b.imag or high_b.imag <= low_a.imag)


def _text(
    root: Element, text: str, y: float, size: float, x: float = MARGIN, *, is_bold: bool = False
) -> None:
    weight = {'font-weight': 'bold'} if is_bold else {}
    place = {'x': f'{x:g}', 'y': f'{y:g}', 'font-size': f'{size:g}', 'font-family': 'sans-serif'}
    SubElement(root, 'text', {**place, **weight}).text = text
