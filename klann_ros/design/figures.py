"""The figures of a leg: names, units and bounds; in bulk, and as `describe` reports them."""

from math import inf, pi
from typing import Any, NamedTuple, TypeAlias

from klann_ros.datasheet import DataSheet
from klann_ros.kinematics import Linkage, linkage_poses, Variants
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
from klann_ros.kinematics.batch.turn_clearance import driven_clearances
from klann_ros.kinematics.batch.turns import whole_turns
from klann_ros.kinematics.foot.path import GROUND_BAND
from klann_ros.kinematics.searches import parabola_peak
import numpy as np

# Crank angles of a candidate's turn; between them the path is a cubic.
CANDIDATE_ANGLES = 96
# Points of a stance, an odd number.
STANCE_POINTS = 65
BISECTIONS = 24


class FigureKind(NamedTuple):
    """
    A figure that requirements may name.

    `unit` is 'm', 'rad', '' or another SI unit, `least` and `greatest` its bounds. A costly one is
    computed of survivors alone. `needs` is the key of the requirements that defines it.
    """

    text: str
    unit: str = ''
    least: float = 0.0
    greatest: float = inf
    is_costly: bool = False
    needs: str = ''


FIGURES = {
    'stride': FigureKind('extent of the foot path along x', 'm'),
    'lift': FigureKind('extent of the foot path along y', 'm'),
    'path_length': FigureKind('length of the foot path', 'm'),
    'duty_factor': FigureKind('fraction of a turn on the ground', '', 0.0, 1.0),
    'ground_covered': FigureKind('advance of the foot in stance', 'm'),
    'deviation': FigureKind('greatest distance of the stance from a straight line', 'm'),
    'straightness': FigureKind('deviation relative to the ground covered', ''),
    'ripple': FigureKind('(greatest - least) / mean foot speed in stance', ''),
    'advance': FigureKind('mean foot speed in stance, at a crank rate of 1 rad/s', 'm'),
    'step_height': FigureKind('height of the foot at mid-swing', 'm'),
    'transmission_angle': FigureKind('worst, from links in line', 'rad', 0.0, pi / 2.0),
    'ground_clearance': FigureKind('from the ground up to the lowest pivot', 'm', -inf),
    'width': FigureKind('of the bounding box over a turn', 'm'),
    'height': FigureKind('of the bounding box over a turn', 'm'),
    'bar_ratio': FigureKind('longest to shortest bar', '', 1.0),
    'torque_peak': FigureKind('of the crank, the load alone', 'N m', needs='load'),
    'torque_range': FigureKind('greatest - least of the crank torque', 'N m', needs='load'),
    'path_error': FigureKind('rms distance from the path', 'm', needs='path'),
    'margin': FigureKind('relative change of a length until it jams', '', is_costly=True),
    'turning_fraction': FigureKind(
        'of legs within the tolerance', '', 0.0, 1.0, is_costly=True, needs='tolerance'
    ),
    'motor_margin': FigureKind('available to required torque', '', is_costly=True, needs='motor'),
    'speed': FigureKind('of the walker', 'm/s', -inf, is_costly=True, needs='walker'),
    'static_margin': FigureKind('of the walker', 'm', -inf, is_costly=True, needs='walker'),
    'height_variation': FigureKind('of the walker', 'm', is_costly=True, needs='walker'),
}


def crank_angles(count: int) -> FloatArray:
    """Return the crank angles of a turn [rad]."""
    return np.arange(count, dtype=np.float64) * (TURN / count)


class Judgement(NamedTuple):
    """
    Candidates, n of them.

    `jam` is the share of crank angles that a candidate does not reach, plus its lacking clearance
    relative to its crank; 0 if it turns. `figures` by name, shape (n,), NaN if it does not turn.
    `h`, shape (n, k, 2), is the foot [m].
    """

    jam: FloatArray
    figures: dict[str, FloatArray]
    h: FloatArray

    @property
    def turns(self) -> BoolArray:
        """Return whether each turns."""
        return np.equal(self.jam, 0.0)


