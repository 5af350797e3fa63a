"""The assembly sheet: a leg layer by layer, with its pins, spacers and washers, as SVG."""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from klann_ros.sanitize.text import counted, printable

from .drawing import MM, path_data, svg_file
from .layers import Layers, Shaft
from .outline import Outline, outlines, Segment
from .plates import Hole, Plate

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


def pins(of: Layers, thickness: float, washer: float) -> Iterator[Pin]:
    """Yield the pins of a leg for plates and washers of a thickness [m], in its order."""
    stubs = {shaft.name: between for shaft, between in of.stubs}
    for shaft in of.shafts:
        low, high = of.span(shaft)
        diameter, gaps = MM * shaft.diameter, high - low
        grip = MM * ((gaps + 1) * thickness + gaps * washer)
        ends = []
        if shaft.name in stubs:
            names = ', '.join(printable(of.plates[p].name, 24) for p in stubs[shaft.name])
            ends.append(f'a stub: {names} passes')
        for end, side in (('lower', -1), ('upper', 1)):
            if any(one.name == shaft.name and at == side for one, at in of.flush):
                ends.append(f'{end} flush')
        screw = _screw(grip + NUT * diameter)
        text = '; '.join(ends) or 'head and nut'
        yield Pin(shaft.name, diameter, low, high, of.spacers(shaft), gaps, grip, screw, text)


def _screw(least: float) -> int:
    """Return the shortest standard length of a screw [mm]."""
    longer = (length for length in SCREWS if length >= least)
    return next(longer, 10 * ceil(least / 10.0))


def spacers(of: Layers) -> Iterator[Plate]:
    """Yield the spacers of a leg's pins, rings of the plates' material."""
    plate = of.plates[0]
    for shaft in of.shafts:
        if of.spacers(shaft):
            yield Plate(
                f'spacer {shaft.name}',
                (Hole('', 0j, shaft.diameter),),
                count=of.spacers(shaft) * plate.count,
                legs=plate.legs,
                links=((0j, 0j),),
                width=2.0 * shaft.radius(plate.width),
            )


def assembly(legs: Sequence[Layers], *, thickness: float, washer: float) -> str:
    """
    Return the assembly sheet of legs as SVG.

    Parameters
    ----------
    legs : sequence of Layers
        Each distinct leg once.
    thickness, washer : float
        Of the plates, and of the washers between layers; 0 for none [m].

    """
    wide = COLUMNS * PANEL + 2.0 * MARGIN
    root = Element('svg', xmlns='http://www.w3.org/2000/svg')
    SubElement(root, 'rect', width='100%', height='100%', fill='#ffffff')
    y = MARGIN
    for leg in legs:
        y = _leg(root, leg, y, thickness, washer)
    high = y + MARGIN
    root.attrib.update(width=f'{wide:g}mm', height=f'{high:g}mm', viewBox=f'0 0 {wide:g} {high:g}')
    return svg_file(root)


def _leg(root: Element, of: Layers, y: float, thickness: float, washer: float) -> float:
    """Draw a leg below a height of the sheet; return its lower end [mm]."""
    view, (plate, *_) = _LayerView(of), of.plates
    name = f'Leg {printable(plate.legs, 40)}' if plate.legs else 'Leg'
    each = f', {plate.count} times' if plate.count > 1 else ''
    _text(root, f'{name}{each}: {counted(of.count, "layer")}, from the bottom', y + TITLE, TITLE)
    y += 2.0 * TITLE
    for layer in range(of.count):
        left = MARGIN + layer % COLUMNS * PANEL
        top = y + layer // COLUMNS * (PANEL + 2.0 * TEXT)
        names = ', '.join(
            printable(plate.name, 24)
            for plate, own in zip(of.plates, of.layer, strict=True)
            if own == layer
        )
        title = f'Layer {layer}: {names}'
        size = min(TEXT, (PANEL - TEXT) / (LETTER_WIDTH * len(title)))
        _text(root, title, top + TEXT, size, left)
        panel = SubElement(root, 'g', transform=f'translate({left:g} {top + 1.5 * TEXT:g})')
        view.draw(panel, layer)
    y += ceil(of.count / COLUMNS) * (PANEL + 2.0 * TEXT)
    for row in (HEADS, *map(_row, pins(of, thickness, washer))):
        y += LINE * TEXT
        x = MARGIN
        for cell, width in zip(row, WIDTHS, strict=True):
            _text(root, cell, y, TEXT, x, is_bold=row is HEADS)
            x += width
    for note in _notes(of, view.scale, thickness, washer):
        y += LINE * TEXT
        _text(root, note, y, TEXT)
    return y + 2.0 * TITLE


