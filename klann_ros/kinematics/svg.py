"""
Pictures of legs, poses and foot paths as SVG, which a notebook shows without matplotlib.

A moving picture is SVG as well (animation elements, no script), so it can stand in any page.
"""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from html import escape
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.drawing import line_directions, POINT, PoseDrawing
import numpy as np

SIZE = (420.0, 320.0)
"""Largest width and height of a picture [px]."""
MARGIN = 30.0
# Radius of a joint, half the width of a support, distance of a letter [px].
JOINT = 4.0
SUPPORT = 9.0
LETTER = 14.0
# Samples of a foot path, and frames of a turn.
SAMPLES = 90
# A tag, its style, and the attributes that move.
_Shape = tuple[str, dict[str, Any], dict[str, Any]]
_PATH = {'fill': 'none', 'stroke': '#8d99ae', 'stroke-width': '1.5'}


def pose_svg(
    pose: Any, path: Sequence[FloatArray] = (), *, names: dict[tuple[str, str], str] | None = None
) -> str:
    """
    Return a LinkagePose as SVG: bars, plates, joints and the letters of its points.

    `path` are lines drawn behind it, shape (n, 2) each [m], `names` names of bars by their points.
    """
    view = _View([pose.points, *path])
    shapes = [_polyline(view.points(line), **_PATH) for line in path]
    shapes += _pose_shapes(PoseDrawing.of(pose), line_directions(pose), view, names or {})
    return view.svg(shapes, f'{pose.linkage.name or "linkage"}: a pose')


def leg_svg(leg: Any) -> str:
    """Return a leg's first reachable pose with its foot path; a text if it reaches none."""
    arcs = _solved_arcs(leg)
    if not arcs:
        return _View([np.zeros((1, 2))]).svg([], 'the leg reaches no crank angle')
    return pose_svg(arcs[0][0], [_feet(poses) for poses in arcs])


def path_svg(path: Any) -> str:
    """Return a FootPath as SVG, with its stride and lift."""
    starts = np.searchsorted(path.alphas, [start for start, _ in path.arcs])
    lines = np.split(path.h, starts[1:])
    if path.full_turn:
        lines = [np.vstack([*lines, path.h[:1]])]
    view = _View(lines)
    style = {**_PATH, 'stroke': '#d1495b'}
    shapes = [_polyline(view.points(line), **style) for line in lines]
    unit = f' {path.unit}'.rstrip()
    figures = f'stride {path.stride:.4g}{unit}, lift {path.lift:.4g}{unit}'
    return view.svg([*shapes, _text(view.width / 2.0, 14.0, figures)], f'foot path: {figures}')


def animation_svg(leg: Any, *, period: float = 4.0) -> str:
    """
    Return a turn of a leg as a moving SVG; over an arc it moves to and fro.

    A turn takes `period` [s]; a linkage with change points may be back only after several. The
    leg's last pose is kept. Raises a ValueError if it reaches no crank angle, or `period` is not
    above 0.
    """
    if not period > 0.0:
        raise ValueError(f'period = {period!r} is refused: it must be > 0')
    arcs = _solved_arcs(leg)
    if not arcs:
        raise ValueError('the leg reaches no crank angle')
    start, end = leg.path_arcs()[0]
    poses = arcs[0] if end - start >= TURN else [*arcs[0], *arcs[0][::-1]]
    duration = period * max(1, round((end - start) / TURN))
    view = _View([_feet(poses), *(pose.points for pose in poses)])
    shapes = [_polyline(view.points(_feet(arcs[0])), **_PATH)]
    frames = [[*_frame(PoseDrawing.of(pose), view)] for pose in poses]
    shapes += [_animation(shape, duration) for shape in zip(*frames, strict=True)]
    return view.svg(shapes, f'{leg.linkage.name or "linkage"}: a turn of the crank')


def _animation(frames: Sequence[_Shape], period: float) -> str:
    """Return a shape that moves through its frames in a period [s]."""
    tag, style, first_attributes = frames[0]
    animations = ''
    for name in first_attributes:
        positions = ';'.join(str(attributes[name]) for _, _, attributes in frames)
        animations += (
            f'<animate attributeName="{name}" dur="{period:g}s" repeatCount="indefinite" '
            f'values="{positions}"/>'
        )
    return f'<{tag}{_attributes(style | first_attributes)}>{animations}</{tag}>'


class _View:
    """Pixels of a plane: its lines fit into a picture, y upwards."""

    def __init__(self, lines: Iterable[FloatArray]) -> None:
        points = np.vstack([*lines])
        points = points[np.isfinite(points).all(axis=1)]
        self._low = points.min(axis=0)
        extent = np.maximum(np.ptp(points, axis=0), 1e-9)
        self._scale = float(min((np.array(SIZE) - 2.0 * MARGIN) / extent))
        self.width = 2.0 * MARGIN + self._scale * float(extent[0])
        self.height = 2.0 * MARGIN + self._scale * float(extent[1])

    def points(self, points: FloatArray) -> list[tuple[float, float]]:
        """Return points of the plane [m] in pixels."""
        x, y = (MARGIN + self._scale * (points - self._low)).T
        return [*zip(x.round(1).tolist(), (self.height - y).round(1).tolist(), strict=True)]

    def svg(self, shapes: Iterable[str], label: str) -> str:
        """Return the whole picture."""
        width = round(self.width)
        height = round(self.height)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}" role="img" aria-label="{escape(label)}">'
            f'<rect width="100%" height="100%" fill="#fff"/>{"".join(shapes)}</svg>'
        )


