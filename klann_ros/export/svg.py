"""A drawing as SVG, in millimetres; cuts, holes and labels are groups, as cutters take them."""

from math import atan, sin
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from .drawing import Drawing
from .outline import Outline

# Colours that laser cutters' programs cut and engrave.
STYLES = {
    'CUT': {'fill': 'none', 'stroke': '#ff0000', 'stroke-width': '0.1'},
    'HOLES': {'fill': 'none', 'stroke': '#0000ff', 'stroke-width': '0.1'},
    'LABELS': {'fill': '#000000', 'stroke': 'none', 'font-family': 'sans-serif'},
}
SVG_HEADER = '<?xml version="1.0" encoding="UTF-8"?>\n'
# A capital letter's height, as a part of the font's.
CAPITAL = 0.72


def svg(given: Drawing) -> str:
    """Return a drawing as SVG."""
    wide, high = given.size.real, given.size.imag
    root = Element(
        'svg',
        xmlns='http://www.w3.org/2000/svg',
        width=f'{wide:.6f}mm',
        height=f'{high:.6f}mm',
        viewBox=f'0 0 {wide:.6f} {high:.6f}',
    )
    layers = {name: SubElement(root, 'g', {'id': name, **style}) for name, style in STYLES.items()}

    def x_y(at: complex) -> tuple[str, str]:
        # y is down.
        return f'{at.real:.6f}', f'{high - at.imag:.6f}'

    for outline in (*given.outlines, *given.windows):
        SubElement(layers['CUT'], 'path', d=path_data(outline, high))
    for circle in given.circles:
        cx, cy = x_y(circle.at)
        SubElement(layers['HOLES'], 'circle', cx=cx, cy=cy, r=f'{circle.radius:.6f}')
    for slot in given.slots:
        SubElement(layers['HOLES'], 'path', d=path_data(slot, high))
    for text in given.texts:
        x, y = x_y(text.at)
        size = f'{text.height / CAPITAL:.6f}'
        SubElement(layers['LABELS'], 'text', {'x': x, 'y': y, 'font-size': size}).text = text.text
    return written(root)


def path_data(outline: Outline, high: float) -> str:
    """Return an outline as the data of a path, y down from a height [mm]."""

    def x_y(at: complex) -> str:
        return f'{at.real:.6f} {high - at.imag:.6f}'

    way = [f'M {x_y(outline[0].at)}']
    for corner, following in zip(outline, [*outline[1:], outline[0]], strict=True):
        if corner.bulge:
            chord = abs(following.at - corner.at)
            radius = chord / (2.0 * sin(2.0 * atan(corner.bulge)))
            way.append(f'A {radius:.6f} {radius:.6f} 0 0 0 {x_y(following.at)}')
        else:
            way.append(f'L {x_y(following.at)}')
    return ' '.join([*way, 'Z'])


def written(root: Element) -> str:
    """Return an element as a file."""
    indent(root)
    return SVG_HEADER + tostring(root, encoding='unicode') + '\n'