def judge(variants: Variants, names: frozenset[str], load: float = 0.0) -> Judgement:
    """Return the named figures of candidates; those that are not computed in bulk are left out."""
    has_box = not names.isdisjoint({'width', 'height'})
    turns = whole_turns(variants, CANDIDATE_ANGLES, box=has_box)
    jam = np.where(variants.refused, 2.0, turns.missing)
    if variants.base.two_circles:
        with np.errstate(invalid='ignore'):
            lacking = np.maximum(0.0, -driven_clearances(variants) / variants.base.size)
        jam += np.where(np.isfinite(lacking), np.minimum(lacking, 1.0), 0.0)
    turning = np.flatnonzero(jam == 0.0)
    h, h_1 = (each.take(turning, axis=1) for each in (turns.h, turns.h_1))
    found = _path_figures(h, h_1, load)
    found['transmission_angle'] = turns.transmission_angle[turning]
    numbers, dimensions = variants.numbers[:, turning], variants.base.structure.dimensions
    lengths = numbers[[k for k, d in enumerate(dimensions) if d.kind == 'length']]
    found['bar_ratio'] = lengths.max(axis=0) / lengths.min(axis=0)
    pivots = [k for k, d in enumerate(dimensions) if d.kind == 'y']
    base = numbers[pivots].min(axis=0) if pivots else np.zeros(len(turning))
    found['ground_clearance'] = base - found.pop('lowest')
    if turns.box is not None:
        found['width'], found['height'] = turns.box[:, turning]
    figures = {}
    # In one order, whatever the hashes of names are.
    for name in sorted(names & found.keys()):
        figures[name] = np.full(len(variants), np.nan)
        figures[name][turning] = found[name]
    return Judgement(jam, figures, turns.h.transpose(1, 2, 0))


def sheet_figures(sheet: DataSheet, linkage: Linkage) -> dict[str, float]:
    """Return the figures of a leg's data sheet, as far as it has them."""
    (leg,) = sheet.legs
    found: dict[str, float] = {}
    if leg.path is not None:
        found |= {'stride': leg.path.stride, 'lift': leg.path.lift}
        found['path_length'] = leg.path.length
        own = linkage.dimensions
        pivots = [own[d.name] for d in linkage.structure.dimensions if d.kind == 'y']
        found['ground_clearance'] = min(pivots, default=0.0) - leg.path.y_range[0]
    stance = leg.stance
    if stance is not None and leg.path is not None:
        found |= {
            name: getattr(stance, name)
            for name in ('duty_factor', 'ground_covered', 'deviation', 'straightness', 'ripple')
        }
        found['advance'] = stance.speed_mean
        middle = (stance.start + stance.end + TURN) / 2.0
        at: Any = linkage_poses(linkage, [middle]).h[0, 1]
        found['step_height'] = float(at) - leg.path.y_range[0]
    worst = [each.from_in_line.value for each in leg.transmission]
    found['transmission_angle'] = min(worst, default=0.0)
    found['width'], found['height'] = np.ptp(leg.points, axis=(0, 1)).tolist()
    dimensions = zip(linkage.structure.dimensions, linkage.numbers, strict=True)
    lengths = [number for d, number in dimensions if d.kind == 'length']
    found['bar_ratio'] = max(lengths) / min(lengths)
    margins = [bar.margin for bar in leg.bars if bar.unit == 'm']
    sides = [min(-m.relative[0], m.relative[1]) for m in margins if m is not None]
    if sides:
        found['margin'] = min(sides)
    crank = sheet.cranks[0]
    if crank.loaded is not None:
        torque = crank.loaded.torque
        found['torque_peak'] = crank.loaded.peak
        found['torque_range'] = float(torque.max() - torque.min())
    if crank.motor is not None:
        found['motor_margin'] = crank.motor.margin
    return found


# Paths in bulk: cubics between the samples, as of `foot_path`.


def _path_figures(h: FloatArray, h_1: FloatArray, load: float) -> dict[str, FloatArray]:
    """Return the figures of closed paths and their derivatives, shape (2, n, k)."""
    curves, count = _Curves(h, h_1), h.shape[2]
    step = TURN / count
    (_, _, left), (_, _, right) = curves.extreme(0, least=True), curves.extreme(0, least=False)
    (lowest, at, low), (_, _, high) = curves.extreme(1, least=True), curves.extreme(1, least=False)
    lift, stride = high - low, right - left
    along, _ = curves.cubics(lowest)
    sign = np.sign(_slope(along, at))
    level = low + GROUND_BAND * lift
    inside = (h[1] <= level[:, None]) & (np.sign(h_1[0]) == sign[:, None])

    ends = []
    for forward in (True, False):
        steps = np.arange(count)
        order = lowest[:, None] + (1 + steps if forward else -steps)
        run = np.argmin(np.take_along_axis(inside, order % count, axis=1), axis=1)
        interval = lowest + (run if forward else -run)
        known = np.where(run == 0, at, 0.0 if forward else 1.0)
        away = np.full(len(lift), 1.0 if forward else 0.0)
        along, up = curves.cubics(interval)
        for _ in range(BISECTIONS):
            middle = (known + away) / 2.0
            holds = (_value(up, middle) <= level) & (_slope(along, middle) * sign > 0.0)
            known, away = np.where(holds, middle, known), np.where(holds, away, middle)
        ends.append(step * (interval + known))
    end, start = ends
    t = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, STANCE_POINTS)
    (s_x, v_x), (s_y, v_y) = curves.at(t)
    speed = np.abs(v_x)
    covered = np.abs(s_x[:, -1] - s_x[:, 0])
    duration = end - start
    with np.errstate(all='ignore'):
        mean = covered / duration
        deviation = _deviation(s_x, s_y, np.hypot(v_x, v_y))
        _, (swing, _) = curves.at((start + end + TURN)[:, None] / 2.0)
        found = {
            'stride': stride,
            'lift': lift,
            'lowest': low,
            'path_length': TURN * np.hypot(*h_1).mean(axis=1),
            'duty_factor': duration / TURN,
            'ground_covered': covered,
            'deviation': deviation,
            'straightness': deviation / covered,
            'ripple': (_peak(speed) + _peak(-speed)) / mean,
            'advance': mean,
            'step_height': swing[:, 0] - low,
        }
        top, bottom = np.maximum(0.0, _peak(v_y)), np.maximum(0.0, _peak(-v_y))
        found['torque_peak'] = load * np.maximum(top, bottom)
        found['torque_range'] = load * (top + bottom)
    return found