def _solved_arcs(leg: Any) -> list[list[Any]]:
    """Return poses along each reachable arc; the leg itself keeps its last pose."""
    leg_copy = copy(leg)
    leg_copy.reset()
    arcs = []
    for start, end in leg.path_arcs():
        progress = np.linspace(0.0, 1.0, SAMPLES * max(1, round((end - start) / TURN)) + 1)
        if end - start < TURN:
            # Near its ends, the dead points, a path is fastest.
            progress = 0.5 - 0.5 * (1.0 - 1e-6) * np.cos(np.pi * progress)
        alphas = start + (end - start) * progress
        arcs.append([leg_copy.solve(alpha) for alpha in alphas.tolist()])
    return arcs


def _feet(poses: Sequence[Any]) -> FloatArray:
    return np.array([tuple(pose.h) for pose in poses])


def _pose_shapes(
    drawing: PoseDrawing,
    directions: Sequence[complex],
    view: _View,
    names: dict[tuple[str, str], str],
) -> Iterator[str]:
    """Yield the shapes of a pose: guides, bars, joints, and names."""
    line_direction = iter(directions)
    for body in drawing.bodies:
        if body.line:
            guide = view.points(drawing.guide(body, next(line_direction)))
            dashes = {'stroke': body.colour, 'stroke-dasharray': '6 4', 'fill': 'none'}
            yield _polyline(guide, **dashes)
    for tag, style, moving_attributes in _frame(drawing, view):
        yield f'<{tag}{_attributes(style | moving_attributes)}/>'
    for bar, name in names.items():
        start, end = (complex(*point) for point in view.points(drawing.at(bar)))
        normal = LETTER * 1j * (end - start) / abs(end - start)
        # Beside the bar, away from the letters of its ends.
        letters = sum(complex(*drawing.free_side(point)) for point in bar)
        side = 1.0 if (normal * letters).real < 0.0 else -1.0
        places = [start + part * (end - start) + side * normal for part in (0.5, 0.75)]
        pixels = [complex(*point) for point in view.points(drawing.at([*drawing.points]))]
        place = max(places, key=lambda place: min(abs(place - pixel) for pixel in pixels))
        yield _text(place.real, place.imag, name)
    for name, point in drawing.points.items():
        if name in drawing.on_bars:
            ((x, y),) = view.points(point[None])
            u, v = drawing.free_side(name)
            yield _text(x + LETTER * u, y - LETTER * v, name)


def _frame(drawing: PoseDrawing, view: _View) -> Iterator[_Shape]:
    """Yield the shapes of a pose: the tag, its style, and the attributes that move."""
    pixels = {name: view.points(point[None])[0] for name, point in drawing.points.items()}
    for body in drawing.bodies:
        if len(body.points) > 2:
            corners = _point_list(view.points(drawing.outline(body)))
            yield 'polygon', {'fill': body.colour, 'opacity': '0.2'}, {'points': corners}
        for start, end in body.bars:
            x_1, y_1 = pixels[start]
            x_2, y_2 = pixels[end]
            style = {'stroke': body.colour, 'stroke-width': '5', 'stroke-linecap': 'round'}
            yield 'line', style, {'x1': x_1, 'y1': y_1, 'x2': x_2, 'y2': y_2}
        if body.line:
            x, y = pixels[body.line[1]]
            block: dict[str, Any] = {'width': 18, 'height': 12, 'fill': '#fff'}
            yield 'rect', {**block, 'stroke': body.colour}, {'x': x - 9.0, 'y': y - 6.0}
    for name in drawing.pivots:
        if name in drawing.on_bars:
            x, y = pixels[name]
            base = f'{x - SUPPORT},{y + 1.5 * SUPPORT} {x + SUPPORT},{y + 1.5 * SUPPORT}'
            yield 'polygon', {'points': f'{x},{y} {base}', 'fill': '#ccc', 'stroke': '#000'}, {}
    for kind, names in drawing.joints.items():
        radius = 2.5 if kind == POINT else JOINT
        fill = '#000' if kind == POINT else '#fff'
        dot: dict[str, Any] = {'r': radius, 'fill': fill, 'stroke': '#000'}
        for name in names:
            if name in drawing.on_bars:
                x, y = pixels[name]
                yield 'circle', dot, {'cx': x, 'cy': y}


def _polyline(points: Sequence[tuple[float, float]], **style: Any) -> str:
    return f'<polyline{_attributes({"points": _point_list(points), **style})}/>'


def _point_list(points: Sequence[tuple[float, float]]) -> str:
    return ' '.join(f'{x},{y}' for x, y in points)


def _text(x: float, y: float, text: str) -> str:
    style = {'text-anchor': 'middle', 'dominant-baseline': 'middle', 'font-size': '14'}
    position = {'x': round(x, 1), 'y': round(y, 1), 'font-family': 'sans-serif', 'fill': '#000'}
    return f'<text{_attributes(position | style)}>{escape(text, quote=False)}</text>'


def _attributes(attributes: dict[str, Any]) -> str:
    return ''.join(f' {name}="{escape(str(value))}"' for name, value in attributes.items())
