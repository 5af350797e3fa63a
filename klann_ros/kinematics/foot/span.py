"""An arc of crank angles, run through so that the foot's motion is smooth up to its ends."""

from dataclasses import dataclass
from math import cos, pi, sin

from klann_ros.kinematics.angles import TURN


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
