"""
Crank rates that turn a walker in the phases in which it can turn.

With p the mean phase of left and right, and q half their difference, speed comes from p' and yaw
from q'. The yaw for q' depends on p by up to 30 times: where the standing feet of both sides are
at the wrong ends of the body, their drives cancel. On the spot p stands still, so a walker may
hardly turn for minutes; in a tight curve one side hardly turns, to the same effect. So q moves
where turning is effective,

    q' = w s(p) G(p) / (M d(p) max(g(p, q), MIN_RATIO G(p))),   p' = v / (V d(p)),

g being the yaw gain, G its mean over q, V the speed gain, s ~ G^SHARPNESS with mean 1, M the mean
of s G, and d = 1 - T + T s G / M the relative time at a phase, with mean 1: T of the time is for
turning, the rest for walking on. On the spot p stays at the greatest G; walking there makes up for
the drift of the body.
"""

from math import floor

from klann_ros.kinematics.angles import TURN
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# The constants were chosen in MuJoCo on walker6_two_motors and walker8_two_motors.
# Exponent of the gain: how narrow the range of p is in which a walker turns.
SHARPNESS = 2.0
# Least ratio of local to mean gain that q' is raised for.
MIN_RATIO = 0.2
# Standard deviation of the gains' low-pass filter over p and q [rad].
GAIN_FILTER = 0.1
# p' in phases in which it cannot turn, at least, as a part of the rate for turning.
PASSING_RATE = 0.6
# p' towards the best phase, on the spot, likewise; the distance from which on it is slower [rad];
# and the part of it that walking on the spot may have, so that p stays near.
SEEKING_RATE, SEEKING_RANGE, HOLD_SHARE = 2.0, 0.3, 1.2
# Multiple of the variation of the speed over q by which walking on the spot follows it.
STEP_SWING = 1.5
# Phases with this part of the greatest gain are as good.
PEAK_RATIO = 0.9
# Least relative time at a phase.
MIN_DENSITY = 0.02


class TurnPlan:
    """
    Rates of p and q, by p and q.

    Parameters
    ----------
    speed, yaw : numpy.ndarray, shape (n, n)
        Speed at p' = 1 rad/s, and yaw rate at q' = 1 rad/s, by p and q, in the middles of n equal
        intervals of a turn.

    Attributes
    ----------
    is_possible : bool
        Whether there are phases in which q' turns it to the left.

    """

    def __init__(self, speed: Array, yaw: Array) -> None:
        smooth = _low_pass(yaw)
        gain = np.maximum(smooth.mean(axis=1), 0.0)
        self.is_possible = bool(gain.any() and yaw.mean() > 0.0)
        if not self.is_possible:
            return
        self._count = len(yaw)
        share = gain**SHARPNESS / (gain**SHARPNESS).mean()
        effective = float((share * gain).mean())
        # The part of q' that is needed where turning is effective.
        self._part = float(yaw.mean()) / effective
        self._turning = _Circle(share * self._part)
        self._time = _Circle(share * gain / effective)
        ratio = smooth / np.maximum(gain, np.finfo(float).tiny)[:, None]
        self._boost = _Torus(1.0 / np.maximum(ratio, MIN_RATIO))
        steps = _low_pass(speed) / speed.mean()
        self._step = _Torus(1.0 + STEP_SWING * (steps - steps.mean(axis=1)[:, None]))
        is_peak = (gain >= np.roll(gain, 1)) & (gain > np.roll(gain, -1))
        peaks = np.flatnonzero(is_peak & (gain >= PEAK_RATIO * gain.max()))
        self._peaks: list[float] = ((peaks + 0.5) * (TURN / self._count)).tolist()

    def rates(
        self, p: float, q: float, walking: float, turning: float, *, on_spot: bool = False
    ) -> tuple[float, float]:
        """
        Return p' and q' [rad/s].

        Parameters
        ----------
        p, q : float
            Mean phase of left and right, and half their difference [rad].
        walking, turning : float
            p' and q' for the motion in the mean over all phases [rad/s].
        on_spot : bool
            Whether p is to stay at the best phase.

        """
        if not turning:
            return walking, 0.0
        effective = abs(turning) * self._part
        share = 1.0 if on_spot else 1.0 - min(0.5, abs(walking) / (PASSING_RATE * effective))
        time = max(MIN_DENSITY, 1.0 + share * (self._time.at(p) - 1.0))
        turns = turning * self._turning.at(p) * self._boost.at(p, q) / time
        if not on_spot:
            return walking / time, turns
        most = SEEKING_RATE * effective
        # Walking in phases in which a step is long, and back where it is short.
        walks = _clip(walking * self._step.at(p, q), HOLD_SHARE * most)
        away = min((_wrapped(peak - p) for peak in self._peaks), key=abs)
        return walks + most * _clip(away / SEEKING_RANGE, 1.0), turns


class _Circle:
    """Linear interpolation of a periodic function, given in the middles of equal intervals."""

    def __init__(self, values: Array) -> None:
        self._values, self._count = values.tolist(), len(values)

    def at(self, angle: float) -> float:
        low, high, part = _between(angle, self._count)
        a, b = float(self._values[low]), float(self._values[high])
        return a + part * (b - a)


class _Torus:
    """Bilinear interpolation of a function of two angles, likewise."""

    def __init__(self, values: Array) -> None:
        self._rows = [_Circle(row) for row in values]

    def at(self, p: float, q: float) -> float:
        low, high, part = _between(p, len(self._rows))
        a = self._rows[low].at(q)
        return a + part * (self._rows[high].at(q) - a)


def _between(angle: float, count: int) -> tuple[int, int, float]:
    at = angle / TURN * count - 0.5
    low = floor(at)
    return low % count, (low + 1) % count, at - low


def _low_pass(values: Array) -> Array:
    """Return a periodic map through a Gaussian filter."""
    order = np.fft.fftfreq(len(values), 1.0 / len(values)) * GAIN_FILTER
    weights = np.exp(-0.5 * (order[:, None] ** 2 + order**2))
    return np.asarray(np.fft.ifft2(np.fft.fft2(values) * weights).real, dtype=np.float64)


def _clip(value: float, most: float) -> float:
    return max(-most, min(most, value))


def _wrapped(angle: float) -> float:
    return (angle + TURN / 2.0) % TURN - TURN / 2.0
