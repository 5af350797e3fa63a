"""
The figures of a foot path and its stance, by the names that requirements use.

`FootPath` refines them for one leg. `SampledPaths` computes them for many candidates at once, to
about 1e-3, from cubics between the samples of whole turns.
"""

from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.kinematics.cubics import periodic_cubics
from klann_ros.kinematics.searches import parabola_peak
import numpy as np

from .path import FootPath, GROUND_BAND
from .stance import narrowest_strips, StanceFigures

# Points of a stance, an odd number.
STANCE_POINTS = 65
BISECTIONS = 24


class _Cubics(NamedTuple):
    """Cubics of t from 0 to 1 in an interval, by coefficient: of t^0 to t^3."""

    c_0: FloatArray
    c_1: FloatArray
    c_2: FloatArray
    c_3: FloatArray

    def ordinate(self, t: FloatArray) -> FloatArray:
        return np.asarray(self.c_0 + t * (self.c_1 + t * (self.c_2 + t * self.c_3)))

    def slope(self, t: FloatArray) -> FloatArray:
        """Return the derivative by t."""
        return np.asarray(self.c_1 + t * (2.0 * self.c_2 + t * 3.0 * self.c_3))


class _Extreme(NamedTuple):
    """An extreme of each of n curves: the interval, t in it, and the ordinate, shape (n,)."""

    interval: IndexArray
    t: FloatArray
    ordinate: FloatArray


