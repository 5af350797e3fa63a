"""The path that a foot is to follow: from points, CSV or SVG; the distance of paths from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
import re
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE
import numpy as np

# Points by which paths are compared, evenly along them, a power of two.
PATH_POINTS = 128
# Points on each curve of an SVG path.
CURVE_POINTS = 24
# Points of a smooth curve, in all and between two given ones.
MIN_CURVE_POINTS, POINTS_PER_SPAN = 4096, 8
# Half-widths of the parabolas that refine a shift, in steps of the grid.
PARABOLA_WIDTHS = np.array([0.5, 0.06, 0.008])
MAX_TARGET_POINTS = 10_000
# An SVG file has 96 px to an inch; y points down.
PIXEL = 0.0254 / 96.0


class PathFit(NamedTuple):
    """
    Rotation, scale and translation that bring paths nearest to the target, z -> factor z + shift.

    Shapes (n,); `error` is the rms distance of corresponding points [m]. Sample k of the target
    corresponds to the point at `offset` + `sense` k / (number of samples) of the path, a fraction
    of its period: of the turn with timing, of the path's length without.
    """

    error: FloatArray
    factor: ComplexArray
    shift: ComplexArray
    offset: FloatArray
    sense: FloatArray


@dataclass(frozen=True, eq=False)
class Target:
    """A closed path."""

    # Points in the order of travel, shape (k,) [m].
    points: ComplexArray
    # Whether legs may be moved, turned and scaled onto it.
    can_move: bool = True
    can_turn: bool = True
    can_scale: bool = True
    # Whether the points are at equal steps of the crank.
    is_timed: bool = False
    # Whether straight lines join the points, not a smooth curve.
    has_corners: bool = False

    @property
    def fixed(self) -> 'Target':
        """Return the path for legs that stay where they are."""
        return replace(self, can_move=False, can_turn=False, can_scale=False)

    @property
    def size(self) -> float:
        """Return the diagonal of its bounding box [m]."""
        return float(np.hypot(np.ptp(self.points.real), np.ptp(self.points.imag)))

    @cached_property
    def samples(self) -> ComplexArray:
        """Return the points that are compared [m]: those given, or even ones along the curve."""
        if self.is_timed:
            return self.points
        curve = self.points if self.has_corners else smooth_curve(self.points)
        (samples,) = resampled(curve[None])
        return np.asarray(samples, dtype=np.complex128)

    def fit(self, h: FloatArray) -> PathFit:
        """Return the best fit of closed paths at equal steps of the crank, shape (n, k, 2)."""
        w = h[..., 0] + 1j * h[..., 1]
        count = w.shape[1]
        if not self.is_timed:
            finer_count = count * -(-PATH_POINTS // count)
            harmonics = with_bins(np.fft.fft(w), finer_count)
            w = resampled(np.fft.ifft(harmonics) * (finer_count / count))
        return self._fit_harmonics(np.fft.fft(w) / w.shape[1])

    def _fit_harmonics(self, harmonics: ComplexArray) -> PathFit:
        """
        Return the best fit of w(t) = sum_m W_m exp(i m t), from W of shape (n, k).

        The points w(t + 2 pi j / n) that correspond to n samples have the harmonics V_j(t), the
        sum of W_m exp(i m t) over all m = j modulo n. The best t of a grid is refined by parabolas
        through three errors.
        """
        samples = self.samples
        z_mean = samples.mean() if self.can_move else 0j
        sample_harmonics = np.fft.fft(samples - z_mean) / len(samples)
        # Harmonics of the path that fold into each of few samples.
        folds = -(-harmonics.shape[1] // len(samples))
        folded_count = len(samples) if folds > 1 else harmonics.shape[1]
        bin_count = folds * folded_count
        z = with_bins(sample_harmonics[None], folded_count)[0]
        forwards = with_bins(harmonics, bin_count)
        backwards = np.roll(forwards[:, ::-1], 1, axis=1)
        w = np.stack([forwards, backwards])
        paths = np.fft.ifft(w) * bin_count
        groups = paths.reshape(*paths.shape[:2], folded_count, folds)
        repetitions = (1, 1, folded_count)
        squares, _ = self._transform(
            np.tile(groups.mean(axis=2), repetitions),
            np.fft.fft(np.conj(w) * np.tile(z, folds)),
            np.tile((np.abs(groups) ** 2).mean(axis=2), repetitions),
        )
        squares = squares.transpose(1, 0, 2).reshape(len(harmonics), 2 * bin_count)
        best = np.argmin(np.nan_to_num(squares, nan=np.inf), axis=1)
        direction = best // bin_count
        w = w[direction, np.arange(len(harmonics))]
        frequencies = np.fft.fftfreq(bin_count, 1.0 / bin_count)
        t = (best % bin_count) * (TURN / bin_count)

        def transform(turned: ComplexArray) -> tuple[FloatArray, ComplexArray, ComplexArray]:
            v = turned.reshape(-1, folds, folded_count).sum(axis=1)
            mean = v[:, 0]
            square, factor = self._transform(mean, np.conj(v) @ z, (np.abs(v) ** 2).sum(axis=1))
            return square, factor, mean

        for width in (TURN / bin_count) * PARABOLA_WIDTHS:
            turned = w * np.exp(1j * frequencies * t[:, None])
            turn = np.exp(1j * frequencies * width)
            before = transform(turned * np.conj(turn))[0]
            middle = transform(turned)[0]
            after = transform(turned * turn)[0]
            bend = before + after - 2.0 * middle
            with np.errstate(all='ignore'):
                step = np.where(bend > 0.0, 0.5 * (before - after) / bend, 0.0)
            t = t + width * np.clip(step, -2.0, 2.0)
        square, factor, mean = transform(w * np.exp(1j * frequencies * t[:, None]))
        square = square + (np.abs(samples - z_mean) ** 2).mean()
        shift = z_mean - factor * mean if self.can_move else np.zeros_like(mean)
        sense = 1.0 - 2.0 * direction
        error = np.sqrt(np.maximum(0.0, square))
        return PathFit(error, factor, shift, sense * t / TURN, sense)

    def _transform(
        self, mean: ComplexArray, overlap: ComplexArray, square: FloatArray
    ) -> tuple[FloatArray, ComplexArray]:
        """
        Return the least mean square distances, less that of the target, and their factors.

        Of paths w with the mean overlap conj(w) z with the target and the mean square |w|^2.
        """
        if self.can_move:
            square = square - np.abs(mean) ** 2
        with np.errstate(all='ignore'):
            factor = self._factor(overlap, square)
            distance = np.abs(factor) ** 2 * square - 2.0 * (np.conj(factor) * overlap).real
        return distance, factor

    def _factor(self, c: ComplexArray, w_square: FloatArray) -> ComplexArray:
        """Return the best rotation and scale from the overlap of two paths."""
        if self.can_turn and self.can_scale:
            return np.asarray(c / w_square, dtype=np.complex128)
        if self.can_turn:
            return np.asarray(c / np.abs(c), dtype=np.complex128)
        if self.can_scale:
            return np.asarray(np.maximum(0.0, c.real) / w_square + 0j, dtype=np.complex128)
        return np.ones(c.shape, dtype=np.complex128)


def with_bins(harmonics: ComplexArray, count: int) -> ComplexArray:
    """Return spectra, shape (n, k), with another number of bins: high ones are 0 or left out."""
    low_count = min(harmonics.shape[1], count)
    positive = (low_count + 1) // 2
    negative = low_count // 2
    bins = np.zeros((len(harmonics), count), dtype=np.complex128)
    bins[:, :positive] = harmonics[:, :positive]
    if negative:
        bins[:, -negative:] = harmonics[:, -negative:]
    return bins


def smooth_curve(points: ComplexArray) -> ComplexArray:
    """
    Return dense points of the smooth closed curve through points: a periodic cubic spline.

    Its parameter is centripetal, the sum of the square roots of the chords: of uneven points it
    neither overshoots (as equal steps do) nor flattens (as chords do).
    """
    # It takes half a second to load.
    from scipy.interpolate import CubicSpline  # noqa: PLC0415

    closed = np.append(points, points[0])
    steps = np.sqrt(np.abs(np.diff(closed)))
    is_distinct = np.append(True, steps > 0.0)
    knots = np.append(0.0, np.cumsum(steps))[is_distinct]
    spline = CubicSpline(knots, closed[is_distinct], bc_type='periodic')
    count = max(MIN_CURVE_POINTS, POINTS_PER_SPAN * len(points))
    return np.asarray(spline(np.arange(count) * (knots[-1] / count)), dtype=np.complex128)


def resampled(z: ComplexArray) -> ComplexArray:
    """Return closed polygons, shape (n, k), at `PATH_POINTS` even steps of their lengths."""
    closed = np.concatenate([z, z[:, :1]], axis=1)
    lengths = np.zeros(closed.shape)
    np.cumsum(np.abs(np.diff(closed, axis=1)), axis=1, out=lengths[:, 1:])
    fractions = np.arange(PATH_POINTS) / PATH_POINTS
    samples = np.empty((len(z), PATH_POINTS), dtype=np.complex128)
    for n, row_lengths in enumerate(lengths):
        samples[n] = np.interp(fractions * row_lengths[-1], row_lengths, closed[n])
    return samples


def target_from(content: Mapping[str, Any], metre: float, folder: Path) -> Target:
    """
    Return the target of the key `path` of requirements, in units of `metre`.

    Raises an OSError or a ValueError if its file cannot be read or it has no points.
    """
    if ('points' in content) == ('file' in content):
        raise ValueError('either points or file must be there')
    is_svg = False
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
        # The lines of a drawing are its own.
        has_corners=content.get('corners', is_svg),
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
            x, y = (float(cell.strip().replace(',', '.')) for cell in cells[:2])
        except ValueError:
            if not points and number == 1:
                continue
            raise ValueError(
                f'line {number}: {printable(line, 60)} must begin with two numbers, x and y'
            ) from None
        points.append(complex(x, y))
    return np.array(points, dtype=np.complex128)


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
    except IndexError:  # of fontTools 4.46
        raise ValueError('the path of the SVG: Not enough coordinates') from None
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
