"""Charts over an angle as SVG, which need no scripts: on paper, and with scripts disabled."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, degrees as to_degrees, floor, inf, isfinite, log10

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.web import element, joined, Markup
import numpy as np

WIDTH, HEIGHT = 420.0, 210.0
LEFT, RIGHT, TOP, BOTTOM = 48.0, 8.0, 10.0, 34.0
# Maximum number of points drawn of a line.
_MAX_POINTS = 361
# Steps between the labels of the horizontal axis [deg].
_ANGLE_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0)
_LINE_COLOURS = 7
# Charts scroll on a small screen, so keys must reach them.
GROUP = {'tabindex': '0', 'role': 'group', 'aria_label': 'Charts'}
# A curve may step between samples within this distance [rad].
_STEP_WIDTH = 1e-6


@dataclass(frozen=True, eq=False)
class ChartLine:
    """A line of a chart: its name, its values, and the number of its colour."""

    name: str
    values: FloatArray
    colour: int = 0
    is_dashed: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """
    A chart over an angle.

    `spans` are shaded angles [rad], `limits` are named values, each drawn as a line. With `moves`
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
        """Return its element, with title, legend and text."""
        return element(
            'figure',
            element('h3', f'{self.title} / {self.unit}'),
            self._legend(),
            self._drawn(),
            element('figcaption', self.text),
            class_='card chart',
        )

    def _legend(self) -> Markup:
        keys = [
            (line.name, f'colour-{line.colour % _LINE_COLOURS}{" dashed" * line.is_dashed}')
            for line in self.lines
        ]
        keys += [(name, 'limit') for name, _ in self.limits if name]
        keys += [('foot on the ground', 'span')] if self.spans else []
        return element('p', *(_key(name, kind) for name, kind in keys), class_='legend')

    def _drawn(self) -> Markup:
        x_0, x_1 = self._reach
        low, high = self._range()
        rows = ticks(low, high)
        low, high = min(low, rows[0]), max(high, rows[-1])
        frame = _Frame(x_0, x_1, low, high)
        return element(
            'svg',
            *(_shade(frame, *span) for span in self.spans),
            *(_row(frame, value, rows) for value in rows),
            *(_column(frame, value) for value in angle_ticks(x_0, x_1)),
            *(
                element('path', d=f'M{LEFT} {frame.y(y):.1f}H{WIDTH - RIGHT}', class_='limit')
                for _, y in self.limits
                if low <= y <= high
            ),
            *(self._path(frame, line) for line in self.lines),
            _text(self.axis, (LEFT + WIDTH - RIGHT) / 2.0, HEIGHT - 3.0, 'middle'),
            self._cursor(frame),
            viewBox=f'0 0 {WIDTH:g} {HEIGHT:g}',
            role='img',
            aria_label=f'{self.title} / {self.unit}. {self.text}',
        )

    @property
    def _reach(self) -> tuple[float, float]:
        """Return the ends of the horizontal axis [deg]; a full turn ends at 360."""
        if not self.angles.size:
            return 0.0, 360.0
        ends = np.degrees([self.angles.min(), self.angles.max()])
        step = np.degrees(np.diff(self.angles).max(initial=0.0))
        whole = abs(ends[1] - ends[0] + step - 360.0) < 1e-6
        return (0.0, 360.0) if whole else (float(ends[0]), float(ends[1]))

    def _range(self) -> tuple[float, float]:
        values = np.concatenate([np.empty(0), *(line.values for line in self.lines)])
        values = values[np.isfinite(values)]
        if not values.size:
            return 0.0, 1.0
        low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
        # A limit far beyond the curves would flatten them.
        near = [value for _, value in self.limits if abs(value) < 2.0 * max(high, -low)]
        low, high = min([low, *near]), max([high, *near])
        return (low, high) if high > low else (0.0, 1.0)

    def _path(self, frame: '_Frame', line: ChartLine) -> Markup:
        step = max(1, len(self.angles) // (_MAX_POINTS - 1))
        indices = np.unique(np.append(np.arange(0, len(self.angles), step), len(self.angles) - 1))
        # Both sides of a step are drawn.
        before = np.flatnonzero(np.diff(self.angles) < _STEP_WIDTH)
        indices = np.union1d(indices, [*before, *before + 1]).astype(int)
        degrees, values = np.degrees(self.angles)[indices].tolist(), line.values[indices].tolist()
        if self._reach == (0.0, 360.0):
            degrees, values = [*degrees, 360.0], [*values, values[0]]
        gap = 5.0 * (frame.x_1 - frame.x_0) / _MAX_POINTS
        parts, last = [], -inf
        for x, y in zip(degrees, values, strict=True):
            if not isfinite(y):
                last = -inf
                continue
            pen = 'L' if x - last < gap else 'M'
            parts.append(f'{pen}{frame.x(x):.1f} {frame.y(y):.1f}')
            last = x
        kind = f'curve colour-{line.colour % _LINE_COLOURS}{" dashed" * line.is_dashed}'
        return element('path', d=''.join(parts), class_=kind)

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
    """The mapping of angles [deg] and values to the drawing."""

    x_0: float
    x_1: float
    low: float
    high: float

    def x(self, value: float) -> float:
        part = (value - self.x_0) / (self.x_1 - self.x_0 or 1.0)
        return LEFT + part * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        part = (value - self.low) / (self.high - self.low)
        return HEIGHT - BOTTOM - part * (HEIGHT - TOP - BOTTOM)


def ticks(low: float, high: float) -> list[float]:
    """Return four to nine round numbers from at most `low` to at least `high`."""
    rough = (high - low) / 5.0
    power = 10.0 ** floor(log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough)
    return [k * step for k in range(floor(low / step + 1e-9), ceil(high / step - 1e-9) + 1)]


def angle_ticks(low: float, high: float) -> list[float]:
    """Return round angles within two [deg]."""
    step = next((s for s in _ANGLE_STEPS if (high - low) / s <= 6.0), 90.0)
    return [k * step for k in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def _shade(frame: _Frame, start: float, end: float) -> Markup:
    """Return the shade over angles [rad], which may extend beyond the turn."""
    a, b = to_degrees(start), to_degrees(end)
    height, parts = HEIGHT - TOP - BOTTOM, []
    for turn in (-360.0, 0.0, 360.0):
        left, right = max(a + turn, frame.x_0), min(b + turn, frame.x_1)
        if left < right:
            x, width = frame.x(left), frame.x(right) - frame.x(left)
            box = {'x': f'{x:.1f}', 'y': f'{TOP:.1f}', 'width': f'{width:.1f}'}
            parts.append(element('rect', **box, height=f'{height:.1f}', class_='span'))
    return joined(parts)


def _row(frame: _Frame, value: float, rows: Sequence[float]) -> Markup:
    y = frame.y(value)
    kind = 'grid zero' if value == 0.0 else 'grid'
    line = element('path', d=f'M{LEFT} {y:.1f}H{WIDTH - RIGHT}', class_=kind)
    return joined([line, _text(tick_label(value, rows), LEFT - 5.0, y + 3.5, 'end')])


def tick_label(value: float, rows: Sequence[float]) -> str:
    """Return a label with the digits that the steps between labels need."""
    step = rows[1] - rows[0]
    if not 1e-4 <= step < 1e5:
        return f'{value:.0e}' if value else '0'
    return f'{value:.{max(0, -floor(log10(step) + 1e-9))}f}'


def _column(frame: _Frame, value: float) -> Markup:
    x = frame.x(value)
    line = element('path', d=f'M{x:.1f} {TOP}V{HEIGHT - BOTTOM}', class_='grid')
    return joined([line, _text(f'{value:g}', x, HEIGHT - BOTTOM + 13.0, 'middle')])


def _text(content: str, x: float, y: float, anchor: str) -> Markup:
    return element('text', content, x=f'{x:.1f}', y=f'{y:.1f}', text_anchor=anchor)


def _key(name: str, kind: str) -> Markup:
    shown = 'M1 4H25' if kind != 'span' else 'M1 0H25V8H1Z'
    path = element('path', d=shown, class_=kind)
    return element('span', element('svg', path, viewBox='0 0 26 8', aria_hidden='true'), name)


def grid(charts: Iterable[Chart]) -> Markup:
    """Return charts side by side."""
    figures = [chart.figure() for chart in charts]
    if not figures:
        return Markup()
    return element('div', *figures, class_='charts', **GROUP)
