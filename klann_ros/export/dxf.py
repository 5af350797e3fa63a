"""A drawing as DXF, in millimetres, by ezdxf (the extra "dxf"), which is imported when used."""

from io import StringIO

from .drawing import Drawing
from .outline import Outline

# Of each layer its colour, as AutoCAD numbers them: red, blue, black or white.
LAYERS = {'CUT': 1, 'HOLES': 5, 'LABELS': 7}


class NoEzdxfError(RuntimeError):
    """DXF is asked for, and ezdxf is not installed."""

    def __init__(self) -> None:
        super().__init__("DXF needs ezdxf, which is not here: pip install 'klann_ros[dxf]'")


def dxf(given: Drawing) -> bytes:
    """
    Return a drawing as DXF: closed LWPOLYLINEs with arcs, CIRCLEs and TEXTs.

    Raises
    ------
    NoEzdxfError
        ezdxf is not installed.

    """
    try:
        from ezdxf.filemanagement import new  # noqa: PLC0415 - an extra
        from ezdxf.units import MM  # noqa: PLC0415 - as above
    except ModuleNotFoundError as error:
        raise NoEzdxfError from error

    document = new('R2010', units=MM)
    for name, colour in LAYERS.items():
        document.layers.add(name, color=colour)
    space = document.modelspace()

    def closed(outline: Outline, layer: str) -> None:
        corners = [(corner.at.real, corner.at.imag, corner.bulge) for corner in outline]
        space.add_lwpolyline(corners, format='xyb', close=True, dxfattribs={'layer': layer})

    for outline in (*given.outlines, *given.windows):
        closed(outline, 'CUT')
    for circle in given.circles:
        at = circle.at.real, circle.at.imag
        space.add_circle(at, circle.radius, dxfattribs={'layer': 'HOLES'})
    for slot in given.slots:
        closed(slot, 'HOLES')
    for text in given.texts:
        place = text.at.real, text.at.imag
        space.add_text(
            text.text, height=text.height, dxfattribs={'layer': 'LABELS'}
        ).set_placement(place)
    stream = StringIO()
    document.write(stream)
    return document.encode(stream.getvalue())