def _row(pin: Pin) -> tuple[str, ...]:
    hole, span = f'{pin.diameter:g} mm', f'{pin.low} to {pin.high}'
    counts, lengths = (
        map(str, (pin.spacers, pin.washers)),
        (f'{pin.grip:.4g} mm', f'{pin.screw} mm'),
    )
    return printable(pin.name, 24), hole, span, *counts, *lengths, pin.ends


def _notes(of: Layers, scale: float, thickness: float, washer: float) -> Iterator[str]:
    between = f'a washer of {MM * washer:g} mm between layers' if washer else 'no washers'
    yield f'Plates of {MM * thickness:g} mm, {between}. Drawn 1 : {1.0 / scale:.3g}.'
    yield 'A ring is a spacer, as thick as a plate: the pin passes a layer without its plates.'
    yield (
        'Screw: the grip, a nut and two threads. A flush end is countersunk, or tapped into its '
        'plate: another plate passes over it.'
    )
    crank = of.motion.crank
    yield f'Fix pin {printable(crank, 24)} to the crank and drive it; it turns in the ground.'
    yield (
        f'Checked at each crank angle for plates and foreign pins; the sampling error of '
        f'{MM * of.motion.bound:.2g} mm is allowed for.'
    )


class _LayerView:
    """A leg at a crank angle, in millimetres of a panel."""

    def __init__(self, of: Layers) -> None:
        self._of = of
        places = [
            self._at(plate, end) for plate in of.plates for link in plate.links for end in link
        ]
        edge = max(plate.width for plate in of.plates) / 2.0 * (1 + 1j)
        self._low = complex(min(p.real for p in places), min(p.imag for p in places)) - edge
        high = complex(max(p.real for p in places), max(p.imag for p in places)) + edge
        size = high - self._low
        self.scale = (PANEL - 2.0 * TEXT) / (MM * max(size.real, size.imag))

    def draw(self, panel: Element, layer: int) -> None:
        """Draw a layer, and the layers below it in grey; its labels lie clear of each other."""
        of, taken = self._of, list[_Box]()
        own = [p for p in range(len(of.plates)) if of.layer[p] == layer]
        for p in sorted(range(len(of.plates)), key=lambda p: of.layer[p]):
            if of.layer[p] <= layer:
                self._plate(panel, p, is_new=p in own)
        spans = [(shaft, *of.span(shaft)) for shaft in of.shafts]
        shafts = [shaft for shaft, low, high in spans if low <= layer <= high]
        for shaft in shafts:
            self._pin(panel, shaft, layer)
        for shaft in shafts:
            at = self._mm(of.plates[shaft.carrier], shaft.at)
            _label(panel, shaft.name, [], (at, self._length(shaft.diameter / 2.0)), taken)
        for p in own:
            plate = of.plates[p]
            start, end = max(self._links(plate), key=lambda link: abs(link[1] - link[0]))
            holes = [self._mm(plate, hole.at) for hole in plate.holes]
            places = [start + part * (end - start) for part in (0.5, 0.4, 0.6, 0.3, 0.7)]
            places.sort(key=lambda at: -min((abs(at - hole) for hole in holes), default=0.0))
            around = places[0], self._length(plate.width / 2.0)
            _label(panel, plate.name, places if start != end else [], around, taken)

    def _plate(self, panel: Element, p: int, *, is_new: bool) -> None:
        plate = self._of.plates[p]
        colour = LAYER_COLOURS[p % len(LAYER_COLOURS)] if is_new else '#b8b8b8'
        style = {'fill': colour, 'fill-opacity': '0.35' if is_new else '0.15', 'stroke': colour}
        cuts: list[Outline] = [*outlines(self._links(plate), self._length(plate.width / 2.0))]
        round_cuts = [(slot.start, slot.end, slot.diameter) for slot in plate.slots]
        round_cuts += [(hole.at, hole.at, hole.diameter) for hole in plate.holes]
        for start, end, diameter in round_cuts:
            line = self._mm(plate, start), self._mm(plate, end)
            cuts += outlines([line], self._length(diameter / 2.0))
        data = ' '.join(path_data(cut, PANEL) for cut in cuts)
        shape = {'d': data, 'fill-rule': 'evenodd', 'stroke-width': '0.25'}
        SubElement(panel, 'path', {**shape, **style})

    def _pin(self, panel: Element, shaft: Shaft, layer: int) -> None:
        of = self._of
        plate = of.plates[shaft.carrier]
        at, radius = self._mm(plate, shaft.at), self._length(shaft.diameter / 2.0)
        place = {'cx': f'{at.real:.3f}', 'cy': f'{PANEL - at.imag:.3f}'}
        if all(of.layer[p] != layer for p in shaft.plates):
            ring = f'{self._length(shaft.radius(plate.width)):.3f}'
            style = {'fill': '#ffffff', 'stroke': '#000000', 'stroke-width': '0.3'}
            SubElement(panel, 'circle', {**place, 'r': ring, **style})
        SubElement(panel, 'circle', {**place, 'r': f'{radius:.3f}', 'fill': '#000000'})

    def _links(self, plate: Plate) -> list[Segment]:
        return [(self._mm(plate, a), self._mm(plate, b)) for a, b in plate.links]

    def _at(self, plate: Plate, place: complex) -> complex:
        return complex(self._of.motion.place(plate, place)[self._of.motion.shown])

    def _mm(self, plate: Plate, place: complex) -> complex:
        return (self._at(plate, place) - self._low) * MM * self.scale

    def _length(self, metres: float) -> float:
        return metres * MM * self.scale


