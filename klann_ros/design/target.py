"""The path that a foot is to follow: from points, CSV or SVG; the distance of paths from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
import re
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE
import numpy as np

# Points by which paths are compared, evenly along them, a power of two.
PATH_POINTS = 128
# Points on each curve of an SVG path.
CURVE_POINTS = 24
# Newton steps to the best shift between whole points.
SHIFT_STEPS = 3
MAX_TARGET_POINTS = 10_000
# An SVG file has 96 px to an inch; y points down.
PIXEL = 0.0254 / 96.0


class PathFit(NamedTuple):
    """
    Rotation, scale and translation that bring paths nearest to the target, z -> factor z + shift.

    Shapes (n,); `error` is the rms distance of corresponding points [m].
    """

    error: FloatArray
    factor: ComplexArray
    shift: ComplexArray


@dataclass(frozen=True, eq=False)
class Target:
    """
    A closed path.

    Attributes
    ----------
    points : numpy.ndarray of complex, shape (k,)
        In the order of travel [m].
    can_move, can_turn, can_scale : bool
        Whether legs may be moved, turned and scaled onto it.
    is_timed : bool
        Whether the points are at equal steps of the crank.

    """

    points: ComplexArray
    can_move: bool = True
    can_turn: bool = True
    can_scale: bool = True
    is_timed: bool = False

    @property
    def size(self) -> float:
        """Return the diagonal of its bounding box [m]."""
        return float(np.hypot(np.ptp(self.points.real), np.ptp(self.points.imag)))

    def fit(self, h: FloatArray) -> PathFit:
        """Return the best fit of closed paths at equal steps of the crank, shape (n, k, 2)."""
        w = resampled(h[..., 0] + 1j * h[..., 1], by_length=not self.is_timed)
        z = resampled(self.points[None], by_length=not self.is_timed)[0]
        z_mean = z.mean() if self.can_move else 0.0
        w_mean = w.mean(axis=1) if self.can_move else np.zeros(len(w))
        z = z - z_mean
        w = w - w_mean[:, None]
        z_square = (np.abs(z) ** 2).sum()
        w_square = (np.abs(w) ** 2).sum(axis=1)
        spectrum = np.fft.fft(z)
        best_error = np.full(len(w), np.inf)
        best_factor = np.zeros(len(w), dtype=np.complex128)
        # Both directions of travel.
        for path in (w, w[:, ::-1]):
            correlation = self._correlation(np.conj(np.fft.fft(path)) * spectrum)
            with np.errstate(all='ignore'):
                factor = self._factor(correlation, w_square)
            overlap = (np.conj(factor) * correlation).real
            error = z_square + np.abs(factor) ** 2 * w_square - 2.0 * overlap
            is_better = error < best_error
            best_error = np.where(is_better, error, best_error)
            best_factor = np.where(is_better, factor, best_factor)
        rms = np.sqrt(np.maximum(0.0, best_error) / PATH_POINTS)
        shift = np.asarray(z_mean - best_factor * w_mean, dtype=np.complex128)
        return PathFit(rms, best_factor, shift)

    def distance(self, h: FloatArray) -> float:
        """Return the rms distance of one path, shape (k, 2), that stays where it is [m]."""
        fixed = replace(self, can_move=False, can_turn=False, can_scale=False)
        return float(fixed.fit(h[None]).error[0])

    def _correlation(self, product: ComplexArray) -> ComplexArray:
        """
        Return the greatest c_s = sum_k conj(w_k) z_(k+s) over the shifts s, shape (n,).

        `product` is its spectrum. All whole shifts are tried, and the best one is refined.
        """
        count = product.shape[1]
        c = np.fft.ifft(product)
        shift = np.argmax(np.abs(c) if self.can_turn else c.real, axis=1).astype(np.float64)
        rates = 2j * np.pi * np.fft.fftfreq(count)
        for step in range(SHIFT_STEPS + 1):
            terms = product * np.exp(rates * shift[:, None]) / count
            c_0 = terms.sum(axis=1)
            c_1 = (terms * rates).sum(axis=1)
            c_2 = (terms * rates**2).sum(axis=1)
            if step == SHIFT_STEPS:
                break
            slope = c_1.real
            bend = c_2.real
            if self.can_turn:
                slope = (np.conj(c_0) * c_1).real
                bend = np.abs(c_1) ** 2 + (np.conj(c_0) * c_2).real
            with np.errstate(all='ignore'):
                newton_step = np.where(bend < 0.0, -slope / bend, 0.0)
            shift += np.clip(newton_step, -0.5, 0.5)
        return np.asarray(c_0, dtype=np.complex128)

    def _factor(self, c: ComplexArray, w_square: FloatArray) -> ComplexArray:
        """Return the best rotation and scale from the correlation of two paths."""
        if self.can_turn and self.can_scale:
            return np.asarray(c / w_square, dtype=np.complex128)
        if self.can_turn:
            return np.asarray(c / np.abs(c), dtype=np.complex128)
        if self.can_scale:
            return np.asarray(np.maximum(0.0, c.real) / w_square + 0j, dtype=np.complex128)
        return np.ones(len(c), dtype=np.complex128)


def resampled(z: ComplexArray, *, by_length: bool) -> ComplexArray:
    """Return closed polygons, shape (n, k), at `PATH_POINTS` even steps."""
    closed = np.concatenate([z, z[:, :1]], axis=1)
    count = z.shape[1]
    if by_length:
        along = np.zeros(closed.shape)
        np.cumsum(np.abs(np.diff(closed, axis=1)), axis=1, out=along[:, 1:])
        total = along[:, -1:]
        along /= np.where(total > 0.0, total, 1.0)
    else:
        along = np.broadcast_to(np.linspace(0.0, 1.0, count + 1), closed.shape)
    positions = np.arange(PATH_POINTS) / PATH_POINTS
    # The rows side by side: one search for all.
    offsets = 2.0 * np.arange(len(z))[:, None]
    index = np.searchsorted((along + offsets).ravel(), (positions + offsets).ravel(), side='right')
    index = (index - 1).reshape(len(z), PATH_POINTS) - (count + 1) * np.arange(len(z))[:, None]
    index = np.clip(index, 0, count - 1)
    low = np.take_along_axis(along, index, axis=1)
    high = np.take_along_axis(along, index + 1, axis=1)
    start = np.take_along_axis(closed, index, axis=1)
    end = np.take_along_axis(closed, index + 1, axis=1)
    with np.errstate(all='ignore'):
        share = np.where(high > low, (positions - low) / (high - low), 0.0)
    return np.asarray(start + share * (end - start))


def target_from(content: Mapping[str, Any], metre: float, folder: Path) -> Target:
    """
    Return the target of the key `path` of requirements, in units of `metre`.

    Raises
    ------
    OSError, ValueError
        Its file cannot be read, or it has no points.

    """
    if ('points' in content) == ('file' in content):
        raise ValueError('either points or file must be there')
    if 'points' in content:
        points = np.array(content['points'], dtype=np.float64) @ (1.0, 1j)
        unit = metre
    else:
        name = content['file']
        path = folder / name if (folder / name).is_file() else Path(name)
        text = read_regular(path, MAX_FILE_SIZE)
        is_svg = path.suffix.lower() == '.svg'
        points = _svg_points(text) if is_svg else _csv_points(text)
        unit = PIXEL if is_svg else metre
    if len(points) > 3 and points[0] == points[-1]:
        points = points[:-1]
    if not 3 <= len(points) <= MAX_TARGET_POINTS:
        raise ValueError(f'{len(points)} points: there must be 3 to {MAX_TARGET_POINTS}')
    if not np.isfinite(points).all():
        raise ValueError('a point is not finite')
    target = Target(
        np.asarray(unit * points, dtype=np.complex128),
        can_move=content.get('move', True),
        can_turn=content.get('turn', True),
        can_scale=content.get('scale', True),
        is_timed=content.get('timing', 'free') == 'prescribed',
    )
    if not target.size > 0.0:
        raise ValueError('all points are one')
    return target


def _csv_points(text: str) -> ComplexArray:
    """Return the first two columns of a CSV; a heading is skipped, decimal commas are read."""
    points: list[complex] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        # With semicolons or tabs a comma is that of a decimal.
        cells = re.split(r'[;\t]', line) if re.search(r'[;\t]', line) else line.split(',')
        try:
            x, y = map(_decimal, cells[:2])
        except ValueError:
            if not points and number == 1:
                continue
            raise ValueError(
                f'line {number}: {printable(line, 60)} must begin with two numbers, x and y'
            ) from None
        points.append(complex(x, y))
    return np.array(points, dtype=np.complex128)


def _decimal(cell: str) -> float:
    return float(cell.strip().replace(',', '.'))


def _svg_points(text: str) -> ComplexArray:
    """Return the first path of an SVG file, y up, without the transforms of its groups."""
    # Not parsed as XML, whose entities can grow without bound.
    for attributes in re.findall(r'<path\b([^>]*)', text):
        if data := re.search(r'\sd\s*=\s*(?:"([^"]*)"|\'([^\']*)\')', attributes):
            points = _svg_path(data[1] or data[2] or '')
            return np.conj(np.array(points, dtype=np.complex128))
    raise ValueError('the SVG has no path')


def _svg_path(d: str) -> list[complex]:
    """Return the points of the first part of a path's data; text that is none is a ValueError."""
    from fontTools.pens.recordingPen import RecordingPen  # noqa: PLC0415 - an extra
    from fontTools.svgLib.path import parse_path  # noqa: PLC0415

    pen = RecordingPen()
    points: list[complex] = []
    try:
        parse_path(d, pen)
    except ValueError as error:
        raise ValueError(f'the path of the SVG: {printable_line(str(error)[:100])}') from None
    for operation, corners in pen.value:
        ends = [complex(*corner) for corner in corners]
        if operation == 'moveTo':
            points = ends
        elif ends:
            points += _bezier([points[-1], *ends]) if len(ends) > 1 else ends
        elif len(points) > 1:
            break
    return points


def _bezier(corners: Sequence[complex]) -> list[complex]:
    """Return points on a Bezier curve behind its start."""
    t = np.linspace(0.0, 1.0, CURVE_POINTS + 1)[1:]
    layer = [np.full(len(t), corner) for corner in corners]
    # Points that are not finite, or beyond all floats, are refused with all others.
    with np.errstate(all='ignore'):
        while len(layer) > 1:
            layer = [a + t * (b - a) for a, b in pairwise(layer)]
    return list(map(complex, layer[0].tolist()))