# Coefficients of t^0 ... t^3.
_Cubics: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


class _Curves:
    """Closed plane curves as cubics between samples, shape (2, n, k), with their derivatives."""

    def __init__(self, values: FloatArray, slopes: FloatArray) -> None:
        self._values, self._slopes = values, slopes
        self._count = values.shape[2]

    def cubics(self, intervals: IndexArray) -> list[_Cubics]:
        """Return the cubics of x and y in intervals, shape (n,) or (n, j), by the part of them."""
        starts = self._count * np.arange(len(intervals))
        starts = starts[:, None] if intervals.ndim > 1 else starts
        at, after = (starts + (intervals + k) % self._count for k in (0, 1))
        step, found = TURN / self._count, []
        for values, slopes in zip(self._values, self._slopes, strict=True):
            p, q = values.ravel()[at], values.ravel()[after]
            m, n = step * slopes.ravel()[at], step * slopes.ravel()[after]
            found.append((p, m, 3.0 * (q - p) - 2.0 * m - n, 2.0 * (p - q) + m + n))
        return found

    def at(self, angles: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return x and y at angles, shape (n, j), and the derivatives by the angle of each."""
        step = TURN / self._count
        places = np.floor(angles / step)
        t = angles / step - places
        each = self.cubics(places.astype(np.intp))
        return [(_value(cubics, t), _slope(cubics, t) / step) for cubics in each]

    def extreme(self, axis: int, *, least: bool) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Return interval, part of it and value of the least or greatest x or y, shape (n,)."""
        sign = 1.0 if least else -1.0
        k = (sign * self._values[axis]).argmin(axis=1)
        # A minimum lies behind a sample with a falling slope.
        falls = sign * self._slopes[axis][np.arange(len(k)), k] < 0.0
        interval = np.where(falls, k, k - 1)
        cubics = self.cubics(interval)[axis]
        _, m, b, a = cubics
        with np.errstate(all='ignore'):
            root = np.sqrt(np.maximum(0.0, b * b - 3.0 * a * m))
            t = m / -(b + sign * root)
        t = np.clip(np.where(np.isfinite(t), t, 0.0), 0.0, 1.0)
        return interval, t, _value(cubics, t)


def _value(cubics: _Cubics, t: FloatArray) -> FloatArray:
    p, m, b, a = cubics
    return np.asarray(p + t * (m + t * (b + t * a)))


def _slope(cubics: _Cubics, t: FloatArray) -> FloatArray:
    """Return the derivative by the part of the interval."""
    _, m, b, a = cubics
    return np.asarray(m + t * (2.0 * b + t * 3.0 * a))


def _deviation(x: FloatArray, y: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the greatest distance from the line of best fit, weighted by path length."""
    simpson = np.ones(STANCE_POINTS)
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    weight = speed * simpson
    weight /= weight.sum(axis=1, keepdims=True)
    x, y = (v - (weight * v).sum(axis=1, keepdims=True) for v in (x, y))
    xx, yy, xy = ((weight * a * b).sum(axis=1) for a, b in ((x, x), (y, y), (x, y)))
    angle = np.arctan2(2.0 * xy, xx - yy) / 2.0
    offset = y * np.cos(angle)[:, None] - x * np.sin(angle)[:, None]
    return np.asarray(np.maximum(_peak(offset), _peak(-offset)))


def _peak(values: FloatArray) -> Any:
    """Return the greatest value of each row, by a parabola through three points."""
    k = np.clip(values.argmax(axis=1), 1, values.shape[1] - 2)
    rows = np.arange(len(values))
    before, own, after = (values[rows, k + d] for d in (-1, 0, 1))
    return np.maximum(values.max(axis=1), parabola_peak(before, own, after))