# The lower left and the upper right corner of a label [mm].
_Box = tuple[complex, complex]


def _label(
    panel: Element,
    text: str,
    places: Sequence[complex],
    around: tuple[complex, float],
    taken: list[_Box],
) -> None:
    """Write a label at the first place, or else around a disc, that no other label has taken."""
    shown, (centre, radius) = printable(text, 24), around
    size = complex(LETTER_WIDTH * len(shown), 1.0) * TEXT
    far = 1.2 * radius + 0.5
    rows = [y for n in range(LABEL_ROWS) for y in (far + n * TEXT, -far - (n + 1) * TEXT)]
    beside = [centre + complex(x, y) for y in rows for x in (far, -far - size.real)]
    boxes = [(at, at + size) for at in (*places, *beside)]
    box = next((box for box in boxes if not any(_overlap(box, one) for one in taken)), boxes[0])
    taken.append(box)
    at = box[0]
    place = {'x': f'{at.real:.3f}', 'y': f'{PANEL - at.imag:.3f}', 'font-size': f'{TEXT:g}'}
    style = {'fill': '#000000', 'font-family': 'sans-serif', 'paint-order': 'stroke'}
    halo = {'stroke': '#ffffff', 'stroke-width': '0.6'}
    SubElement(panel, 'text', {**place, **style, **halo}).text = shown


def _overlap(one: _Box, other: _Box) -> bool:
    wide = one[0].real < other[1].real and other[0].real < one[1].real
    return wide and one[0].imag < other[1].imag and other[0].imag < one[1].imag


def _text(
    root: Element, content: str, y: float, size: float, x: float = MARGIN, *, is_bold: bool = False
) -> None:
    weight = {'font-weight': 'bold'} if is_bold else {}
    place = {'x': f'{x:g}', 'y': f'{y:g}', 'font-size': f'{size:g}', 'font-family': 'sans-serif'}
    SubElement(root, 'text', {**place, **weight}).text = content
