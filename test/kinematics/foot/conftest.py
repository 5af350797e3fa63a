"""Legs that are curves: every figure of their paths is known in closed form."""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

from klann_ros.kinematics import SingularPoseError, UnreachableError
import pytest

Curve = Callable[[float], tuple[float, float]]


class CurvePose(NamedTuple):
    crank_angle: float
    h: tuple[float, float]


class CurveMotion(NamedTuple):
    h: tuple[float, float]


class CurveLeg:
    """A leg whose foot follows a curve, with its first and its second derivative."""

    def __init__(
        self, curves: Sequence[Curve], arcs: Sequence[tuple[float, float]] = ((0.0, math.tau),)
    ) -> None:
        self._curves = curves
        self._arcs = list(arcs)

    def solve(self, alpha: float) -> CurvePose:
        is_turn = self._arcs == [(0.0, math.tau)]
        turns = (alpha, alpha + math.tau)
        if not is_turn and not any(a <= turn <= b for a, b in self._arcs for turn in turns):
            raise UnreachableError(alpha, 1, 0.0, True, ('P', 'Q', 'PJ', 'QJ'))
        return CurvePose(alpha, self._curves[0](alpha))

    def velocity(self, pose: CurvePose, rate: float) -> CurveMotion:
        x_1, y_1 = self._derivative(1, pose)
        return CurveMotion((rate * x_1, rate * y_1))

    def acceleration(self, pose: CurvePose, rate: float, change: float) -> CurveMotion:
        (x_1, y_1), (x_2, y_2) = self._derivative(1, pose), self._derivative(2, pose)
        return CurveMotion((rate**2 * x_2 + change * x_1, rate**2 * y_2 + change * y_1))

    def reset(self) -> None:
        pass

    def reachable_arcs(self) -> list[tuple[float, float]]:
        return self._arcs

    def _derivative(self, order: int, pose: CurvePose) -> tuple[float, float]:
        try:
            return self._curves[order](pose.crank_angle)
        except (ZeroDivisionError, ValueError):
            raise SingularPoseError(pose.crank_angle) from None


@pytest.fixture
def ellipse() -> Callable[[float, float], CurveLeg]:
    """Make a leg whose foot goes round an ellipse of the half axes a and b about (1, -2)."""

    def make(a: float, b: float) -> CurveLeg:
        return CurveLeg(
            [
                lambda t: (1.0 + a * math.cos(t), -2.0 + b * math.sin(t)),
                lambda t: (-a * math.sin(t), b * math.cos(t)),
                lambda t: (-a * math.cos(t), -b * math.sin(t)),
            ]
        )

    return make


@pytest.fixture
def half_circle() -> CurveLeg:
    """Make a leg of radius 0.5 about alpha = 6 rad, singular at both ends as linkages are."""

    def y(alpha: float) -> float:
        return math.sqrt(0.25 - math.remainder(alpha - 6.0, math.tau) ** 2)

    return CurveLeg(
        [
            lambda t: (math.remainder(t - 6.0, math.tau), y(t)),
            lambda t: (1.0, -math.remainder(t - 6.0, math.tau) / y(t)),
            lambda t: (0.0, -0.25 / y(t) ** 3),
        ],
        [(5.5, 6.5)],
    )


@pytest.fixture
def wavy() -> Callable[[float], CurveLeg]:
    """Make a leg with x = sin u + k/2 sin 2u, u = alpha - 0.1: extremes as near as k is to 1."""
    sin, cos = math.sin, math.cos

    def make(k: float) -> CurveLeg:
        return CurveLeg(
            [
                lambda t: (sin(t - 0.1) + k / 2 * sin(2 * (t - 0.1)), cos(t)),
                lambda t: (cos(t - 0.1) + k * cos(2 * (t - 0.1)), -sin(t)),
                lambda t: (-sin(t - 0.1) - 2 * k * sin(2 * (t - 0.1)), -cos(t)),
            ]
        )

    return make
