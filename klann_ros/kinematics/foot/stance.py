"""
The stance: the arcs of the crank over which the foot is on the ground.

The ground is level, at the foot's lowest point. The foot is in contact while H is within a band
above that point and moves backwards: in its direction along x at the lowest point.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, pi
from typing import Generic, NamedTuple, TypeVar

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray, FloatArray
from klann_ros.kinematics.errors import KinematicsError
import numpy as np

from .inverse import monotone_intervals, parameters_at, slope_range, turning_points
from .track import Coordinate, gauss_nodes, Track, X, Y

# A figure of one stance, or of many.
Number = TypeVar('Number', float, FloatArray)

# Panels of the quadrature over a stance, 8 nodes each.
PANELS = 24
# Strips of a stance: each holds the extremes that the one before it left out.
EXCHANGES = 4
# Angles of a strip: of the first grid over half a turn, of each later one, a quarter as wide, and
# the last step [rad].
GRID_ANGLES, ZOOM_ANGLES, MIN_STEP = 33, 9, 1e-10


@dataclass(eq=False, repr=False)
class NoStanceError(KinematicsError):
    """A foot that does not move along x; `stride` is the path's extent along x [m]."""

    stride: float

    def __str__(self) -> str:
        return f'there is no stance: the foot does not move along x (stride {self.stride:.3g})'


@dataclass(frozen=True, kw_only=True)
class StanceFigures(Generic[Number]):
    """The figures of a stance, or arrays for many; `Stance` describes the fields."""

    start: Number
    end: Number
    ground_covered: Number
    deviation: Number
    speed_mean: Number
    speed_least: Number
    speed_greatest: Number
    period: float = TURN

    @property
    def duty_factor(self) -> Number:
        """Return the fraction of a period in contact with the ground."""
        return (self.end - self.start) / self.period

    @property
    def mid_swing(self) -> Number:
        """Return the crank angle halfway between the end and the next start [rad]."""
        return (self.start + self.end + self.period) / 2.0

    @property
    def straightness(self) -> Number:
        """Return the deviation relative to the ground covered; 0 is straight."""
        return _ratio(self.deviation, self.ground_covered)

    @property
    def ripple(self) -> Number:
        """Return (greatest - least) / mean of the speed; 0 is even."""
        return _ratio(self.speed_greatest - self.speed_least, self.speed_mean)


def _ratio(numerator: Number, denominator: Number) -> Number:
    """Return a ratio; infinite, and NaN in an array for 0 / 0, where the denominator is 0."""
    if isinstance(denominator, float):
        return numerator / denominator if denominator else inf
    with np.errstate(divide='ignore', invalid='ignore'):
        return numerator / denominator


@dataclass(frozen=True, kw_only=True)
class Stance(StanceFigures[float]):
    """
    One arc of the crank over which the foot is on the ground.

    Attributes
    ----------
    start, end : float
        Crank angles, start in [0, period), start < end [rad].
    period : float
        The crank's rotation after which the foot is back: a turn, or several of a linkage with
        change points, whose crank angles count with their turns [rad].
    direction : int
        The sign of dx/dalpha.
    ground : float
        Height of the band above the lowest point [m].
    ground_covered : float
        Distance that the foot moves along x [m].
    deviation : float
        The greatest distance of the foot from the straight line of best fit: least squares of the
        distances, weighted by path length [m].
    minimax_deviation : float
        The greatest distance from the best line: half the width of the narrowest strip [m].
    speed_mean, speed_least, speed_greatest : float
        `|dx/dalpha|` [m/rad]. The least is 0 if the foot reverses at an end of the stance, the
        greatest infinite at an end of the crank's arc.
    duty_factor : float
        The fraction of a period in contact with the ground.
    mid_swing : float
        The crank angle halfway between the end and the next start [rad].
    straightness : float
        The deviation relative to the ground covered; 0 is straight.
    ripple : float
        (greatest - least) / mean of the speed; 0 is even.

    """

    direction: int
    ground: float
    minimax_deviation: float

    def holds(self, alphas: FloatArray) -> BoolArray:
        """Return whether the foot is on the ground at crank angles [rad]."""
        return np.asarray((alphas - self.start) % self.period <= self.end - self.start)

    def speed(self, alpha_rate: float) -> float:
        """
        Return the mean velocity of the body along x, opposite to the foot's [m/s].

        Parameters
        ----------
        alpha_rate : float
            Rate of the crank [rad/s].

        """
        return -self.direction * self.speed_mean * alpha_rate


class _Contact(NamedTuple):
    """An interval of a track within the band on which x is monotone, with the sign of dx/dt."""

    track: Track
    t_0: float
    t_1: float
    sign: int
    holds_lowest: bool


def stances(tracks: Sequence[Track], ground: float, rounding: float) -> list[Stance]:
    """Return the stances of a band above the lowest point [m], the stance of that point first."""
    ends: list[tuple[float, int, float]] = []
    for k, track in enumerate(tracks):
        for t_0, t_1, y_0, y_1 in monotone_intervals(track, Y):
            ends += [(y_0, k, t_0), (y_1, k, t_1)]
    min_y, lowest_track, lowest_t = min(ends)
    contacts: list[_Contact] = []
    for k, track in enumerate(tracks):
        t = lowest_t if k == lowest_track else None
        contacts += _contacts(track, min_y + ground, rounding, t)
    lowest = max(contacts, key=lambda contact: (contact.holds_lowest, abs(_advance(contact))))
    on_ground = _join_adjacent([contact for contact in contacts if contact.sign == lowest.sign])
    on_ground.sort(key=lambda contact: not contact.holds_lowest)
    return [_stance(contact, ground) for contact in on_ground]


