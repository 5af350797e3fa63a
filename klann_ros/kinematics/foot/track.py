"""The foot along an arc of crank angles: coordinates, derivatives and integrals."""

from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from math import cos, nan, pi, sin
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import KinematicsError, SingularPoseError
import numpy as np


@dataclass(frozen=True)
class Coordinate:
    """
    s = u H.x + v H.y + k |H - P|^2 / 2; arrays of shape (..., 2) in, (...) out.

    With k = 0 it is the position along (u, v); with k = 1 alone half the squared distance from P.
    """

    along: tuple[float, float] = (0.0, 0.0)
    point: tuple[float, float] = (0.0, 0.0)
    k: float = 0.0

    def derivative(self, h: FloatArray, *dh: FloatArray) -> FloatArray:
        """Return s for H, ds for H and dH, or d2s for H, dH and d2H."""
        from_p = h - self.point
        if not dh:
            return _dot(self.along, h) + self.k * _dot(from_p, from_p) / 2.0
        squares = _dot(dh[0], dh[0]) if len(dh) > 1 else 0.0
        return _dot(self.along, dh[-1]) + self.k * (squares + _dot(from_p, dh[-1]))


X = Coordinate((1.0, 0.0))
Y = Coordinate((0.0, 1.0))


def _dot(p: FloatArray | tuple[float, float], q: FloatArray) -> FloatArray:
    """Return the scalar product of vectors along the last axis."""
    x, y = (p[..., 0], p[..., 1]) if isinstance(p, np.ndarray) else p
    return np.asarray(x * q[..., 0] + y * q[..., 1], dtype=np.float64)


@dataclass(frozen=True)
class Span:
    """
    An arc from start to end [rad] with the parameter t from 0 to pi.

    At the end of an arc a dyad is singular, and the pose changes with the square root of the crank
    angle's distance, which is smooth in t for alpha = start + (end - start) sin^2(t/2). A whole
    turn, or several after which a linkage with change points is back, have no ends: alpha =
    start + (end - start) t / pi.
    """

    start: float
    end: float

    @property
    def is_turn(self) -> bool:
        """Return whether the span is a whole turn."""
        return self.end - self.start >= TURN

    def alpha(self, t: float) -> float:
        """Return the crank angle [rad]."""
        if self.is_turn:
            return self.start + self.alpha_1(t) * t
        width = self.end - self.start
        # From the nearer end, to keep the digits of both.
        if t <= pi / 2.0:
            return self.start + width * sin(t / 2.0) ** 2
        return self.end - width * sin((pi - t) / 2.0) ** 2

    def alpha_1(self, t: float) -> float:
        """Return dalpha/dt."""
        width = self.end - self.start
        return width / pi if self.is_turn else width / 2.0 * sin(t)

    def alpha_2(self, t: float) -> float:
        """Return d2alpha/dt2."""
        return 0.0 if self.is_turn else (self.end - self.start) / 2.0 * cos(t)

    def samples(self, n: int) -> list[float]:
        """Return n values of t: of a turn without its end, of an arc with both ends."""
        steps = n if self.is_turn else n - 1
        # The quotient first, so that the last is pi exactly.
        return [pi * (k / steps) for k in range(n)]


# Offsets from the end of an arc, where rounding decides whether a pose can be solved [rad].
END_OFFSETS = (0.0, *(2.0**k for k in range(-52, -19)))


