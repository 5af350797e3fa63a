"""Charts over an angle as SVG, which need no scripts: on paper, and with scripts disabled."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, degrees as to_degrees, floor, inf, isfinite, log10

from klann_ros.kinematics.angles import enclosing_turns
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.web import element, joined, Markup
import numpy as np

WIDTH = 420.0
HEIGHT = 210.0
# Margins around the curves [px].
LEFT, RIGHT, TOP, BOTTOM = 48.0, 8.0, 10.0, 34.0
# Maximum number of points drawn of a line.
_MAX_POINTS = 361
# Steps between the labels of the horizontal axis [deg].
_ANGLE_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0)
_LINE_COLOURS = 7
# A curve may step between samples within this distance [rad].
_STEP_WIDTH = 1e-6
# The end of a range that is off a tick by rounding is on it [steps].
_TICK_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class ChartLine:
    """A line of a chart: its name, its heights, and the number of its colour."""

    name: str
    heights: FloatArray
    colour: int = 0
    is_dashed: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """
    A chart over an angle.

    `spans` are shaded angles [rad], `limits` are named heights, each drawn as a line. With `moves`
    a cursor marks the crank angle of the animation.
    """

    title: str
    unit: str
    angles: FloatArray
    lines: Sequence[ChartLine]
    text: str
    spans: Sequence[tuple[float, float]] = ()
    limits: Sequence[tuple[str, float]] = ()
    axis: str = 'crank angle / deg'
    moves: bool = True

    def figure(self) -> Markup:
        """Return the chart's element, with title, legend and text."""
        return element(
            'figure',
            element('h3', f'{self.title} / {self.unit}'),
            element('p', *self._keys(), class_='legend'),
            self._drawing(),
            element('figcaption', self.text),
            class_='card chart',
        )

    def _keys(self) -> Iterator[Markup]:
        for line in self.lines:
            yield _key(line.name, _line_style(line))
        for name, _ in self.limits:
            if name:
                yield _key(name, 'limit')
        if self.spans:
            yield _key('foot on the ground', 'span')

    def _drawing(self) -> Markup:
        x_0, x_1 = self._angle_range
        low, high = self._height_range()
        height_ticks = ticks(low, high)
        frame = _Frame(x_0, x_1, min(low, height_ticks[0]), max(high, height_ticks[-1]))
        return element(
            'svg',
            *self._shapes(frame, height_ticks),
            _text(self.axis, (LEFT + WIDTH - RIGHT) / 2.0, HEIGHT - 3.0, 'middle'),
            self._cursor(frame),
            viewBox=f'0 0 {WIDTH:g} {HEIGHT:g}',
            role='img',
            aria_label=f'{self.title} / {self.unit}. {self.text}',
        )

    def _shapes(self, frame: '_Frame', height_ticks: Sequence[float]) -> Iterator[Markup]:
        for span in self.spans:
            yield _shade(frame, *span)
        for height in height_ticks:
            yield _horizontal(frame, height, height_ticks)
        for degrees in angle_ticks(frame.x_0, frame.x_1):
            yield _vertical(frame, degrees)
        for _, limit in self.limits:
            if frame.low <= limit <= frame.high:
                path = f'M{LEFT} {frame.y(limit):.1f}H{WIDTH - RIGHT}'
                yield element('path', d=path, class_='limit')
        for line in self.lines:
            yield self._path(frame, line)

    @property
    def _angle_range(self) -> tuple[float, float]:
        """Return the ends of the horizontal axis [deg]; full turns end at multiples of 360."""
        if not self.angles.size:
            return 0.0, 360.0
        ends = np.degrees([self.angles.min(), self.angles.max()])
        step = np.degrees(np.diff(self.angles).max(initial=0.0))
        full_turns = 360.0 * enclosing_turns(self.angles)
        is_closed = abs(ends[1] - ends[0] + step - full_turns) < 1e-6
        return (0.0, full_turns) if is_closed else (float(ends[0]), float(ends[1]))

    def _height_range(self) -> tuple[float, float]:
        """Return the ends of the vertical axis: 0, the curves and limits not far from them."""
        heights = np.concatenate([np.empty(0), *(line.heights for line in self.lines)])
        heights = heights[np.isfinite(heights)]
        if not heights.size:
            return 0.0, 1.0
        low = min(0.0, float(heights.min()))
        high = max(0.0, float(heights.max()))
        # A limit far beyond the curves would flatten them.
        max_limit = 2.0 * max(high, -low)
        limits = [limit for _, limit in self.limits if abs(limit) < max_limit]
        low = min([low, *limits])
        high = max([high, *limits])
        return (low, high) if high > low else (0.0, 1.0)

    def _path(self, frame: '_Frame', line: ChartLine) -> Markup:
        """Return a curve, interrupted where heights are not finite or angles are left out."""
        step = max(1, len(self.angles) // (_MAX_POINTS - 1))
        indices = np.unique(np.append(np.arange(0, len(self.angles), step), len(self.angles) - 1))
        # Both sides of a step are drawn.
        steps = np.flatnonzero(np.diff(self.angles) < _STEP_WIDTH)
        indices = np.union1d(indices, [*steps, *steps + 1]).astype(int)
        degrees = np.degrees(self.angles)[indices].tolist()
        heights = line.heights[indices].tolist()
        if frame.is_closed:
            degrees.append(frame.x_1)
            heights.append(heights[0])
        min_gap = 5.0 * (frame.x_1 - frame.x_0) / _MAX_POINTS
        path = ''
        last_x = -inf
        for x, y in zip(degrees, heights, strict=True):
            if not isfinite(y):
                last_x = -inf
                continue
            pen = 'L' if x - last_x < min_gap else 'M'
            path += f'{pen}{frame.x(x):.1f} {frame.y(y):.1f}'
            last_x = x
        return element('path', d=path, class_=f'curve {_line_style(line)}')

    def _cursor(self, frame: '_Frame') -> Markup:
        if not self.moves:
            return Markup()
        return element(
            'path',
            d=f'M{LEFT} {TOP}V{HEIGHT - BOTTOM}',
            class_='cursor',
            data_from=f'{frame.x_0!r}',
            data_to=f'{frame.x_1!r}',
            data_width=f'{WIDTH - LEFT - RIGHT!r}',
        )


@dataclass(frozen=True)
class _Frame:
    """The mapping of angles [deg] and heights to the drawing."""

    x_0: float
    x_1: float
    low: float
    high: float

    def x(self, degrees: float) -> float:
        fraction = (degrees - self.x_0) / (self.x_1 - self.x_0 or 1.0)
        return LEFT + fraction * (WIDTH - LEFT - RIGHT)

    @property
    def is_closed(self) -> bool:
        """Return whether the angles are whole turns."""
        return self.x_0 == 0.0 and self.x_1 % 360.0 == 0.0

    def y(self, height: float) -> float:
        fraction = (height - self.low) / (self.high - self.low)
        return HEIGHT - BOTTOM - fraction * (HEIGHT - TOP - BOTTOM)


def ticks(low: float, high: float) -> list[float]:
    """Return about five round numbers that enclose a range, `low` < `high`."""
    min_step = (high - low) / 5.0
    power = 10.0 ** floor(log10(min_step))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= min_step)
    return _multiples(step, floor(low / step + _TICK_SLACK), ceil(high / step - _TICK_SLACK))


