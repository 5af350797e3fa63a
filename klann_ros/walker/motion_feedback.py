"""
Feedback of the measured motion: what a walker falls behind its command by, it makes up.

How fast a walker goes at given rates of its cranks depends on the phase of left to right, by a
factor of two on the spot, and on the floor. Rates that are right in the mean of all phases can be
wrong for a minute. So they are those of

    command + K e,

e being the integral of commanded minus measured motion. The correction is scaled so that no side
changes by more than half of its rate: a side that stopped would stay in a phase in which the
walker hardly turns. Straight on both sides keep one rate, and so the phases of the gait.
"""

from functools import lru_cache

from .steering import Rates, Steering, Twist2D

# The largest part of its rate by which a side is corrected.
MAX_SHARE = 0.5
# The lag is kept up to this multiple of what is corrected at most.
MAX_WINDUP = 6.0
# A measurement over a longer time is not used [s].
MAX_INTERVAL = 0.1
GAIN = 0.5  # [1/s]
NO_MOTION = Twist2D(0.0, 0.0)


class MotionFeedback:
    """
    Correct a commanded motion by the measured one.

    Parameters
    ----------
    steering : Steering
        The walker's.
    gain : float
        K [1/s]; 0 for no correction.

    Attributes
    ----------
    lag : Twist2D
        The integral of commanded minus measured motion [m, rad].

    """

    def __init__(self, steering: Steering, gain: float = GAIN) -> None:
        self._steering, self.gain = steering, gain
        self._nominal = lru_cache(maxsize=1)(steering.rates)
        self.lag = NO_MOTION

    def reset(self) -> None:
        """Forget the lag."""
        self.lag = NO_MOTION

    def measure(self, commanded: Twist2D, measured: Twist2D, seconds: float) -> None:
        """Add what the motion was short of for a time [s]."""
        if not (self.gain and 0.0 < seconds <= MAX_INTERVAL):
            return
        if commanded == NO_MOTION:
            self.reset()
            return
        linear = self.lag.linear + (commanded.linear - measured.linear) * seconds
        angular = self.lag.angular + (commanded.angular - measured.angular) * seconds
        self.lag = Twist2D(linear, angular if commanded.angular else 0.0)

    def rates(self, commanded: Twist2D) -> Rates:
        """Return the rates of the sides for a command, with what makes up the lag."""
        if commanded == NO_MOTION:
            return Rates(0.0, 0.0)
        nominal = self._nominal(commanded)
        if self.lag == NO_MOTION:
            return nominal
        most = MAX_WINDUP * MAX_SHARE * max(map(abs, nominal))
        rate = self.gain * max(map(abs, self._steering.rates(self.lag)))
        if rate > most:
            self.lag = Twist2D(*(each * most / rate for each in self.lag))
        linear, angular = (c + self.gain * e for c, e in zip(commanded, self.lag, strict=True))
        corrected = self._steering.rates(Twist2D(linear, angular))
        share = min(map(_possible_share, nominal, corrected))
        return Rates(*(n + share * (c - n) for n, c in zip(nominal, corrected, strict=True)))


def _possible_share(nominal: float, corrected: float) -> float:
    """Return which part of a correction keeps a side within its bounds, from 0 to 1."""
    change = abs(corrected - nominal)
    return min(1.0, MAX_SHARE * abs(nominal) / change) if change else 1.0
