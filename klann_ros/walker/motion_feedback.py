"""
Feedback of the measured motion: a walker makes up for its lag.

The speed of a walker at given crank rates depends on the floor, and on the phases of its cranks.
So the rates are those of command + K e, e being the integral of commanded minus measured motion.
"""

from math import copysign, pi

from .steering import Twist2D

# The largest correction, as a part of the command; and the largest lag, as a multiple of that.
MAX_SHARE, MAX_WINDUP = 0.5, 6.0
# K of the yaw rate, as a multiple of that of the speed: in curves, whose yaw comes in bursts, and
# on the spot, where it comes evenly. Chosen in MuJoCo, as those of `turn_plan`.
CURVE_GAIN, SPOT_GAIN = 0.5, 2.0
# A measurement over a longer time is not used [s].
MAX_INTERVAL = 0.1


class MotionFeedback:
    """
    Correct a commanded motion by the measured one.

    Parameters
    ----------
    gain : float
        K of the speed [1/s]; 0 for no correction.
    speed : float
        Of the walker, by its crank rate [m/rad].

    Attributes
    ----------
    lag : Twist2D
        The integral of commanded minus measured motion [m, rad].

    """

    def __init__(self, gain: float, speed: float) -> None:
        self.gain, self._step = gain, abs(speed) * pi
        self.reset()

    def reset(self) -> None:
        """Forget the lag."""
        self.lag = Twist2D(0.0, 0.0)

    def measure(self, commanded: Twist2D, measured: Twist2D, seconds: float) -> None:
        """Add the motion of a time [s]."""
        if not (self.gain and 0.0 < seconds <= MAX_INTERVAL):
            return
        limits = [MAX_WINDUP * MAX_SHARE / self.gain * abs(each) for each in commanded]
        if _is_on_spot(commanded):
            limits[0] = self._step
        self.lag = Twist2D(
            *(
                max(-limit, min(limit, lag + (wanted - found) * seconds))
                for lag, wanted, found, limit in zip(
                    self.lag, commanded, measured, limits, strict=True
                )
            )
        )

    def corrected(self, commanded: Twist2D) -> Twist2D:
        """Return the motion to drive for; straight on the yaw is not corrected."""
        (linear, angular), lag = commanded, self.lag
        if _is_on_spot(commanded):
            gain = SPOT_GAIN * self.gain
            return Twist2D(self.gain * lag.linear, _corrected(angular, gain * lag.angular))
        gain = CURVE_GAIN * self.gain
        return Twist2D(
            _corrected(linear, self.gain * lag.linear), _corrected(angular, gain * lag.angular)
        )


def _is_on_spot(commanded: Twist2D) -> bool:
    return commanded.linear == 0.0 and commanded.angular != 0.0


def _corrected(wanted: float, correction: float) -> float:
    return wanted + copysign(min(abs(correction), MAX_SHARE * abs(wanted)), correction)