def angle_ticks(low: float, high: float) -> list[float]:
    """Return round angles from `low` to `high` [deg]."""
    step = next((s for s in _ANGLE_STEPS if (high - low) / s <= 6.0), 90.0)
    return _multiples(step, ceil(low / step - _TICK_SLACK), floor(high / step + _TICK_SLACK))


def _multiples(step: float, first_factor: int, last_factor: int) -> list[float]:
    return [factor * step for factor in range(first_factor, last_factor + 1)]


def _shade(frame: _Frame, start: float, end: float) -> Markup:
    """Return the shade over angles [rad], which may extend beyond the turns."""
    period = frame.x_1 if frame.is_closed else 360.0
    height = f'{HEIGHT - TOP - BOTTOM:.1f}'
    rectangles = []
    for shift in (-period, 0.0, period):
        left = max(to_degrees(start) + shift, frame.x_0)
        right = min(to_degrees(end) + shift, frame.x_1)
        if left < right:
            x = f'{frame.x(left):.1f}'
            width = f'{frame.x(right) - frame.x(left):.1f}'
            size = {'x': x, 'y': f'{TOP:.1f}', 'width': width, 'height': height}
            rectangles.append(element('rect', **size, class_='span'))
    return joined(rectangles)


def _horizontal(frame: _Frame, height: float, height_ticks: Sequence[float]) -> Markup:
    y = frame.y(height)
    style = 'grid zero' if height == 0.0 else 'grid'
    line = element('path', d=f'M{LEFT} {y:.1f}H{WIDTH - RIGHT}', class_=style)
    return joined([line, _text(tick_label(height, height_ticks), LEFT - 5.0, y + 3.5, 'end')])


def tick_label(tick: float, all_ticks: Sequence[float]) -> str:
    """Return a label with the digits that the steps between labels need."""
    step = all_ticks[1] - all_ticks[0]
    if not 1e-4 <= step < 1e5:
        return f'{tick:.0e}' if tick else '0'
    return f'{tick:.{max(0, -floor(log10(step) + _TICK_SLACK))}f}'


def _vertical(frame: _Frame, degrees: float) -> Markup:
    x = frame.x(degrees)
    line = element('path', d=f'M{x:.1f} {TOP}V{HEIGHT - BOTTOM}', class_='grid')
    return joined([line, _text(f'{degrees:g}', x, HEIGHT - BOTTOM + 13.0, 'middle')])


def _text(text: str, x: float, y: float, anchor: str) -> Markup:
    return element('text', text, x=f'{x:.1f}', y=f'{y:.1f}', text_anchor=anchor)


def _line_style(line: ChartLine) -> str:
    return f'colour-{line.colour % _LINE_COLOURS}{" dashed" * line.is_dashed}'


def _key(name: str, style: str) -> Markup:
    sample = 'M1 4H25' if style != 'span' else 'M1 0H25V8H1Z'
    path = element('path', d=sample, class_=style)
    return element('span', element('svg', path, viewBox='0 0 26 8', aria_hidden='true'), name)


def grid(charts: Iterable[Chart]) -> Markup:
    """Return charts side by side."""
    figures = [*map(Chart.figure, charts)]
    if not figures:
        return Markup()
    return element('div', *figures, class_='charts')