class _Coordinate:
    """A coordinate of n closed paths: samples [m] and derivatives [m/rad], shape (n, k)."""

    def __init__(self, samples: FloatArray, slopes: FloatArray) -> None:
        self._samples = samples
        self._slopes = slopes
        self._count = samples.shape[1]
        self._step = TURN / self._count
        self._coefficients = periodic_cubics(samples, self._step * slopes, axis=1)

    def cubics(self, intervals: IndexArray) -> _Cubics:
        """Return the cubics of each path in intervals, shape (n,) or (n, j)."""
        starts = self._count * np.arange(len(intervals))
        if intervals.ndim > 1:
            starts = starts[:, None]
        indices = starts + intervals % self._count
        return _Cubics(*(coefficient.ravel()[indices] for coefficient in self._coefficients))

    def at(self, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return values [m] and derivatives [m/rad] at crank angles [rad], shape (n, j)."""
        intervals = np.floor(angles / self._step)
        t = angles / self._step - intervals
        cubics = self.cubics(intervals.astype(np.intp))
        return cubics.ordinate(t), cubics.slope(t) / self._step

    def extreme(self, sign: float) -> _Extreme:
        """Return the minimum of each path with a sign of 1, the maximum with -1."""
        k = (sign * self._samples).argmin(axis=1)
        # A minimum lies behind a sample with a falling slope.
        falls = sign * self._slopes[np.arange(len(k)), k] < 0.0
        interval = np.where(falls, k, k - 1)
        cubics = self.cubics(interval)
        with np.errstate(all='ignore'):
            discriminant = cubics.c_2 * cubics.c_2 - 3.0 * cubics.c_3 * cubics.c_1
            root = np.sqrt(np.maximum(0.0, discriminant))
            t = cubics.c_1 / -(cubics.c_2 + sign * root)
        t = np.clip(np.where(np.isfinite(t), t, 0.0), 0.0, 1.0)
        return _Extreme(interval, t, cubics.ordinate(t))


class SampledPaths:
    """
    The closed foot paths of n linkages.

    Parameters
    ----------
    h, h_1 : numpy.ndarray, shape (2, n, k)
        The feet [m] and their derivatives [m/rad] at k even crank angles of a turn from 0.

    Attributes
    ----------
    stride, lift, length, lowest : numpy.ndarray, shape (n,)
        The extents along x and y, the lengths, and the heights of the lowest points [m].
    stance : StanceFigures
        The stances with the lowest points.
    rise_speed, fall_speed : numpy.ndarray, shape (n,)
        The greatest dy/dalpha in stance, upwards and downwards, at least 0 [m/rad].

    """

    def __init__(self, h: FloatArray, h_1: FloatArray) -> None:
        self._x = _Coordinate(h[0], h_1[0])
        self._y = _Coordinate(h[1], h_1[1])
        lowest = self._y.extreme(1.0)
        self.lowest = lowest.ordinate
        self.stride = self._x.extreme(-1.0).ordinate - self._x.extreme(1.0).ordinate
        self.lift = self._y.extreme(-1.0).ordinate - self.lowest
        self.length = TURN * np.hypot(*h_1).mean(axis=1)
        start, end = self._stance_ends(h, h_1, lowest)
        width = (end - start)[:, None]
        angles = start[:, None] + width * np.linspace(0.0, 1.0, STANCE_POINTS)
        x, x_1 = self._x.at(angles)
        y, y_1 = self._y.at(angles)
        self._stance_points = x, y
        speed = np.abs(x_1)
        ground_covered = np.abs(x[:, -1] - x[:, 0])
        with np.errstate(all='ignore'):
            self.stance: StanceFigures[FloatArray] = StanceFigures(
                start=start,
                end=end,
                ground_covered=ground_covered,
                deviation=_deviation(x, y, np.hypot(x_1, y_1)),
                speed_mean=ground_covered / (end - start),
                speed_least=-_row_peaks(-speed),
                speed_greatest=_row_peaks(speed),
            )
            self.rise_speed = np.maximum(0.0, _row_peaks(y_1))
            self.fall_speed = np.maximum(0.0, _row_peaks(-y_1))

    def minimax_deviation(self) -> FloatArray:
        """Return half the width of the narrowest strip of each stance, shape (n,) [m]."""
        half_widths, _ = narrowest_strips(*self._stance_points)
        return half_widths

    def heights(self, angles: FloatArray) -> FloatArray:
        """Return y of the feet at a crank angle of each linkage [rad], shape (n,) [m]."""
        y, _ = self._y.at(angles[:, None])
        return np.asarray(y[:, 0])

    def _stance_ends(
        self, h: FloatArray, h_1: FloatArray, lowest: _Extreme
    ) -> tuple[FloatArray, FloatArray]:
        """Return the crank angles where the stances start and end [rad]."""
        sample_count = h.shape[2]
        steps = np.arange(sample_count)
        direction = np.sign(self._x.cubics(lowest.interval).slope(lowest.t))
        level = self.lowest + GROUND_BAND * self.lift
        is_low = h[1] <= level[:, None]
        stands = is_low & (np.sign(h_1[0]) == direction[:, None])

        def end_of_stance(*, forward: bool) -> FloatArray:
            """Return the ends of the stances, or with `forward` False their starts [rad]."""
            order = lowest.interval[:, None] + (1 + steps if forward else -steps)
            in_stance = np.take_along_axis(stands, order % sample_count, axis=1)
            sample_run = np.argmin(in_stance, axis=1)
            interval = lowest.interval + (sample_run if forward else -sample_run)
            inside = np.where(sample_run == 0, lowest.t, 0.0 if forward else 1.0)
            outside = np.full(len(direction), 1.0 if forward else 0.0)
            x_cubics = self._x.cubics(interval)
            y_cubics = self._y.cubics(interval)
            for _ in range(BISECTIONS):
                middle = (inside + outside) / 2.0
                is_backwards = x_cubics.slope(middle) * direction > 0.0
                holds = (y_cubics.ordinate(middle) <= level) & is_backwards
                inside = np.where(holds, middle, inside)
                outside = np.where(holds, outside, middle)
            return np.asarray(TURN / sample_count * (interval + inside))

        return end_of_stance(forward=False), end_of_stance(forward=True)


def path_figures(
    path: FootPath | SampledPaths, stance: StanceFigures[Any], mid_swing_height: Any
) -> dict[str, Any]:
    """
    Return the figures of one path and its stance, or arrays of many, by name.

    `mid_swing_height` is the height of the foot above its lowest point at `stance.mid_swing` [m].
    """
    return {
        'stride': path.stride,
        'lift': path.lift,
        'path_length': path.length,
        'duty_factor': stance.duty_factor,
        'ground_covered': stance.ground_covered,
        'deviation': stance.deviation,
        'straightness': stance.straightness,
        'ripple': stance.ripple,
        'advance': stance.speed_mean,
        'step_height': mid_swing_height,
    }


def _deviation(x: FloatArray, y: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the greatest distance from the line of best fit, weighted by path length."""
    simpson = np.ones(STANCE_POINTS)
    simpson[1:-1:2] = 4.0
    simpson[2:-1:2] = 2.0
    weight = speed * simpson
    weight /= weight.sum(axis=1, keepdims=True)
    x = x - (weight * x).sum(axis=1, keepdims=True)
    y = y - (weight * y).sum(axis=1, keepdims=True)
    moment_xx = (weight * x * x).sum(axis=1)
    moment_yy = (weight * y * y).sum(axis=1)
    moment_xy = (weight * x * y).sum(axis=1)
    angle = np.arctan2(2.0 * moment_xy, moment_xx - moment_yy) / 2.0
    offset = y * np.cos(angle)[:, None] - x * np.sin(angle)[:, None]
    return np.asarray(np.maximum(_row_peaks(offset), _row_peaks(-offset)))


def _row_peaks(curves: FloatArray) -> FloatArray:
    """Return the maximum of each row, by a parabola through three samples."""
    indices = np.arange(len(curves))
    middle = np.clip(curves.argmax(axis=1), 1, curves.shape[1] - 2)
    left = curves[indices, middle - 1]
    right = curves[indices, middle + 1]
    peaks = parabola_peak(left, curves[indices, middle], right)
    return np.asarray(np.maximum(curves.max(axis=1), peaks))
