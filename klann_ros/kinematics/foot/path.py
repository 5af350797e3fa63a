"""The foot path over all reachable crank angles."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nan, pi
from numbers import Real
from typing import Any

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.kinematics.linkage.leg import LinkageLeg
from klann_ros.kinematics.linkage.linkage import as_linkage, Linkage
from klann_ros.kinematics.svg import path_svg
import numpy as np

from . import inverse
from .inverse import monotone_intervals, Nearest, ROUNDING
from .stance import NoStanceError, Stance, stances
from .track import Coordinate, gauss_nodes, GAUSS_ORDER, Span, Track, X, Y

# Height of the contact band relative to the lift. Between their two lowest points the feet of both
# known legs rise by a fifteenth (SEM 104) and a tenth (patent) of their lift.
GROUND_BAND = 1.0 / 8.0
# Round-off of a height or a width relative to the leg's size: over a turn, and over arcs, at whose
# ends the last digit of the crank angle moves the foot.
ROUNDING_OF_TURN = 1e-12
ROUNDING_OF_ARCS = 1e-8
MIN_SAMPLES = 32
LEG_METHODS = ('solve', 'velocity', 'acceleration', 'reset', 'reachable_arcs')


class NoFootPathError(KinematicsError):
    """A leg without any reachable crank angle."""

    def __str__(self) -> str:
        return 'there is no foot path: the leg reaches no crank angle'


@with_short_repr
@dataclass(frozen=True, eq=False)
class FootPath:
    """
    The path of the foot H, made by `foot_path`: samples, and figures refined between them.

    `alphas`, shape (n,), are the crank angles of all arcs; each ascends, beyond 2 pi where an arc
    crosses it [rad]. `h` is H [m] and `h_1` dH/dalpha [m/rad], shape (n, 2); the latter is NaN at
    singular poses, such as the ends of arcs. `arcs` are start and end of each reachable arc [rad].
    """

    alphas: FloatArray
    h: FloatArray
    h_1: FloatArray
    arcs: tuple[tuple[float, float], ...]
    _tracks: tuple[Track, ...] = field(repr=False)

    @property
    def unit(self) -> str:
        """Return the unit of the lengths; empty where it may be any."""
        return self._tracks[0].unit

    def _repr_svg_(self) -> str:
        return path_svg(self)

    @property
    def full_turn(self) -> bool:
        """Return whether the crank turns fully: the path is closed."""
        return self._tracks[0].span.is_turn

    @cached_property
    def x_range(self) -> tuple[float, float]:
        """Return the least and the greatest x of H [m]."""
        return self._range(X)

    @cached_property
    def y_range(self) -> tuple[float, float]:
        """Return the least and the greatest y of H [m]."""
        return self._range(Y)

    @property
    def stride(self) -> float:
        """Return the extent along x, of the path as a whole [m]."""
        return self.x_range[1] - self.x_range[0]

    @property
    def lift(self) -> float:
        """Return the extent along y [m]."""
        return self.y_range[1] - self.y_range[0]

    @cached_property
    def length(self) -> float:
        """
        Return the length of the path [m]; of several arcs, their sum.

        NaN if a sample of a turn is at a singular pose.
        """
        if self.full_turn:
            # The trapezoidal rule converges geometrically for periodic functions.
            return self._width * float(np.hypot(*self._tracks[0].h_1.T).mean())
        return sum(_arc_length(track) for track in self._tracks)

    @cached_property
    def area(self) -> float:
        """
        Return the area that the path encloses [m^2], 1/2 int (x dy - y dx).

        It is positive if counter-clockwise; loops of opposite sense subtract. NaN for an open
        path, and if a sample is at a singular pose, such as a change point.
        """
        if not self.full_turn:
            return nan
        # About the path's centre: no cancellation far from the origin.
        x, y = (self.h - self.h.mean(axis=0)).T
        x_1, y_1 = self.h_1.T
        return self._width * float((x * y_1 - y * x_1).mean()) / 2.0

    @property
    def _width(self) -> float:
        start, end = self.arcs[0]
        return end - start

    def stance(self, ground: float | None = None) -> Stance:
        """Return the stance with the lowest point; parameters and errors as `stances`."""
        return self.stances(ground)[0]

    def stances(self, ground: float | None = None) -> list[Stance]:
        """
        Return the arcs with the foot on the ground, the one with the lowest point first.

        The foot is on the ground while H is at most `ground` above its lowest point and moves
        along x in the same direction as there: backwards.

        Parameters
        ----------
        ground : float, optional
            Height of the band [m]; by default an eighth of the lift, but not below rounding.

        Raises
        ------
        NoStanceError
            The foot does not move along x, but for rounding.
        ValueError
            `ground` is not finite, or not above rounding: 1e-12 of the leg's size, or 1e-8 where
            the crank does not turn fully.

        """
        rounding = (ROUNDING_OF_TURN if self.full_turn else ROUNDING_OF_ARCS) * self._size
        if ground is None:
            ground = max(GROUND_BAND * self.lift, rounding)
        elif not (isinstance(ground, Real) and rounding <= ground < inf):
            unit = f' {self.unit}'.rstrip()
            limit = f'it must be finite and at least {rounding:.3g}{unit}'
            raise ValueError(f'ground = {ground!r}{unit} is refused: {limit}')
        if self.stride < rounding:
            raise NoStanceError(self.stride)
        return stances(self._tracks, ground, ROUNDING * self._size)

    def crank_angles_at_x(self, x: float) -> list[float]:
        """
        Return the crank angles in [0, 2 pi) with this x of H [m], sorted [rad].

        An unreachable x gives an empty list, an extreme x one angle.

        Raises
        ------
        ValueError
            `x` is not finite.

        """
        return self._crank_angles_at(X, 'x', x)

    def crank_angles_at_height(self, y: float) -> list[float]:
        """Return the crank angles in [0, 2 pi) with this y of H [m], as `crank_angles_at_x`."""
        return self._crank_angles_at(Y, 'y', y)

    def nearest_crank_angle(self, point: Sequence[float]) -> Nearest:
        """
        Return the crank angle with H nearest to a point (x, y) [m], and the distance.

        Raises
        ------
        ValueError
            The point is not two finite numbers.

        """
        return inverse.nearest(self._tracks, validation.finite_vector('point', point), self._size)

    @cached_property
    def _size(self) -> float:
        """Return the largest coordinate, the scale of rounding [m]."""
        return float(np.abs(self.h).max())

    def _range(self, s: Coordinate) -> tuple[float, float]:
        extremes = []
        for track in self._tracks:
            for interval in monotone_intervals(track, s):
                extremes += [interval.s_0, interval.s_1]
        return min(extremes), max(extremes)

    def _crank_angles_at(self, s: Coordinate, name: str, level: float) -> list[float]:
        validation.check_rate(name, level)
        return inverse.crank_angles_at(self._tracks, s, level, self._size)


def foot_path(
    leg: Any, *, point: str | tuple[str, float, float] | None = None, samples: int = 720
) -> FootPath:
    """
    Return the path of a leg's foot, or of any point, over all reachable crank angles.

    With change points it may be back after several turns of the crank: these are path angles.

    Extremes and crank angles are refined between the samples to rounding; the samples only have to
    separate them. At the end of an arc the last digit of the crank angle moves the foot by about
    1e-8 of its size, which limits the accuracy there.

    Parameters
    ----------
    leg : Leg
        Any leg, also a FourBar, whose foot is B; it is copied, its own state does not change.
    point : str, or (str, float, float), optional
        The point in place of the foot: its name, such as 'G'; or body, u, v for a coupler point,
        u [m] from the start of the body's first bar along it, v [m] to its left. So
        `('theta3', 0.1, 0.05)` gives a FourBar's coupler curve.
    samples : int
        Samples of a whole turn, at least 32; an arc has its share of them, at least 32.

    Returns
    -------
    FootPath
        The path.

    Raises
    ------
    NoFootPathError
        The leg reaches no crank angle.
    TypeError
        `leg` is none, such as a geometry, or its poses have no foot.
    GeometryError
        There is no such point or body, or it is a fixed pivot; a ValueError.
    ValueError
        `samples` is no whole number, or too few; `point` is no point.

    Examples
    --------
    >>> from klann_ros.kinematics import FourBar
    >>> curve = foot_path(FourBar(0.2, 0.1, 0.25, 0.25), point=('theta3', 0.5, 0.0))
    >>> round(curve.stride, 3), curve.full_turn
    (0.47, True)

    """
    samples = validation.whole_number('samples', samples, MIN_SAMPLES)
    if not all(hasattr(leg, name) for name in LEG_METHODS):
        raise TypeError(f'leg = {leg!r} is refused: it must be a leg, such as a KlannLeg')
    tracked_leg = copy(leg) if point is None else LinkageLeg(_with_foot(leg, point))
    tracked_leg.reset()
    tracks = []
    has_path = hasattr(tracked_leg, 'path_arcs')
    arcs = tracked_leg.path_arcs() if has_path else tracked_leg.reachable_arcs()
    for start, end in arcs:
        share = round(samples * (end - start) / TURN)
        track = Track(tracked_leg, Span(start, end), max(MIN_SAMPLES, share))
        if len(track.t) > 1:
            tracks.append(track)
    if not tracks:
        raise NoFootPathError
    alphas = np.concatenate([track.alphas for track in tracks])
    h = np.concatenate([track.h for track in tracks])
    h_1 = np.concatenate([track.h_1 for track in tracks])
    for array in (alphas, h, h_1):
        array.setflags(write=False)
    solved_arcs = tuple((track.span.start, track.span.end) for track in tracks)
    return FootPath(alphas, h, h_1, solved_arcs, tuple(tracks))


def _arc_length(track: Track) -> float:
    _, h_t, weights = gauss_nodes(track, 0.0, pi, -(-len(track.t) // GAUSS_ORDER))
    return float(np.hypot(*h_t.T) @ weights)


def _with_foot(leg: Any, point: Any) -> Linkage:
    """Return a leg's linkage with another point as its foot."""
    linkage = as_linkage(leg)
    if isinstance(point, str):
        return linkage.with_foot(point)
    try:
        body, u, v = point
    except (TypeError, ValueError):
        msg = f"point = {point!r} is refused: it must be a point's name, or body, u, v"
        raise ValueError(msg) from None
    names = ('P', *(f'P{n}' for n in range(100)))
    unused_name = next(name for name in names if name not in linkage.structure.points)
    return linkage.with_coupler_point(body, u, v, unused_name)