def _contacts(track: Track, level: float, rounding: float, lowest: float | None) -> list[_Contact]:
    """Return the contacts below a level; `lowest` is t of the lowest point on this track."""
    ends = {*turning_points(track, X), *parameters_at(track, Y, level, rounding)}
    if track.span.is_turn:
        edges = sorted({t % pi for t in ends}) or [0.0]
        edges.append(edges[0] + pi)
    else:
        edges = sorted({*ends, float(track.t[0]), float(track.t[-1])})
    # A turn is periodic in t.
    periods = (-pi, 0.0, pi) if track.span.is_turn else (0.0,)
    contacts = []
    for t_0, t_1 in pairwise(edges):
        holds = lowest is not None and any(t_0 <= lowest + period <= t_1 for period in periods)
        # The interval of the lowest point is in contact, whatever the rounding at its middle.
        if holds or track.value(Y, (t_0 + t_1) / 2.0) <= level:
            advance = track.value(X, t_1) - track.value(X, t_0)
            contacts.append(_Contact(track, t_0, t_1, 1 if advance > 0.0 else -1, holds))
    return contacts


def _advance(contact: _Contact) -> float:
    """Return the motion of the foot along x [m]."""
    return contact.track.value(X, contact.t_1) - contact.track.value(X, contact.t_0)


def _join_adjacent(contacts: list[_Contact]) -> list[_Contact]:
    """Join adjacent intervals: a path that only touches the band's edge does not leave it."""
    joined: list[_Contact] = []
    for contact in contacts:
        last = joined[-1] if joined else None
        if last and last.track is contact.track and last.t_1 == contact.t_0:
            holds = last.holds_lowest or contact.holds_lowest
            joined[-1] = last._replace(t_1=contact.t_1, holds_lowest=holds)
        else:
            joined.append(contact)
    if len(joined) > 1 and joined[0].track.span.is_turn:
        first = joined[0]
        last = joined[-1]
        if last.t_1 == first.t_0 + pi:
            holds = first.holds_lowest or last.holds_lowest
            across_start = last._replace(t_1=first.t_1 + pi, holds_lowest=holds)
            joined = [*joined[1:-1], across_start]
    return joined


def _stance(contact: _Contact, ground: float) -> Stance:
    """Return the figures of a contact as a stance."""
    track, t_0, t_1, sign, _ = contact
    start = track.span.alpha(t_0)
    duration = track.span.alpha(t_1) - start
    period = max(TURN, track.span.end - track.span.start)
    ground_covered = abs(_advance(contact))
    min_speed, max_speed = slope_range(track, X, t_0, t_1)
    return Stance(
        start=start % period,
        end=start % period + duration,
        period=period,
        direction=sign,
        ground=ground,
        ground_covered=ground_covered,
        deviation=_deviation(track, t_0, t_1),
        minimax_deviation=_minimax_deviation(track, t_0, t_1),
        speed_mean=ground_covered / duration,
        speed_least=min_speed,
        speed_greatest=max_speed,
    )


def _deviation(track: Track, t_0: float, t_1: float) -> float:
    """Return the greatest distance from the line through the centre along the main axis [m]."""
    h, h_t, weights = gauss_nodes(track, t_0, t_1, PANELS)
    lengths = np.hypot(*h_t.T) * weights
    centre = lengths @ h / lengths.sum()
    _, axes = np.linalg.eigh(((h - centre).T * lengths) @ (h - centre))
    normal = Coordinate((float(axes[0, 0]), float(axes[1, 0])))
    centre_offset = float(normal.derivative(centre))
    extremes = _extremes(track, normal, t_0, t_1)
    return max(abs(track.value(normal, t) - centre_offset) for t in extremes)


def _minimax_deviation(track: Track, t_0: float, t_1: float) -> float:
    """Return half the width of the narrowest strip [m], by an exchange of its extremes."""
    points, _, _ = gauss_nodes(track, t_0, t_1, PANELS)
    half_width = angle = np.zeros(1)
    for _ in range(EXCHANGES):
        half_width, angle = narrowest_strips(points[None, :, 0], points[None, :, 1])
        normal = Coordinate((-float(np.sin(angle[0])), float(np.cos(angle[0]))))
        extremes = _extremes(track, normal, t_0, t_1)
        added = [(track.value(X, t), track.value(Y, t)) for t in extremes]
        points = np.concatenate([points, added])
    return float(half_width[0])


def _extremes(track: Track, normal: Coordinate, t_0: float, t_1: float) -> list[float]:
    """Return the ends of an interval, and the turning points of a coordinate in it."""
    turning = turning_points(track, normal)
    return [t for t in (t_0, t_1, *turning, *(t + pi for t in turning)) if t_0 <= t <= t_1]


def narrowest_strips(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return half the width of the narrowest strip of each row of points [m], and its angle."""
    rows = np.arange(len(x))
    angles = np.zeros((len(x), 1))
    step = np.pi / (GRID_ANGLES - 1)
    offsets = np.linspace(-np.pi / 2.0, np.pi / 2.0, GRID_ANGLES)
    while step > MIN_STEP:
        trials = angles + offsets
        heights = np.cos(trials)[..., None] * y[:, None] - np.sin(trials)[..., None] * x[:, None]
        widths = np.ptp(heights, axis=2)
        best = widths.argmin(axis=1)
        angles = trials[rows, best][:, None]
        offsets = np.linspace(-step, step, ZOOM_ANGLES)
        step /= (ZOOM_ANGLES - 1) / 2.0
    return widths[rows, best] / 2.0, angles[:, 0]
