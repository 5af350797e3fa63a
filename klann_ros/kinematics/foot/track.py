"""The foot along an arc of crank angles, and what of its position is asked."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
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

    With k = 0 it is how far H is along a direction (u, v), with k = 1 alone half the square of its
    distance from a point P.
    """

    along: tuple[float, float] = (0.0, 0.0)
    point: tuple[float, float] = (0.0, 0.0)
    k: float = 0.0

    def value(self, h: FloatArray) -> FloatArray:
        """Return s(H)."""
        from_p = h - self.point
        return _dot(self.along, h) + self.k * _dot(from_p, from_p) / 2.0

    def slope(self, h: FloatArray, h_1: FloatArray) -> FloatArray:
        """Return ds/dalpha for H and dH/dalpha."""
        return _dot(self.along, h_1) + self.k * _dot(h - self.point, h_1)

    def curvature(self, h: FloatArray, h_1: FloatArray, h_2: FloatArray) -> FloatArray:
        """Return d2s/dalpha2 for H and its first two derivatives."""
        round_p = _dot(h_1, h_1) + _dot(h - self.point, h_2)
        return _dot(self.along, h_2) + self.k * round_p


X, Y = Coordinate((1.0, 0.0)), Coordinate((0.0, 1.0))


def _dot(p: FloatArray | tuple[float, float], q: FloatArray) -> FloatArray:
    (x, y) = (p[..., 0], p[..., 1]) if isinstance(p, np.ndarray) else p
    return np.asarray(x * q[..., 0] + y * q[..., 1], dtype=np.float64)


@dataclass(frozen=True)
class Span:
    """
    An arc from start to end [rad] with the parameter t from 0 to pi.

    At the end of an arc a dyad is in line, and the pose changes with the square root of the crank
    angle's distance from it. Over part of a turn therefore

        alpha = start + (end - start) sin^2(t/2),

    of which the root is smooth in t. A whole turn has no ends: alpha = start + 2 t.
    """

    start: float
    end: float

    @property
    def is_turn(self) -> bool:
        """Return whether it is a whole turn, which ends where it starts."""
        return self.end - self.start >= TURN

    def alpha(self, t: float) -> float:
        """Return the crank angle [rad]."""
        if self.is_turn:
            return self.start + 2.0 * t
        width = self.end - self.start
        # From the nearer end, so that both keep their digits.
        if t <= pi / 2.0:
            return self.start + width * sin(t / 2.0) ** 2
        return self.end - width * sin((pi - t) / 2.0) ** 2

    def alpha_1(self, t: float) -> float:
        """Return dalpha/dt."""
        return 2.0 if self.is_turn else (self.end - self.start) / 2.0 * sin(t)

    def alpha_2(self, t: float) -> float:
        """Return d2alpha/dt2."""
        return 0.0 if self.is_turn else (self.end - self.start) / 2.0 * cos(t)

    def samples(self, n: int) -> list[float]:
        """Return n values of t: of a turn without its end, of another arc with both."""
        steps = n if self.is_turn else n - 1
        # The quotient first: so the last is pi and not the next float.
        return [pi * (k / steps) for k in range(n)]


# At the very end of an arc rounding decides whether a pose can be solved; how far before it the
# foot is looked for then [rad].
BACK_OFF = (0.0, *(2.0**k for k in range(-52, -19)))


class Track:
    """
    The foot of a leg over a span of crank angles, at n samples; those without a pose are left out.

    t, alphas, h and h_1 are the span's parameter, the crank angles [rad], H [m] and dH/dalpha
    [m/rad] at the samples; dH/dalpha is NaN at a singular pose. Nobody else may solve the leg. A
    TypeError says that its poses have no foot.
    """

    def __init__(self, leg: Any, span: Span, n: int) -> None:
        self.span = span
        self._leg = leg
        solved = list(self._solvable(span.samples(n)))
        if solved and not hasattr(solved[0][1], 'h'):
            msg = f'leg = {leg!r} is refused: it must be a leg, whose poses have a foot H'
            raise TypeError(msg)
        self.t = np.array([t for t, _ in solved])
        self.alphas = np.array([pose.crank_angle for _, pose in solved])
        self.h = np.array([pose.h for _, pose in solved]).reshape(-1, 2)
        self.h_1 = np.array([self._h_1(pose) for _, pose in solved]).reshape(-1, 2)

    def h_at(self, t: float) -> FloatArray:
        """Return H, shape (2,) [m]."""
        return np.array(self._pose(t).h)

    def h_t_at(self, t: float) -> FloatArray:
        """Return dH/dt, shape (2,)."""
        return self._h_1(self._pose(t)) * self.span.alpha_1(t)

    def crank_angle(self, t: float) -> float:
        """Return the crank angle in [0, 2 pi), one that can be solved [rad]."""
        return float(self._pose(t, wrapped=True).crank_angle)

    def value(self, s: Coordinate, t: float) -> float:
        """Return a coordinate of the foot."""
        return float(s.value(self.h_at(t)))

    def slope(self, s: Coordinate, t: float) -> float:
        """Return ds/dalpha; NaN at a singular pose."""
        pose = self._pose(t)
        return float(s.slope(np.array(pose.h), self._h_1(pose)))

    def slope_t(self, s: Coordinate, t: float) -> float:
        """Return ds/dt by the chain rule."""
        return self.slope(s, t) * self.span.alpha_1(t)

    def slopes(self, s: Coordinate) -> FloatArray:
        """Return ds/dalpha at the samples, shape (k,)."""
        return s.slope(self.h, self.h_1)

    def curvature(self, s: Coordinate, t: float) -> float:
        """Return d2s/dalpha2; NaN at a singular pose."""
        pose = self._pose(t)
        h_2 = np.array(self._acceleration(pose))
        return float(s.curvature(np.array(pose.h), self._h_1(pose), h_2))

    def curvature_t(self, s: Coordinate, t: float) -> float:
        """Return d2s/dt2 by the chain rule."""
        alpha_1, alpha_2 = self.span.alpha_1(t), self.span.alpha_2(t)
        return self.curvature(s, t) * alpha_1**2 + self.slope(s, t) * alpha_2

    def _solvable(self, ts: list[float]) -> Iterator[tuple[float, Any]]:
        for t in ts:
            pose = None
            with suppress(KinematicsError):
                pose = self._pose(t)
            if pose is not None:
                yield t, pose

    def _pose(self, t: float, *, wrapped: bool = False) -> Any:
        alpha = self.span.alpha(t)
        inward = 1.0 if t < pi / 2.0 else -1.0
        for back_off in BACK_OFF:
            near = alpha + inward * back_off
            try:
                return self._leg.solve(_wrapped(near) if wrapped else near)
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

    def _acceleration(self, pose: Any) -> tuple[float, float]:
        try:
            x, y = self._leg.acceleration(pose, 1.0, 0.0).h
        except SingularPoseError:
            return nan, nan
        return x, y


def _wrapped(alpha: float) -> float:
    """Return the angle in [0, 2 pi); a tiny negative one has its remainder rounded to 2 pi."""
    rest = alpha % TURN
    return rest if rest < TURN else 0.0