class Track:
    """
    The foot of a leg over a span of crank angles, at n samples, those without a pose omitted.

    t, alphas [rad], h [m] and h_1 [m/rad] are the samples, with dH/dalpha NaN at a singular pose.
    The track owns the leg, whose state changes; a TypeError if its poses have no foot.
    """

    def __init__(self, leg: Any, span: Span, n: int) -> None:
        self.span = span
        self._leg = leg
        # The unit of the lengths; empty where it may be any.
        linkage = getattr(leg, 'linkage', None)
        self.unit: str = linkage.structure.unit if linkage else 'm'
        ts = []
        poses = []
        for t in span.samples(n):
            with suppress(KinematicsError):
                poses.append(self._pose(t))
                ts.append(t)
        if poses and not hasattr(poses[0], 'h'):
            msg = f'leg = {leg!r} is refused: it must be a leg, whose poses have a foot H'
            raise TypeError(msg)
        self.t = np.array(ts)
        self.alphas = np.array([pose.crank_angle for pose in poses])
        self.h = np.array([pose.h for pose in poses]).reshape(-1, 2)
        self.h_1 = np.array([self._h_1(pose) for pose in poses]).reshape(-1, 2)

    def crank_angle(self, t: float) -> float:
        """Return the solvable crank angle in [0, 2 pi) [rad]."""
        return float(self._pose(t, wrapped=True).crank_angle)

    def slopes(self, s: Coordinate) -> FloatArray:
        """Return ds/dalpha at the samples, shape (k,)."""
        return s.derivative(self.h, self.h_1)

    def value(self, s: Coordinate, t: float, order: int = 0) -> float:
        """Return a coordinate of the foot, or a derivative by alpha; NaN at a singular pose."""
        return float(s.derivative(*self._foot(t, order)))

    def value_t(self, s: Coordinate, t: float, order: int) -> float:
        """Return a derivative by t."""
        return float(s.derivative(*self.foot_t(t, order)))

    def foot_t(self, t: float, order: int = 0) -> list[FloatArray]:
        """Return H and its derivatives by t, by the chain rule, shape (2,) each [m]."""
        derivatives = self._foot(t, order)
        alpha_1 = self.span.alpha_1(t)
        if order > 1:
            derivatives[2] = derivatives[2] * alpha_1**2 + derivatives[1] * self.span.alpha_2(t)
        if order:
            derivatives[1] = derivatives[1] * alpha_1
        return derivatives

    def _foot(self, t: float, order: int) -> list[FloatArray]:
        """Return H and its derivatives by alpha."""
        pose = self._pose(t)
        derivatives = [np.array(pose.h)]
        if order:
            derivatives.append(self._h_1(pose))
        if order > 1:
            is_singular = np.isnan(derivatives[1][0])
            h_2 = (nan, nan) if is_singular else self._leg.acceleration(pose, 1.0, 0.0).h
            derivatives.append(np.array(h_2))
        return derivatives

    def _pose(self, t: float, *, wrapped: bool = False) -> Any:
        alpha = self.span.alpha(t)
        period = max(TURN, self.span.end - self.span.start)
        inward = 1.0 if t < pi / 2.0 else -1.0
        for offset in END_OFFSETS:
            solvable = alpha + inward * offset
            if period > TURN:
                # Path angles, not the crank's next ones.
                self._leg.reset()
            try:
                return self._leg.solve(wrap_positive(solvable, period) if wrapped else solvable)
            except KinematicsError as caught:
                error = caught
                if self.span.is_turn:
                    break
        raise error

    def _h_1(self, pose: Any) -> FloatArray:
        try:
            return np.array(self._leg.velocity(pose, 1.0).h)
        except SingularPoseError:
            return np.array((nan, nan))


def wrap_positive(number: float, period: float = TURN) -> float:
    """Return a number in [0, period); a tiny negative one has its remainder rounded to period."""
    remainder = number % period
    return remainder if remainder < period else 0.0


# Nodes of a panel.
GAUSS_ORDER = 8


def gauss_nodes(
    track: Track, t_0: float, t_1: float, panels: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return H, dH/dt and weights at Gauss-Legendre nodes, 8 on each of equal panels of t."""
    x, w = _legendre()
    edges = np.linspace(t_0, t_1, panels + 1)
    half = (t_1 - t_0) / (2 * panels)
    ts = (edges[:-1, None] + half * (1.0 + x)).ravel().tolist()
    h, h_t = np.array([track.foot_t(t, 1) for t in ts]).swapaxes(0, 1)
    return h, h_t, np.tile(half * w, panels)


@cache
def _legendre() -> tuple[FloatArray, FloatArray]:
    # Typed since NumPy 2 only.
    leggauss: Any = np.polynomial.legendre.leggauss
    x, w = leggauss(GAUSS_ORDER)
    return x, w
